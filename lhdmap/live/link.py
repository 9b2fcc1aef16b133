"""The thread that keeps a source running: a lost link is made again, after a while that grows."""

from __future__ import annotations

import threading
import time

from lhdmap.live.inbox import Inbox
from lhdmap.live.source import LinkLost, LiveSource

_FIRST_S, _MOST_S = 0.25, 8.0
_HELD_S = 10.0  # a link that has held for so long begins with short waits again


class Link:
    """Runs a source into an inbox until it ends, or `stop` is called."""

    def __init__(self, source: LiveSource, inbox: Inbox) -> None:
        self._source, self._inbox = source, inbox
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """Ask for the end; what was received already is still worked on."""
        self._stop.set()

    def close(self) -> None:
        """End the thread."""
        self._stop.set()
        self._inbox.end()  # a source that waits for room must not wait for ever
        self._thread.join(5.0)

    def _run(self) -> None:
        wait_s = _FIRST_S
        try:
            while not self._stop.is_set():
                began_s = time.monotonic()
                try:
                    self._source.run(self._inbox, self._stop)
                    break
                except LinkLost as lost:
                    wait_s = _FIRST_S if time.monotonic() - began_s > _HELD_S else wait_s
                    self._inbox.say(f"{self._source.address}: {lost}; trying again")
                    self._inbox.tally.reconnects += 1
                    self._stop.wait(wait_s)
                    wait_s = min(2.0 * wait_s, _MOST_S)
        except BaseException as error:  # noqa: BLE001  # is raised where the messages are read
            self._inbox.end(error)
            return
        self._inbox.end()

"""Between the thread that receives and the one that computes: a bounded queue; what comes is recorded before it may be dropped."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

from lhdmap.live.recorder import LiveRecorder
from lhdmap.live.source import Announced, LiveMessage
from lhdmap.live.tally import MessageTally

MOST_MESSAGES, MOST_BYTES = 6000, 192 << 20  # 20 s of two scanners and the slow sensors; of 3D scanners by their size
_SAID_KEPT = 1000
_GAP_WORDS = "{topic}: nothing came for {gap_s:.1f} s"


class _BoundedQueue:
    """Messages that wait, counted by number and bytes; `full` where either bound is reached."""

    def __init__(self, most: tuple[int, int]) -> None:
        self._most = most
        self._messages: deque[LiveMessage] = deque()
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._messages)

    def append(self, message: LiveMessage, size: int) -> None:
        self._messages.append(message)
        self._bytes += size

    def popleft(self) -> LiveMessage:
        message = self._messages.popleft()
        self._bytes -= len(message.data)
        return message

    @property
    def full(self) -> bool:
        return len(self._messages) >= self._most[0] or self._bytes >= self._most[1]


class Inbox:
    """A `Sink` for a source, and an iterator's other end for the reader.

    `waits`: hold the source up where the queue is full, instead of dropping its oldest message.
    """

    def __init__(
        self,
        recorder: LiveRecorder,
        tally: MessageTally,
        *,
        waits: bool,
        most: tuple[int, int] = (MOST_MESSAGES, MOST_BYTES),
        heard: Callable[[str], None] | None = None,
    ) -> None:
        self._recorder, self.tally, self._waits = recorder, tally, waits
        self._heard = heard
        self._queue = _BoundedQueue(most)
        self._changed = threading.Condition()
        self._ended = False
        self._error: BaseException | None = None
        self.announced: dict[tuple[str, str, str], Announced] = {}
        self.said: deque[str] = deque(maxlen=_SAID_KEPT)
        self.kept = 0  # messages that the reader took and has not handed on yet

    def __len__(self) -> int:
        """How many messages wait."""
        return len(self._queue) + self.kept

    def announce(self, topic: Announced) -> None:
        """Take note of a topic that there is."""
        with self._changed:
            if not self._ended:
                self.announced.setdefault((topic.topic, topic.type_name, topic.encoding), topic)
                self._recorder.announce(topic)

    def put(self, message: LiveMessage) -> None:
        """Record a message and queue it; where the queue is full, wait, or drop the oldest one."""
        with self._changed:
            if self._waits:
                self._changed.wait_for(lambda: self._ended or not self._queue.full)
            if self._ended:
                return
            gap_s = self.tally.count(message.topic, message.log_time_ns, len(message.data))
            if gap_s is not None:
                self._say(_GAP_WORDS.format(topic=message.topic, gap_s=gap_s))
            self._queue.append(self._recorder.write(message), len(message.data))
            while self._queue.full and len(self._queue) > 1 and not self._waits:
                self._drop(self._queue.popleft())
            self._changed.notify_all()

    def missed(self, topic: str, count: int) -> None:
        """Count messages that the sender counted and that did not come."""
        with self._changed:
            self.tally.missed[topic] += count

    def backlog_given_up(self) -> None:
        """Count that messages which the sender still held were given up."""
        with self._changed:
            self.tally.backlogs += 1

    def say(self, text: str) -> None:
        """Tell a person something."""
        with self._changed:
            self._say(text)

    def get(self, timeout_s: float) -> LiveMessage | None:
        """Return the next message; None where none came in time, or none will.

        Raises:
            BaseException: what ended the source.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._queue or self._ended, timeout_s)
            if not self._queue:
                if self._error is not None:
                    raise self._error
                return None
            message = self._queue.popleft()
            if self._waits:
                self._changed.notify_all()
            return message

    @property
    def over(self) -> bool:
        """Whether nothing is left, and nothing will come: not while there is an error to raise."""
        return self._ended and not self._queue and self._error is None

    def end(self, error: BaseException | None = None) -> None:
        """Close the log: no more will come; `error`: why, where it went wrong."""
        with self._changed:
            if not self._ended:
                self._ended, self._error = True, error
                self._recorder.close()
            self._changed.notify_all()

    def _drop(self, message: LiveMessage) -> None:
        if not self.tally.dropped:
            self._say("the computer is too slow: messages are dropped (they are in the log)")
        self.tally.dropped[message.topic] += 1

    def _say(self, text: str) -> None:
        self.said.append(text)
        if self._heard is not None:
            self._heard(text)

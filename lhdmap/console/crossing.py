"""A simulated radio link between a console and a machine that is replayed: what it loses, and how late the rest is."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple

from lhdmap.console.messages import Beat, Command, Message, Status

Radio = Callable[[str, int], int | None]
"""Topic and the machine's time (ns) to the delay of a message that is sent then (ns); None: it is lost."""

_MOST = 200
TICK, BEAT, COMMAND, SAYS = "console/tick", "console/beat", "console/command", "console/says"


class _Late(NamedTuple):
    due_ns: int
    message: Message


class Crossing:
    """Both ways of the link. A sign of life that is lost is gone; what must arrive is sent again each turn until it does.

    `machine_ns`: the machine's time, set in each of its turns.
    """

    def __init__(self, radio: Radio, speed: float) -> None:
        """`speed`: how much faster than the clock the machine's time goes."""
        self._radio, self._speed, self.machine_ns = radio, speed or 1.0, 0
        self._heard: deque[tuple[Message, int]] = deque(maxlen=_MOST)
        self._late: deque[_Late] = deque()
        self._says: deque[tuple[Message, str]] = deque(maxlen=_MOST)

    def heard(self, message: Message, clock_ns: int) -> None:
        """Take a message of the console."""
        self._heard.append((message, clock_ns))

    def says(self, message: Message, key: str) -> None:
        """Take a message of the machine."""
        self._says.append((message, key))

    def arrived(self, clock_ns: int) -> Iterator[tuple[Message, int]]:
        """Yield what is through, with the clock's time at which it was."""
        for message, heard_ns in [self._heard.popleft() for _ in range(len(self._heard))]:
            delay_ns = self._delay_ns(message)
            if delay_ns is not None:
                self._late.append(_Late(heard_ns + round(delay_ns / self._speed), message))
            elif isinstance(message, Command):
                self._heard.append((message, heard_ns))
        for one in sorted((late for late in self._late if late.due_ns <= clock_ns), key=lambda late: late.due_ns):
            self._late.remove(one)
            yield one.message, one.due_ns

    def sent(self) -> Iterator[tuple[Message, str]]:
        """Yield what goes to the console now, in order; a state that is lost is gone, the next one is newer."""
        while self._says:
            message, key = self._says[0]
            lost = self._radio(SAYS, self.machine_ns) is None
            if lost and not isinstance(message, Status):
                return
            self._says.popleft()
            if not lost:
                yield message, key

    def _delay_ns(self, message: Message) -> int | None:
        """Return the delay of a message; of a sign of life that of its tick as well."""
        ways = (TICK, BEAT) if isinstance(message, Beat) else (COMMAND,)
        delays = [self._radio(topic, self.machine_ns) for topic in ways]
        return None if None in delays else sum(delay or 0 for delay in delays)

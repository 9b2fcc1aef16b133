"""What a sensor is, when it is due, and how many are read: `read_all` for a motion that is known, `Due` step by step."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

import numpy as np

from lhdmap.messages import FloatArray, Message, Record
from lhdmap.roles import ROLES
from lhdmap.simulation.history import SECOND_NS, START_NS, History
from lhdmap.simulation.sensing.chance import Chance
from lhdmap.simulation.surroundings import SurroundingsView

NEVER_NS = 2**63 - 1
"""When a sensor is due that has nothing more to say."""


class Sensor(Protocol):
    """Something on the machine that writes to one topic.

    A reading may depend on the history up to `next_ns`, on the world, on chance (`Chance`), and on the readings before it,
    and on nothing else: then a run that is stepped gives the same bytes as one whose motion is known beforehand.
    """

    @property
    def name(self) -> str:
        """Name, unlike those of all other sensors of the machine."""
        ...

    @property
    def topic(self) -> str:
        """Topic that it writes to; faults are told by it."""
        ...

    @property
    def next_ns(self) -> int:
        """Log time at which the next reading is complete."""
        ...

    def read(self, history: History, world: SurroundingsView) -> list[Record]:
        """Return the reading that is due at `next_ns` (none where there is nothing to say), and go on to the next."""
        ...


class Beat:
    """Stamps at a rate, the first `offset_s` after the start of the clock."""

    def __init__(self, rate_hz: float, offset_s: float = 0.0) -> None:
        self.rate_hz, self.offset_s, self.index = rate_hz, offset_s, 0
        self.stamp_ns = self.at(0)

    def at(self, index: int) -> int:
        """Return the stamp with that index."""
        return START_NS + round((self.offset_s + index / self.rate_hz) * SECOND_NS)

    def advance(self) -> None:
        """Go on to the next stamp."""
        self.index += 1
        self.stamp_ns = self.at(self.index)


Measure = Callable[[int, FloatArray, np.random.Generator], Message | None]
"""What is measured: message for stamp, state (20,) at it and source of chance; None for nothing to say."""


class Sampled:
    """A sensor that tells of the machine's state at its stamp, such as an encoder."""

    def __init__(
        self, name: str, beat: Beat, measure: Measure, seed: int, *, topic: str = "", delay_ns: int = 0
    ) -> None:
        """`topic` is that of the role `name` where it is not told; the log time is `delay_ns` after the stamp."""
        self.name, self.topic = name, topic or ROLES[name].topic
        self._beat, self._measure, self._chance, self._delay_ns = beat, measure, Chance(seed, name), delay_ns

    @property
    def next_ns(self) -> int:
        """Log time of the next reading."""
        return self._beat.stamp_ns + self._delay_ns

    def read(self, history: History, world: SurroundingsView) -> list[Record]:
        """Return the reading that is due."""
        beat, due_ns = self._beat, self.next_ns
        message = self._measure(beat.stamp_ns, history.state(beat.stamp_ns), self._chance.of(beat.index))
        beat.advance()
        return [] if message is None else [Record(self.topic, due_ns, message)]


class Due:
    """Sensors in the order in which they are due; at the same time in the order in which they were given."""

    def __init__(self, sensors: Sequence[Sensor]) -> None:
        self._sensors = list(sensors)
        self._heap = [(sensor.next_ns, order) for order, sensor in enumerate(self._sensors)]
        heapq.heapify(self._heap)

    def read(self, history: History, world: SurroundingsView) -> Iterator[Record]:
        """Yield all that is complete by the end of the history, in the order of log time."""
        heap, last_ns = self._heap, history.last_ns
        while heap and heap[0][0] <= last_ns:
            order = heap[0][1]
            sensor = self._sensors[order]
            records = sensor.read(history, world)
            heapq.heapreplace(heap, (sensor.next_ns, order))
            yield from records


def read_all(sensors: Sequence[Sensor], history: History, world: SurroundingsView) -> Iterator[Record]:
    """Yield what sensors say of a whole history, in the order of log time."""
    return Due(sensors).read(history, world)

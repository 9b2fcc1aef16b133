"""What a mission's time went into: phases without gap or overlap, and the cycles that they make up."""

from __future__ import annotations

import math
from enum import StrEnum
from typing import NamedTuple


class Phase(StrEnum):
    """What the machine does, or waits for."""

    IDLE = "idle"
    ROUTE = "route"
    TRAM = "tram"
    QUEUE_LOAD = "queue at the load point"
    LOAD = "load"
    HAUL = "haul"
    QUEUE_DUMP = "queue at the dump"
    DUMP = "dump"
    RETURN = "return"
    PARK = "park"
    REFUEL = "refuel"
    ASSISTANCE = "assistance"
    TRAFFIC = "traffic"
    OBSTACLE = "obstacle"
    STOPPED = "safety stop"
    PLACE = "place not known"
    NO_ROUTE = "no route"
    ABORTED = "aborted"


DRIVES = (Phase.TRAM, Phase.HAUL, Phase.RETURN, Phase.PARK)
HOLDS = (
    Phase.QUEUE_LOAD,
    Phase.QUEUE_DUMP,
    Phase.TRAFFIC,
    Phase.OBSTACLE,
    Phase.STOPPED,
    Phase.PLACE,
    Phase.NO_ROUTE,
    Phase.ASSISTANCE,
)
"""Phases in which the machine stands though it has something to do: stops, with a cause and a place."""


class Interval(NamedTuple):
    """A phase from a stamp to another: where (place or node of the map), why, how far was driven in it (nan: not known)."""

    phase: Phase
    from_ns: int
    to_ns: int
    place: str = ""
    cause: str = ""
    distance_m: float = 0.0

    @property
    def s(self) -> float:
        """How long it is, seconds."""
        return 1e-9 * (self.to_ns - self.from_ns)


class Cycle(NamedTuple):
    """A bucket from the end of the dump before to the end of its own: what was done, and what came of it.

    `finished`: it was dumped; the last one of a run may not have been. `fill`: mass by the payload that is wanted, nan: not known.
    `slip`: of the wheels while loading, share; nan: not known.
    """

    machine: str
    number: int
    load: str
    dump: str
    intervals: tuple[Interval, ...]
    mass_t: float = float("nan")
    fill: float = float("nan")
    attempts: int = 0
    slip: float = float("nan")
    finished: bool = True

    @property
    def from_ns(self) -> int:
        """When it began."""
        return self.intervals[0].from_ns

    @property
    def to_ns(self) -> int:
        """When it ended."""
        return self.intervals[-1].to_ns

    def seconds(self, *phases: Phase) -> float:
        """Return how long it was in some phases, all of them where none is given."""
        return sum(one.s for one in self.intervals if not phases or one.phase in phases)

    @property
    def distance_m(self) -> float:
        """How far was driven."""
        return sum(one.distance_m for one in self.intervals)


class Ledger:
    """Takes what the machine is at, moment by moment; the intervals that it keeps follow each other without a gap."""

    def __init__(self) -> None:
        self._done: list[Interval] = []
        self._now: Interval | None = None
        self._odometer_m = math.nan

    def note(self, now_ns: int, phase: Phase, place: str, cause: str, odometer_m: float) -> None:
        """Note the phase from now on.

        A stamp before the last one is taken for the last. An odometer that is not finite tells nothing; where it never told
        anything the ways are nan.
        """
        now, known = self._now, math.isfinite(odometer_m)
        driven_m = max(odometer_m - self._odometer_m, 0.0) if known and math.isfinite(self._odometer_m) else 0.0
        self._odometer_m = odometer_m if known else self._odometer_m
        way_m = 0.0 if math.isfinite(self._odometer_m) else math.nan
        if now is None:
            self._now = Interval(phase, now_ns, now_ns, place, cause, way_m)
            return
        now = now._replace(to_ns=max(now_ns, now.to_ns), distance_m=now.distance_m + driven_m)
        if (now.phase, now.place) == (phase, place):
            self._now = now
            return
        if now.to_ns > now.from_ns:
            self._done.append(now)
        self._now = Interval(phase, now.to_ns, now.to_ns, place, cause, way_m)

    def take(self) -> tuple[Interval, ...]:
        """Return the intervals so far, and begin anew: the phase of now goes on in the next ones."""
        now, done = self._now, self._done
        self._done = []
        if now is not None and now.to_ns > now.from_ns:
            done.append(now)
            self._now = now._replace(from_ns=now.to_ns, distance_m=0.0 * now.distance_m)
        return tuple(done)

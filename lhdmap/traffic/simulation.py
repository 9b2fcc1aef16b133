"""Several machines over hours, event by event: how much more than one machine does is dumped, and how long they wait."""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from lhdmap.traffic.control import Grant, TrafficControl
from lhdmap.traffic.sections import Haul, Leg, SectionMap, Times

SECOND_NS = 1_000_000_000


class Shift(NamedTuple):
    """What came of it: buckets dumped by each machine, the longest wait for a section (s), all waits together (s)."""

    buckets: dict[str, int]
    longest_wait_s: float
    waits_s: float
    hours: float

    @property
    def total(self) -> int:
        """All buckets."""
        return sum(self.buckets.values())

    @property
    def per_hour(self) -> float:
        """Buckets per hour."""
        return self.total / self.hours


class Chance(NamedTuple):
    """How working times vary: coefficient of variation of loading (lognormal) and dumping (logistic), share of their means."""

    seed: int = 0
    load_cv: float = 0.35
    dump_cv: float = 0.15


def simulate(
    sections: SectionMap,
    hauls: Mapping[str, Haul],
    hours: float = 4.0,
    times: Times | None = None,
    chance: Chance | None = None,
    machine_m: float = 10.0,
) -> Shift:
    """Let machines haul for some hours under section control."""
    return _Simulation(sections, hauls, times or Times(), chance or Chance(), machine_m).run(hours)


class _Simulation:
    def __init__(
        self, sections: SectionMap, hauls: Mapping[str, Haul], times: Times, chance: Chance, machine_m: float
    ) -> None:
        self._map, self._hauls, self._times, self._chance, self._machine_m = sections, hauls, times, chance, machine_m
        self._control = TrafficControl(sections, hauls)
        self._random = np.random.default_rng(chance.seed)
        self._queue: list[tuple[int, int, str, str]] = []
        self._count = 0
        self._buckets = dict.fromkeys(hauls, 0)
        self._longest = self._waits = 0

    def run(self, hours: float) -> Shift:
        """Return what the machines have hauled in so many hours, and how long they waited."""
        end_ns = round(hours * 3600 * SECOND_NS)
        for name in self._hauls:
            self._at(0, "ready", name)
        while self._queue and self._queue[0][0] <= end_ns:
            now_ns, _, what, name = heapq.heappop(self._queue)
            if what == "ready":
                self._control.wants(name, now_ns)
            elif what == "left":
                self._control.left(name)
            else:
                self._buckets[name] += 1
                continue
            since = self._control.waiting()
            for grant in self._control.step(now_ns):
                self._waited(now_ns - since[grant.machine])
                self._drives(now_ns, grant)
        for since_ns in self._control.waiting().values():
            self._waited(end_ns - since_ns)
        return Shift(self._buckets, self._longest / SECOND_NS, self._waits / SECOND_NS, hours)

    def _waited(self, wait_ns: int) -> None:
        self._longest = max(self._longest, wait_ns)
        self._waits += wait_ns

    def _at(self, at_ns: int, what: str, name: str) -> None:
        self._count += 1
        heapq.heappush(self._queue, (at_ns, self._count, what, name))

    def _drives(self, now_ns: int, grant: Grant) -> None:
        haul, section = self._hauls[grant.machine], self._map.section[grant.section]
        loads = grant.leg == Leg.LOADED and grant.section == haul.load
        dumps = grant.leg == Leg.HOME and grant.section == haul.dump
        loaded = (grant.leg == Leg.LOADED and not loads) or dumps
        drive_s = self._times.drive_s(section, loaded=loaded)
        clear_s = drive_s * min(self._machine_m / max(section.length_m, self._machine_m), 1.0)
        work_s = self._load_s() if loads else self._dump_s() if dumps else 0.0
        self._at(now_ns + _ns(clear_s), "left", grant.machine)
        if dumps:
            self._at(now_ns + _ns(drive_s + work_s), "dumped", grant.machine)
        self._at(now_ns + _ns(drive_s + work_s), "ready", grant.machine)

    def _load_s(self) -> float:
        cv, mean = self._chance.load_cv, self._times.load_s
        sigma = math.sqrt(math.log1p(cv**2))
        return float(mean * self._random.lognormal(-0.5 * sigma**2, sigma))

    def _dump_s(self) -> float:
        cv, mean = self._chance.dump_cv, self._times.dump_s
        return float(max(self._random.logistic(mean, cv * mean * math.sqrt(3.0) / math.pi), 0.2 * mean))


def _ns(seconds: float) -> int:
    return round(seconds * SECOND_NS)

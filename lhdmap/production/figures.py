"""Figures of production from records of cycles: times by phase, tonnes, fill, attempts, stops, help, distances, time usage."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from lhdmap.haulage.records import HOLDS, Cycle, Interval, Phase
from lhdmap.production.usage import LEVELS, Span, Stack, Usage, time_usage

FILL_STEP = 0.1
_BINS = 13
LOADED = (Phase.HAUL,)


class Stops(NamedTuple):
    """How often a machine stood at a place for a cause, and how long."""

    phase: Phase
    place: str
    cause: str
    times: int
    seconds: float


@dataclass(frozen=True)
class Production:
    """All figures of one or several machines. What is not known is nan; `stack` is the sum over the machines."""

    cycles: tuple[Cycle, ...]
    stack: Stack
    stops: tuple[Stops, ...]

    @property
    def finished(self) -> tuple[Cycle, ...]:
        """The cycles whose bucket was dumped."""
        return tuple(one for one in self.cycles if one.finished)

    @property
    def tonnes(self) -> float:
        """Mass of all buckets that were dumped and weighed, t."""
        return float(np.nansum([one.mass_t for one in self.finished])) if self.finished else 0.0

    @property
    def tonnes_per_hour(self) -> float:
        """Tonnes by the hours that were scheduled; nan without any."""
        hours = self.stack.level_s("scheduled") / 3600.0
        return self.tonnes / hours if hours > 0.0 else math.nan

    @property
    def cycle_s(self) -> tuple[float, ...]:
        """How long each finished cycle took, s."""
        return tuple(one.seconds() for one in self.finished)

    @property
    def time_by_phase_s(self) -> dict[str, float]:
        """Time in each phase that occurs, s, over all cycles, finished or not."""
        seconds = {phase: sum(one.seconds(phase) for one in self.cycles) for phase in Phase}
        return {str(phase): total for phase, total in seconds.items() if total > 0.0}

    @property
    def fills(self) -> tuple[float, ...]:
        """Fill of each bucket that was weighed, share of the payload that is wanted."""
        return tuple(one.fill for one in self.finished if math.isfinite(one.fill))

    def fill_histogram(self) -> list[tuple[float, float, int]]:
        """Return from, to and count of fills; the last class holds all above."""
        edges = [round(FILL_STEP * k, 10) for k in range(_BINS)]
        index = np.clip(np.floor(np.array(self.fills) / FILL_STEP + 1e-9), 0, _BINS - 1).astype(int)
        counts = np.bincount(index, minlength=_BINS)
        return [(low, round(low + FILL_STEP, 10), int(count)) for low, count in zip(edges, counts, strict=True)]

    @property
    def assist_s_per_bucket(self) -> float:
        """Assistance by buckets, s; nan without one."""
        seconds = sum(one.seconds(Phase.ASSISTANCE) for one in self.cycles)
        return seconds / len(self.finished) if self.finished else math.nan

    @property
    def pace(self) -> float:
        """Buckets by those that the productive time would have been enough for, at the mean productive time of a cycle."""
        own = [sum(one.s for one in cycle.intervals if one.phase in _PRODUCTIVE) for cycle in self.finished]
        productive = self.stack.class_s(Usage.PRODUCTIVE)
        return len(own) * float(np.mean(own)) / productive if own and productive > 0.0 else math.nan

    @property
    def machines(self) -> tuple[str, ...]:
        """The machines, in the order of their first cycles."""
        return tuple(dict.fromkeys(one.machine for one in self.cycles))

    def by_machine(self) -> list[dict[str, Any]]:
        """Return for each machine buckets, tonnes, mean cycle, way, and the time that it waited for others; unknown is None."""
        rows = []
        for name in self.machines:
            own = [one for one in self.cycles if one.machine == name]
            done = [one for one in own if one.finished]
            cycle_s, way_m = _mean([one.seconds() for one in done]), sum(one.distance_m for one in own)
            waits = (Phase.TRAFFIC, Phase.QUEUE_LOAD, Phase.QUEUE_DUMP)
            rows.append(
                {
                    "machine": name,
                    "cycles": len(done),
                    "tonnes": float(np.nansum([one.mass_t for one in done])) if done else 0.0,
                    "cycle_mean_s": cycle_s if math.isfinite(cycle_s) else None,
                    "waits_s": sum(one.seconds(*waits) for one in own),
                    "distance_m": way_m if math.isfinite(way_m) else None,
                }
            )
        return rows

    def values(self) -> dict[str, Any]:
        """Return the figures as JSON values; what is not known is None."""
        finished = self.finished
        attempts = [one.attempts for one in finished if one.attempts > 0]
        slip = [one.slip for one in finished if math.isfinite(one.slip)]
        distance = sum(one.distance_m for one in self.cycles)
        loaded = sum(part.distance_m for one in self.cycles for part in one.intervals if part.phase in LOADED)
        figures = {
            "cycles": len(finished),
            "tonnes": self.tonnes,
            "tonnes_per_hour": self.tonnes_per_hour,
            "cycle_mean_s": _mean(self.cycle_s),
            "cycle_std_s": float(np.std(self.cycle_s)) if finished else math.nan,
            "fill_mean": _mean(self.fills),
            "fill_std": float(np.std(self.fills)) if self.fills else math.nan,
            "attempts_mean": _mean(attempts),
            "slip_mean": _mean(slip),
            "assist_s_per_bucket": self.assist_s_per_bucket,
            "distance_m": distance,
            "distance_loaded_m": loaded,
            "availability": self.stack.availability,
            "utilization": self.stack.utilization,
            "effectiveness": self.stack.effectiveness,
        }
        known = {
            key: None if isinstance(one, float) and not math.isfinite(one) else one for key, one in figures.items()
        }
        levels = {level: round(self.stack.level_s(level), 3) for level in LEVELS}
        classes = {str(usage): round(self.stack.class_s(usage), 3) for usage in Usage}
        stops = [one._asdict() for one in self.stops]
        return {
            **known, "time_by_phase_s": self.time_by_phase_s, "usage_s": classes, "levels_s": levels, "stops": stops,
            "machines": self.by_machine(),
        }  # fmt: skip


_PRODUCTIVE = frozenset({Phase.LOAD, Phase.HAUL, Phase.DUMP, Phase.RETURN})


def production_of(
    cycles: Sequence[Cycle],
    calendar: Span | None = None,
    scheduled: Sequence[Span] | None = None,
    down: Sequence[Span] = (),
) -> Production:
    """Return the figures of cycles; without a calendar, of each machine from its first record to its last."""
    names = list(dict.fromkeys(one.machine for one in cycles))
    stacks = [_stack([one for one in cycles if one.machine == name], calendar, scheduled, down) for name in names]
    total = {usage: sum(one.by_class_ns[usage] for one in stacks) for usage in Usage}
    stack = Stack(total, sum(one.unknown_ns for one in stacks))
    return Production(tuple(cycles), stack, tuple(stops_of(part for one in cycles for part in one.intervals)))


def _stack(
    cycles: Sequence[Cycle], calendar: Span | None, scheduled: Sequence[Span] | None, down: Sequence[Span]
) -> Stack:
    own = [part for one in cycles for part in one.intervals]
    whole = calendar or Span(min(one.from_ns for one in own), max(one.to_ns for one in own))
    return time_usage(own, whole, scheduled, down)


def stops_of(intervals: Iterable[Interval]) -> list[Stops]:
    """Return the stops by phase, place and cause, the longest first."""
    found: dict[tuple[Phase, str, str], list[float]] = {}
    for one in intervals:
        if one.phase in HOLDS:
            found.setdefault((one.phase, one.place, one.cause), []).append(one.s)
    rows = [Stops(*key, len(times), sum(times)) for key, times in found.items()]
    return sorted(rows, key=lambda one: (-one.seconds, one.phase, one.place, one.cause))


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else math.nan

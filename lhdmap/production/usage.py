"""Time usage after the GMG guideline (2020): calendar, scheduled, available, operating, working, productive time.

Each level is the one above without a class of its own: unscheduled, down, standby, delay, non-productive. Every nanosecond of
the calendar lands in exactly one class: they are counted in integers, and their sum is the calendar (a property test says so).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import StrEnum
from itertools import pairwise
from typing import NamedTuple, TypeVar

from lhdmap.haulage.records import Interval, Phase


class Usage(StrEnum):
    """Classes of time; all but the last one are what a level of the stack loses."""

    UNSCHEDULED = "unscheduled"
    DOWN = "down"
    STANDBY = "standby"
    DELAY = "delay"
    NON_PRODUCTIVE = "non-productive"
    PRODUCTIVE = "productive"


LEVELS = ("calendar", "scheduled", "available", "operating", "working", "productive")
"""Each is the one before without the class of `Usage` in that place; the last class is the last level."""

CLASS_OF: dict[Phase, Usage] = {
    Phase.IDLE: Usage.STANDBY,
    Phase.ROUTE: Usage.DELAY,
    Phase.TRAM: Usage.NON_PRODUCTIVE,
    Phase.QUEUE_LOAD: Usage.DELAY,
    Phase.LOAD: Usage.PRODUCTIVE,
    Phase.HAUL: Usage.PRODUCTIVE,
    Phase.QUEUE_DUMP: Usage.DELAY,
    Phase.DUMP: Usage.PRODUCTIVE,
    Phase.RETURN: Usage.PRODUCTIVE,
    Phase.PARK: Usage.NON_PRODUCTIVE,
    Phase.REFUEL: Usage.DELAY,
    Phase.ASSISTANCE: Usage.DELAY,
    Phase.TRAFFIC: Usage.DELAY,
    Phase.OBSTACLE: Usage.DELAY,
    Phase.STOPPED: Usage.DELAY,
    Phase.PLACE: Usage.DELAY,
    Phase.NO_ROUTE: Usage.DELAY,
    Phase.ABORTED: Usage.STANDBY,
}
"""What each phase counts as. Trams to the first draw point and to the park are work that moves no ore."""


class Span(NamedTuple):
    """A stretch of time, and why."""

    from_ns: int
    to_ns: int
    cause: str = ""


_S = TypeVar("_S", Span, Interval)


class Stack(NamedTuple):
    """Time by class, nanoseconds; `unknown_ns`: the part of standby that nobody recorded."""

    by_class_ns: dict[Usage, int]
    unknown_ns: int = 0

    @property
    def calendar_ns(self) -> int:
        """All of it."""
        return sum(self.by_class_ns.values())

    def level_s(self, level: str) -> float:
        """Return the time of a level of the stack, seconds."""
        lost = list(Usage)[: LEVELS.index(level)]
        return 1e-9 * (self.calendar_ns - sum(self.by_class_ns[one] for one in lost))

    def class_s(self, usage: Usage) -> float:
        """Return the time of a class, seconds."""
        return 1e-9 * self.by_class_ns[usage]

    @property
    def availability(self) -> float:
        """Available time by scheduled time; nan without any."""
        return _share(self.level_s("available"), self.level_s("scheduled"))

    @property
    def utilization(self) -> float:
        """Operating time by available time (use of availability); nan without any."""
        return _share(self.level_s("operating"), self.level_s("available"))

    @property
    def effectiveness(self) -> float:
        """Productive time by operating time; nan without any."""
        return _share(self.level_s("productive"), self.level_s("operating"))


def time_usage(
    intervals: Iterable[Interval],
    calendar: Span,
    scheduled: Sequence[Span] | None = None,
    down: Sequence[Span] = (),
) -> Stack:
    """Return the time usage of one machine over a calendar.

    `scheduled`: when it was to work, None: all the time; `down`: when it could not. Where several things are said of a moment,
    what is not scheduled counts first, then down, then the phase that began first; what nobody recorded is standby.
    """
    shifts = [calendar] if scheduled is None else list(scheduled)
    own = sorted(intervals, key=lambda one: (one.from_ns, one.to_ns))
    total = dict.fromkeys(Usage, 0)
    unknown = 0
    for from_ns, to_ns in _pieces(calendar, [*shifts, *down, *own]):
        phase = _at(own, from_ns)
        if _at(shifts, from_ns) is None:
            usage = Usage.UNSCHEDULED
        elif _at(down, from_ns) is not None:
            usage = Usage.DOWN
        elif phase is None:
            usage, unknown = Usage.STANDBY, unknown + to_ns - from_ns
        else:
            usage = CLASS_OF[phase.phase]
        total[usage] += to_ns - from_ns
    return Stack(total, unknown)


def _pieces(calendar: Span, spans: Iterable[Span | Interval]) -> list[tuple[int, int]]:
    """Return the pieces of a calendar between all begins and ends."""
    cuts = {calendar.from_ns, calendar.to_ns}
    cuts |= {t for one in spans for t in (one.from_ns, one.to_ns) if calendar.from_ns < t < calendar.to_ns}
    ordered = sorted(cuts) if calendar.to_ns > calendar.from_ns else []
    return list(pairwise(ordered))


def _at(spans: Sequence[_S], at_ns: int) -> _S | None:
    return next((one for one in spans if one.from_ns <= at_ns < one.to_ns), None)


def _share(part: float, whole: float) -> float:
    return part / whole if whole > 0.0 else float("nan")

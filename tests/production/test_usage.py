"""Time usage: every nanosecond in exactly one class, whatever is told."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.haulage.records import Interval, Phase
from lhdmap.production.usage import CLASS_OF, LEVELS, Span, Usage, time_usage

from tests.production.records import SECOND_NS, START_NS, intervals

TIMES = st.integers(-50, 150)
SPANS = st.lists(st.tuples(TIMES, TIMES).map(lambda pair: Span(*pair)), max_size=5)
INTERVALS = st.lists(
    st.tuples(st.sampled_from(list(Phase)), TIMES, TIMES).map(lambda three: Interval(*three)), max_size=8
)


@given(INTERVALS, st.none() | SPANS, SPANS)
def test_every_nanosecond_lands_in_exactly_one_class(
    own: list[Interval], scheduled: list[Span] | None, down: list[Span]
) -> None:
    """Against each nanosecond asked by itself; spans may overlap, be empty, or end before they begin."""
    calendar = Span(0, 100)
    stack = time_usage(own, calendar, scheduled, down)
    assert stack.calendar_ns == 100
    counted = dict.fromkeys(Usage, 0)
    for ns in range(100):
        counted[class_at(ns, own, scheduled, down)] += 1
    assert stack.by_class_ns == counted


def class_at(ns: int, own: list[Interval], scheduled: list[Span] | None, down: list[Span]) -> Usage:
    if scheduled is not None and not any(one.from_ns <= ns < one.to_ns for one in scheduled):
        return Usage.UNSCHEDULED
    if any(one.from_ns <= ns < one.to_ns for one in down):
        return Usage.DOWN
    said = sorted((one for one in own if one.from_ns <= ns < one.to_ns), key=lambda one: (one.from_ns, one.to_ns))
    return CLASS_OF[said[0].phase] if said else Usage.STANDBY


def test_each_phase_has_a_class() -> None:
    assert set(CLASS_OF) == set(Phase)


@given(INTERVALS, SPANS)
def test_levels_only_lose(own: list[Interval], down: list[Span]) -> None:
    stack = time_usage(own, Span(0, 100), None, down)
    levels = [stack.level_s(level) for level in LEVELS]
    assert levels[0] == pytest.approx(100e-9)
    assert all(a >= b for a, b in pairwise(levels))
    assert levels[-1] == pytest.approx(stack.class_s(Usage.PRODUCTIVE))


def test_a_shift_by_hand() -> None:
    """8 h of 24 h scheduled, 1 h down, then 1 h of work with 6 min of delay and 3 min of parking; the rest nobody recorded."""
    hour = 3600.0
    own = intervals(
        (Phase.HAUL, 0.85 * hour, "", "", 0.0), (Phase.TRAFFIC, 0.1 * hour, "", "", 0.0), (Phase.PARK, 0.05 * hour, "", "", 0.0),
        begin_s=hour,
    )  # fmt: skip
    calendar = Span(START_NS, START_NS + 24 * 3600 * SECOND_NS)
    shift = Span(START_NS, START_NS + 8 * 3600 * SECOND_NS)
    broken = Span(START_NS, START_NS + 3600 * SECOND_NS, "hydraulics")
    stack = time_usage(own, calendar, [shift], [broken])
    hours = {level: stack.level_s(level) / hour for level in LEVELS}
    assert hours == pytest.approx(
        {"calendar": 24.0, "scheduled": 8.0, "available": 7.0, "operating": 1.0, "working": 0.9, "productive": 0.85}
    )
    assert stack.unknown_ns == 6 * 3600 * SECOND_NS
    assert stack.availability == pytest.approx(7.0 / 8.0)
    assert stack.utilization == pytest.approx(1.0 / 7.0)
    assert stack.effectiveness == pytest.approx(0.85)


def test_no_time_has_no_shares() -> None:
    stack = time_usage([], Span(5, 5))
    assert stack.calendar_ns == 0
    assert math.isnan(stack.availability)

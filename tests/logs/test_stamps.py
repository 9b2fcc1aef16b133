"""The one place that decides stamps: header stamp, else log time, else the recorded stamp as it is."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from lhdmap.logs.stamps import StampKeeper

LATE = 1_712_345_678_123_456_789


def _decided(pairs: list[tuple[int, int]]) -> tuple[list[int], StampKeeper]:
    keeper = StampKeeper()
    return [keeper.decide("/scan", header, log) for header, log in pairs], keeper


def test_header_stamps_are_used_to_the_last_digit() -> None:
    got, keeper = _decided([(LATE, LATE + 5), (LATE + 1, LATE + 7)])
    assert got == [LATE, LATE + 1]
    assert keeper.warnings() == []
    assert (keeper.topics["/scan"].offset_min_ns, keeper.topics["/scan"].offset_max_ns) == (5, 6)


def test_zero_stamps_become_the_log_time_with_one_warning() -> None:
    got, keeper = _decided([(0, 10), (0, 20), (30, 31)])
    assert got == [10, 20, 30]
    assert keeper.warnings() == ["/scan: 2 of 3 messages have no stamp; their log time is used instead"]


def test_backward_stamps_become_the_log_time_with_one_warning() -> None:
    second = 10**9
    got, keeper = _decided([(10 * second, 11 * second), (9 * second, 12 * second), (13 * second, 14 * second)])
    assert got == [10 * second, 12 * second, 13 * second]
    (line,) = keeper.warnings()
    assert line == "/scan: 1 stamps run backwards (by up to 1.000 s); the log time is used for them instead"


def test_where_the_log_time_runs_backwards_too_the_stamp_is_kept() -> None:
    got, keeper = _decided([(10, 10), (7, 7), (8, 8), (9, 9), (12, 12)])
    assert got == [10, 7, 8, 9, 12]
    (line,) = keeper.warnings()
    assert "1 stamps run backwards" in line
    assert "kept, in file order" in line


SECOND = 10**9


def test_a_stamp_that_leaps_ahead_becomes_the_log_time_and_the_next_are_as_ever() -> None:
    pairs = [(k * SECOND, k * SECOND + 5) for k in range(1, 7)]
    pairs[2] = (3603 * SECOND, pairs[2][1])
    got, keeper = _decided(pairs)
    assert got == [k * SECOND for k in range(1, 7)]
    assert keeper.warnings() == ["/scan: 1 stamps leap ahead; the log time is used for them instead"]
    assert (keeper.topics["/scan"].offset_min_ns, keeper.topics["/scan"].offset_max_ns) == (5, 5)


def test_a_clock_that_was_set_is_believed_once_it_is_confirmed() -> None:
    pairs = [(k * SECOND + (3600 * SECOND if k > 2 else 0), k * SECOND) for k in range(1, 9)]
    got, _ = _decided(pairs)
    assert got == [k * SECOND for k in range(1, 6)] + [(k + 3600) * SECOND for k in range(6, 9)]


def test_a_pause_of_the_recording_is_no_leap() -> None:
    got, keeper = _decided([(SECOND, SECOND), (7200 * SECOND, 7200 * SECOND)])
    assert got == [SECOND, 7200 * SECOND]
    assert keeper.warnings() == []


def test_a_log_recorded_anew_keeps_the_clock_of_its_stamps() -> None:
    """One stamp a millisecond back, and the rest of the topic went to the day of the copy."""
    day = 86_400 * SECOND
    pairs = [(k * SECOND, k * SECOND + day) for k in range(1, 7)]
    pairs[2] = (2 * SECOND - 1_000_000, pairs[2][1])
    got, keeper = _decided(pairs)
    assert got == [k * SECOND for k in range(1, 7)]
    assert "1 stamps run backwards" in keeper.warnings()[0]


def test_equal_stamps_are_kept_and_counted() -> None:
    got, keeper = _decided([(10, 10), (10, 11), (12, 12)])
    assert got == [10, 10, 12]
    assert keeper.topics["/scan"].duplicate == 1


def test_types_without_a_header_take_the_log_time_without_a_warning() -> None:
    keeper = StampKeeper()
    assert keeper.decide("/operation/mode", 0, 42, has_header=False) == 42
    assert keeper.warnings() == []


def test_topics_are_judged_apart() -> None:
    keeper = StampKeeper()
    assert keeper.decide("/a", 100, 100) == 100
    assert keeper.decide("/b", 50, 101) == 50
    assert keeper.warnings() == []


@given(st.lists(st.tuples(st.integers(0, 1000), st.integers(0, 50)), min_size=1))
def test_with_rising_log_times_after_the_headers_stamps_never_fall(pairs: list[tuple[int, int]]) -> None:
    log_ns, listed = 1000, []
    for header, step in pairs:
        log_ns += step
        listed.append((header, log_ns))
    got, _ = _decided(listed)
    assert got == sorted(got)

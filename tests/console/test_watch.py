"""Silence and latency by the machine's clock alone; time is an input."""

from __future__ import annotations

import pytest
from lhdmap.console.settings import ConsoleSettings
from lhdmap.console.watch import Watch
from lhdmap.errors import ConfigError

MS = 1_000_000


def alive(watch: Watch, until_ms: int, trip_ms: int = 5, by: str = "anna") -> None:
    """Have each tick of 100 ms answered after a round trip, the last one at `until_ms`."""
    for at_ms in range(0, until_ms + 1, 100):
        assert watch.answered(watch.tick(at_ms * MS), by, (at_ms + trip_ms) * MS)


def test_without_an_operator_nothing_is_driven() -> None:
    watch = Watch(ConsoleSettings())
    assert watch.fault(0) == "no operator"
    watch.tick(0)
    assert watch.fault(100 * MS) == "no operator"


def test_a_silent_page_is_a_fault_before_half_a_second_is_over() -> None:
    watch = Watch(ConsoleSettings())
    alive(watch, 1000)
    assert watch.fault(1459 * MS) == ""
    assert "silent" in watch.fault(1460 * MS)  # two turns of 20 ms are left for the brake
    assert "silent" in watch.fault(60_000 * MS)


def test_silence_is_counted_from_the_sending_of_a_tick_not_from_its_answer() -> None:
    watch = Watch(ConsoleSettings(latency_limit_s=5.0))
    alive(watch, 1000, trip_ms=400)
    assert watch.fault(1459 * MS) == ""
    assert "silent" in watch.fault(1460 * MS)


def test_an_answer_that_waited_on_the_way_does_not_make_the_page_look_alive() -> None:
    watch = Watch(ConsoleSettings())
    alive(watch, 1000)
    late = watch.tick(1100 * MS)
    watch.answered(late, "anna", 3000 * MS)
    assert "silent" in watch.fault(3000 * MS)


@pytest.mark.parametrize("number", [0, -1, 7, 10**12])
def test_an_answer_to_no_tick_counts_as_none(number: int) -> None:
    watch = Watch(ConsoleSettings())
    watch.tick(0)
    assert not watch.answered(number, "anna", MS)
    assert watch.fault(MS) == "no operator"


def test_a_tick_is_answered_once() -> None:
    watch = Watch(ConsoleSettings())
    number = watch.tick(0)
    assert watch.answered(number, "anna", MS)
    assert not watch.answered(number, "anna", 400 * MS)


def test_five_slow_round_trips_in_a_row_are_a_fault_four_are_none() -> None:
    watch = Watch(ConsoleSettings(latency_limit_s=0.2))
    for k in range(6):
        assert watch.fault(k * 100 * MS) == (
            "no operator" if k == 0 else "" if k < 5 else "round trip to the operator's page 0.25 s"
        )
        watch.answered(watch.tick((k * 100 - 250) * MS), "anna", k * 100 * MS)
    alive(watch, 1000)
    assert watch.fault(1010 * MS) == ""
    assert watch.round_trip_s == pytest.approx(0.005)


def test_a_limit_of_less_than_three_ticks_is_refused() -> None:
    with pytest.raises(ConfigError, match="three ticks"):
        ConsoleSettings(heartbeat_limit_s=0.25)

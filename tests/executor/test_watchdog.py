"""The watchdog: ages, jumps, the link; and that it stays disarmed."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.executor.notes import Stop
from lhdmap.executor.settings import ExecutorSettings
from lhdmap.executor.watchdog import Watchdog

MS = 1_000_000
PERIODS = {"motion": 0.01, "scan_front": 0.04, "slow": 0.2, "pose": 0.04, "link": 0.1}
NEEDS = tuple(PERIODS)
SMALL = (0.01, 0.001)


def fed(until_ms: int, *, without: str = "", since_ms: int = 0, dog: Watchdog | None = None) -> Watchdog:
    """A watchdog that all inputs have been given to, in 10 ms; it is armed when it can be."""
    dog = dog or Watchdog(PERIODS, ExecutorSettings())
    for now in range(since_ms, until_ms + 1, 10):
        give(dog, now, without)
        dog.check(now * MS, NEEDS, standing=True)
        if not without and not dog.armed:
            dog.rearm(now * MS, NEEDS)
    return dog


def give(dog: Watchdog, now: int, without: str = "") -> None:
    for name, period_s in PERIODS.items():
        if name != without and now % round(1e3 * period_s) == 0:
            if name == "pose":
                dog.disagreement(now * MS, now * MS, *SMALL)
            else:
                dog.saw(name, now * MS, now * MS)


@pytest.mark.parametrize(
    ("name", "last", "limit_ms"),
    [("motion", 1000, 300), ("scan_front", 1000, 300), ("pose", 1000, 300), ("slow", 1000, 600), ("link", 1000, 2000)],
)
def test_it_stops_when_an_input_is_older_than_its_limit(name: str, last: int, limit_ms: int) -> None:
    dog = fed(1000)
    for now in range(1010, 1000 + limit_ms + 1, 10):
        give(dog, now, name)
        assert dog.check(now * MS, NEEDS, standing=False)[0] < Stop.SERVICE, now
    late = last + limit_ms + 10
    give(dog, late, name)
    stop, cause = dog.check(late * MS, NEEDS, standing=False)
    assert stop is Stop.FULL
    assert name in cause


def test_what_a_mode_does_not_need_may_be_missing() -> None:
    dog = fed(1000)
    for now in range(1010, 3000, 10):
        give(dog, now, "pose")
        assert dog.check(now * MS, ("motion", "scan_front"), standing=True)[0] is Stop.GO


@pytest.mark.parametrize(
    ("stamp_ms", "values", "content"),
    [
        (990, (), None),
        (1000, (), None),
        (1010, (math.nan,), None),
        (1010, (math.inf,), None),
        (1400, (), None),
        (1010, (), 7),
    ],
    ids=["older", "the same stamp", "nan", "inf", "from the future", "frozen"],
)
def test_what_is_no_news_counts_as_no_input(stamp_ms: int, values: tuple[float, ...], content: int | None) -> None:
    dog = Watchdog(PERIODS, ExecutorSettings())
    assert dog.saw("motion", 1000 * MS, 1000 * MS, content=7)
    assert not dog.saw("motion", stamp_ms * MS, 1010 * MS, values, content)
    assert dog.saw("motion", 1020 * MS, 1020 * MS, content=8)


@pytest.mark.parametrize(
    ("apart", "stops"),
    [
        ((0.19, 0.0), False),
        ((0.21, 0.0), True),
        ((0.0, 0.017), False),
        ((0.0, -0.018), True),
        ((math.inf, math.inf), True),
    ],
)
def test_a_pose_that_jumps_against_the_scan_stops(apart: tuple[float, float], stops: bool) -> None:
    dog = fed(1000)
    assert dog.disagreement(1010 * MS, 1010 * MS, *apart)
    stop, _ = dog.check(1010 * MS, NEEDS, standing=False)
    assert (stop is Stop.FULL) == stops


def test_a_degraded_link_holds_and_a_lost_one_stops() -> None:
    dog = fed(1000)
    found = {}
    for now in range(1010, 3100, 10):
        give(dog, now, "link")
        found[now] = dog.check(now * MS, NEEDS, standing=False)[0]
    assert found[1290] is Stop.GO
    assert found[1310] is Stop.HOLD
    assert found[2990] is Stop.HOLD
    assert found[3010] is Stop.FULL
    notes = [(note.event, note.after) for note in dog.notes.take()]
    assert ("link", "degraded") in notes
    assert ("armed", "disarmed") in notes


def test_a_link_that_comes_back_in_time_lets_go() -> None:
    dog = fed(1000)
    for now in range(1010, 1500, 10):
        give(dog, now, "link")
        dog.check(now * MS, NEEDS, standing=False)
    give(dog, 1500)
    assert dog.check(1500 * MS, NEEDS, standing=False)[0] is Stop.GO


def test_it_begins_disarmed_and_says_what_is_missing() -> None:
    dog = Watchdog(PERIODS, ExecutorSettings())
    assert dog.check(0, NEEDS, standing=True)[0] is Stop.FULL
    reasons = dog.rearm(0, NEEDS)
    assert any("motion never seen" in one for one in reasons)
    assert not dog.armed


def test_it_is_armed_again_only_where_all_is_well() -> None:
    dog = fed(1000)
    for now in range(1010, 1500, 10):
        give(dog, now, "scan_front")
        dog.check(now * MS, NEEDS, standing=False)
    assert not dog.armed
    assert any("moves" in one for one in dog.rearm(1490 * MS, NEEDS))
    dog.check(1490 * MS, NEEDS, standing=True)
    assert dog.rearm(1490 * MS, NEEDS) == ("scan_front 0.49 s old",)
    dog.saw("scan_front", 1490 * MS, 1490 * MS)
    assert dog.check(1490 * MS, NEEDS, standing=True)[0] is Stop.FULL  # the input is back: that arms nothing
    assert dog.rearm(1490 * MS, NEEDS) == ()
    assert dog.check(1500 * MS, NEEDS, standing=True)[0] is Stop.GO


def test_the_pose_is_validated_anew_after_a_trip() -> None:
    dog = fed(1000)
    dog.trip(("test",))
    for stamp, missing in ((1010, 3), (1050, 2), (1090, 1)):
        for name in ("motion", "scan_front"):
            dog.saw(name, stamp * MS, stamp * MS)
        assert dog.rearm(stamp * MS, NEEDS) == (f"the pose is not validated: {missing} more reports",)
        dog.disagreement(stamp * MS, stamp * MS, *SMALL)
    assert dog.rearm(1090 * MS, NEEDS) == ()


def test_a_jump_between_begins_validation_anew() -> None:
    dog = fed(1000)
    dog.trip(("test",))
    for stamp, apart in ((1010, 0.0), (1050, 0.0), (1090, 0.5), (1130, 0.0), (1170, 0.0)):
        dog.disagreement(stamp * MS, stamp * MS, apart, 0.0)
    assert any("1 more" in one for one in dog.refusals(1170 * MS, ("pose",)))


@given(st.lists(st.tuples(st.integers(-200, 200), st.booleans()), max_size=60))
def test_no_order_of_stamps_makes_old_news_young(stamps: list[tuple[int, bool]]) -> None:
    """The age is that of the newest good stamp, whatever else comes."""
    dog, now, newest = Watchdog({"motion": 0.01}, ExecutorSettings()), 1000, None
    dog.saw("motion", now * MS, now * MS)
    newest = now
    for offset, good in stamps:
        now += 10
        stamp = now + offset
        counted = dog.saw("motion", stamp * MS, now * MS, () if good else (math.nan,))
        if good and newest < stamp <= now + 50:
            assert counted
            newest = stamp
        else:
            assert not counted
    assert dog._inputs["motion"].older(now * MS, 0.3) == (now - newest > 300)

"""What the verdict counts, against drives that are known in closed form."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from lhdmap.replay.parts import Nearness, Touch
from lhdmap.replay.scenario import Limits
from lhdmap.replay.verdict import KEYS, Tally
from lhdmap.simulation.history import START_NS

from tests.replay.doubles import Straight, Unicycle, parts
from tests.replay.runs import go, scenario

S = 1_000_000_000


def drive(tally: Tally, seconds: float, speed_mps: float, start: Unicycle | None = None) -> Unicycle:
    """Send states of a steady drive, and return the last."""
    state = start or Unicycle()
    for _ in range(round(100 * seconds)):
        at_ns, x = state.time_ns + S // 100, state.x_m + 0.01 * speed_mps
        state = state._replace(time_ns=at_ns, x_m=x, speed_mps=speed_mps)
        tally.at(state)
    return state


def told(tally: Tally, now_ns: int) -> dict[str, Any]:
    tally.judge(now_ns)
    return tally.verdict(now_ns, [], 1.0, "")


def test_the_verdict_has_the_keys_of_the_contract() -> None:
    assert tuple(told(Tally("tram", Limits()), START_NS)) == KEYS


def test_distance_speeds_and_stops_of_a_known_drive() -> None:
    tally = Tally("tram", Limits())
    state = Unicycle()
    tally.at(state)
    for speed, seconds in ((0.0, 3.0), (2.0, 10.0), (0.0, 2.0), (-4.0, 5.0), (0.0, 0.2), (1.0, 1.0), (0.0, 1.0)):
        state = drive(tally, seconds, speed, state)
    found = told(tally, state.time_ns)
    assert found["distance_m"] == pytest.approx(20.0 + 20.0 + 1.0)
    assert found["duration_s"] == pytest.approx(22.2)
    assert found["max_speed_kmh"] == pytest.approx(14.4)
    assert found["mean_speed_kmh"] == pytest.approx(3.6 * 41.0 / 22.2)
    assert found["stops"] == 1  # the rest of 2 s; neither those of start and end, nor a moment


def test_no_progress_ends_the_run_with_where_it_was() -> None:
    tally = Tally("tram", Limits(no_progress_s=5.0))
    state = drive(tally, 2.0, 1.0)
    tally.judge(state.time_ns)
    assert not tally.ended
    state = drive(tally, 11.0, 0.01, state)
    tally.judge(state.time_ns)
    assert (tally.ended, tally.ok) == (True, False)
    assert tally.reason.startswith("no progress: 5 s within 0.5 m of (2.")


def test_the_time_limit_ends_the_run() -> None:
    run, _ = go(scenario(limits={"time_s": 3.0}), parts(Straight(1000.0), scans=False))
    tally = run.monitor.tally
    assert (tally.ok, tally.reason) == (False, "time limit: not done after 3 s")
    assert run.engine.now_ns - START_NS < 3.3 * S


def test_a_touch_that_lasts_is_one_contact_and_its_depth_the_greatest() -> None:
    tally = Tally("tram", Limits(contacts=5))
    for k, depth_m in enumerate((0.01, 0.03, 0.02)):
        tally.near(START_NS + k * S, Nearness((Touch("cabin", (1.0, 2.0, 3.0), depth_m),)))
    tally.near(START_NS + 4 * S, Nearness((), 0.2))
    tally.near(START_NS + 5 * S, Nearness((Touch("cabin", (1.0, 2.0, 3.0), 0.01),)))
    found = told(tally, START_NS + 6 * S)
    assert [(one["t_s"], one["depth_m"]) for one in found["contacts"]] == [(0.0, 0.03), (5.0, 0.01)]
    assert found["min_clearance_m"] == 0.0
    assert not tally.ended


def test_assistance_is_counted_and_timed() -> None:
    tally = Tally("tram", Limits())
    for at_s, text in ((1, "driving"), (2, "assistance: too narrow"), (5, "driving"), (6, "assistance: lost")):
        tally.said(START_NS + at_s * S, text)
    found = told(tally, START_NS + 10 * S)
    assert (found["assists"], found["assist_s"]) == (2, 7.0)


def test_a_mission_that_is_aborted_is_not_ok() -> None:
    tally = Tally("tram", Limits())
    tally.said(START_NS, "aborted: no way")
    assert told(tally, START_NS)["reason"] == "aborted: no way"


def test_a_drive_arrives_and_one_beside_the_goal_does_not() -> None:
    whole = parts(Straight(20.0), scans=False)
    run, events = go(scenario(), whole)
    assert (run.monitor.tally.ok, run.monitor.tally.reason) == (True, "arrived")
    assert run.monitor.tally.drive.distance_m == pytest.approx(20.0, abs=0.3)
    states = [(one.process, one.after) for one in events if one.event == "state"]
    assert ("operator", "forward") in states
    assert states[-1] == ("monitor", "ended")
    run, _ = go(scenario(), replace(whole, operator=Straight(20.0), goal_m=(25.0, 0.0, 0.0)))
    assert (run.monitor.tally.ok, run.monitor.tally.arrived) == (False, False)
    assert "beside the goal: 1 m was wanted" in run.monitor.tally.reason


def test_a_contact_ends_the_run() -> None:
    run, events = go(scenario(), parts(Straight(70.0, steering_rps=0.03), scans=False))
    tally = run.monitor.tally
    assert not tally.ok
    assert tally.reason.startswith("contact: front_frame at")
    assert [one.cause for one in events if one.event == "contact"] == ["front_frame"]
    assert tally.touched.contacts[0]["speed_kmh"] == pytest.approx(7.2, abs=0.1)

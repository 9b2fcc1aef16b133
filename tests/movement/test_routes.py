"""Routes over a map that is known by heart: T1 straight, T2 a detour, T3 a dead end with DP1 (tests/topology/maps.py)."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.errors import UsageError
from lhdmap.movement.route import Route
from lhdmap.movement.routes import RouteOptions, RoutePlanner, route
from lhdmap.movement.rules import NAMES, STATES, reversed_kind, successors
from lhdmap.movement.settings import MovementSettings
from lhdmap.topology.model import TopologicalMap, Waypoint

from tests.movement.mines import with_connection
from tests.topology.maps import ladder, pose

SHARP = with_connection(ladder(), "i1.t1", "i1.t2", feasible=False, reason="too sharp")
CORNER_M = math.hypot(6.0, 6.0)


def with_bay(topology: TopologicalMap) -> TopologicalMap:
    """A turning bay at the draw point's place."""
    bays = tuple(replace(one, purpose="turning_bay") for one in topology.waypoints)
    return replace(topology, waypoints=bays)


def test_the_way_to_the_draw_point() -> None:
    found = route(ladder(), "t1.end", "DP1", RouteOptions(heading="against"))
    assert found.feasible
    assert found.nodes == ("t1", "i1", "t3")
    assert [(step.point, step.state) for step in found.states] == [
        ("t1.end", "vi"),
        ("t1.start", "iii"),
        ("i1.t1", "i"),
        ("i1.t3", "iii"),
        ("t3.start", "i"),
        ("w1", "v"),
    ]
    assert found.distance_m == pytest.approx(48.0 + CORNER_M + 20.0)
    assert found.inversions == 0
    assert (found.start_heading, found.goal_heading) == ("against", "along")
    assert [step.gear for step in found.states] == ["forward"] * 6
    assert [step.stop for step in found.states] == [True, False, False, False, False, True]
    speed, settings_ = 12.0 / 3.6, MovementSettings()
    lost = speed / (2.0 * settings_.acceleration_mps2) + speed / (2.0 * settings_.deceleration_mps2)
    assert found.time_s == pytest.approx(found.distance_m / speed + lost)


def test_where_two_arms_are_too_sharp_the_machine_inverts_in_the_third() -> None:
    found = route(SHARP, "t1.start", "t2.start", RouteOptions(heading="along", avoid=("T1:I2",)))
    assert found.feasible
    assert found.inversions == 1
    turned = next(step for step in found.states if step.inversion)
    assert turned.point in ("i1.t3", "t3.start")
    assert found.distance_m == pytest.approx(CORNER_M + 12.0)
    assert {"i1.t1", "i1.t2"} <= {step.point for step in found.states}
    assert found.states[0].gear == "forward"
    assert found.states[-1].gear == "reverse"
    assert found.nodes == ("t1", "i1", "t2")


def test_an_inversion_costs_its_time() -> None:
    options = RouteOptions(heading="along", avoid=("T1:I2",))
    quick, slow = (
        route(SHARP, "t1.start", "t2.start", options, MovementSettings(inversion_s=spent)) for spent in (1.0, 11.0)
    )
    assert slow.time_s - quick.time_s == pytest.approx(10.0)


def test_a_long_way_round_is_taken_when_inversions_are_dear() -> None:
    cheap = route(SHARP, "t1.start", "t2.start", RouteOptions(heading="along"), MovementSettings(inversion_s=1.0))
    dear = route(SHARP, "t1.start", "t2.start", RouteOptions(heading="along"), MovementSettings(inversion_s=500.0))
    assert cheap.inversions == 1
    assert dear.inversions == 0
    assert dear.nodes == ("t1", "i2", "t2")


@pytest.mark.parametrize(("heading", "goal"), [("along", "against"), ("against", "along")])
def test_nobody_turns_on_the_spot_but_in_a_bay(heading: str, goal: str) -> None:
    options = RouteOptions(heading=heading, goal_heading=goal)
    plain, bay = route(ladder(), "w1", "w1", options), route(with_bay(ladder()), "w1", "w1", options)
    assert plain.turns == 0
    assert plain.inversions >= 1
    assert plain.distance_m > 40.0
    assert bay.turns == 1 or bay.time_s < 60.0
    dear = route(with_bay(ladder()), "w1", "w1", options, MovementSettings(turn_s=2.0))
    assert (dear.turns, dear.distance_m, dear.time_s) == (1, 0.0, 2.0)
    assert [step.state for step in dear.states] == (["v", "vi"] if heading == "along" else ["vi", "v"])


def test_start_and_goal_the_same() -> None:
    found = route(ladder(), "DP1", "w1")
    assert (found.feasible, found.distance_m, found.time_s, found.inversions) == (True, 0.0, 0.0, 0)
    assert len(found.states) == 1
    assert route(ladder(), "t1.end", "T1").distance_m == 0.0
    assert route(ladder(), "i1.t1", "t1.start").time_s == 0.0


def test_both_headings_are_tried_and_the_better_is_told() -> None:
    slow = MovementSettings(limit_reverse_kmh=3.0)
    found = route(ladder(), "t1.end", "DP1", settings=slow)
    assert found.start_heading == "against"
    along = route(ladder(), "t1.end", "DP1", RouteOptions(heading="along"), slow)
    assert along.time_s > found.time_s
    assert found.other_heading == f"along: +{along.time_s - found.time_s:.1f} s, {along.inversions} inversions"


def test_degrees_are_taken_for_the_nearer_heading() -> None:
    assert route(ladder(), "DP1", "T2", RouteOptions(heading="-80")).start_heading == "along"
    assert route(ladder(), "DP1", "T2", RouteOptions(heading="100")).start_heading == "against"
    assert route(ladder(), "DP1", "T2", RouteOptions(goal_heading="0")).goal_heading == "against"


def test_a_loaded_machine_is_slower_and_reverse_has_its_limit() -> None:
    topology = ladder()
    fast = replace(
        topology,
        connections=tuple(replace(one, speed_limit_kmh=30.0) for one in topology.connections),
        tunnels=tuple(replace(one, speed_limit_kmh=30.0) for one in topology.tunnels),
    )
    ends = ("t2.start", "t2.end")
    empty, loaded, reverse = (
        route(fast, *ends, RouteOptions(heading, avoid=("T1",)), loaded=load)
        for heading, load in (("against", False), ("against", True), ("along", False))
    )
    assert empty.time_s < loaded.time_s < reverse.time_s
    assert reverse.states[0].gear == "reverse"


def test_what_stands_in_the_way_is_told() -> None:
    shut = with_connection(SHARP, "i2.t1", "i2.t2", closed=True, reason="road works")
    shut = with_connection(shut, "i1.t1", "i1.t3", feasible=False)
    found = route(shut, "T1", "T2")
    assert not found.feasible
    assert [(one.start, one.end, one.why) for one in found.blocked_by] == [("i2.t1", "i2.t2", "closed")]
    assert "i2.t1:i2.t2 is closed (road works)" in found.reason


def test_what_is_avoided_is_told_apart() -> None:
    for name in ("T2", "i1.t2:t2.start", "I1:T2", "t2.start"):
        found = route(ladder(), "DP1", "t2.start", RouteOptions(avoid=(name, "I2")))
        assert not found.feasible
        assert {one.why for one in found.blocked_by} == {"avoided"}
    around = route(ladder(), "DP1", "t2.start", RouteOptions(avoid=("i1.t3:i1.t2",)))
    assert around.nodes == ("t3", "i1", "t1", "i2", "t2") or around.inversions == 1


def test_a_closed_tunnel_is_not_driven() -> None:
    topology = ladder()
    shut = replace(topology, tunnels=tuple(replace(one, closed=one.id == "t1") for one in topology.tunnels))
    found = route(shut, "DP1", "i2.t2")
    assert found.nodes == ("t3", "i1", "t2", "i2")
    assert found.distance_m == pytest.approx(20.0 + 12.0 + 108.0)
    assert {one.why for one in found.alternatives[0].blocked_by} == {"closed"}


def test_nobody_inverts_with_half_the_machine_in_a_closed_tunnel() -> None:
    shut = replace(SHARP, tunnels=tuple(replace(one, closed=one.id == "t3") for one in SHARP.tunnels))
    options = RouteOptions(heading="along", avoid=("T1:I2",))
    assert route(SHARP, "t1.start", "t2.start", options).inversions == 1
    assert not route(shut, "t1.start", "t2.start", options).feasible
    assert not route(SHARP, "t1.start", "t2.start", replace(options, avoid=("T1:I2", "T3"))).feasible


def test_a_waypoint_is_passed_at_its_limit() -> None:
    topology = two_places(False)
    slow = replace(topology, waypoints=(topology.waypoints[0], replace(topology.waypoints[1], speed_limit_kmh=3.6)))
    plain, capped = (route(one, "DP1", "T1", RouteOptions(heading="against")) for one in (topology, slow))
    speed, s = 12.0 / 3.6, MovementSettings()
    lost = (speed - 1.0) ** 2 / (2.0 * speed) * (1.0 / s.acceleration_mps2 + 1.0 / s.deceleration_mps2)
    room = speed**2 / (2.0 * s.acceleration_mps2) + (speed**2 - 1.0) / (2.0 * s.deceleration_mps2)
    assert room > 10.0  # the full speed is not reached before it
    assert 0.5 * lost < capped.time_s - plain.time_s < lost


def test_alternatives_and_why_they_lost() -> None:
    found = route(ladder(), "DP1", "t2.end", RouteOptions(heading="against"))
    assert found.nodes == ("t3", "i1", "t1", "i2", "t2")
    other = found.alternatives[0]
    assert other.nodes == ("t3", "i1", "t2")
    assert other.time_s > found.time_s
    assert f"{other.time_s - found.time_s:.1f} s longer" in other.lost
    assert not route(ladder(), "DP1", "t2.end", RouteOptions(alternatives=0)).alternatives
    quicker = route(SHARP, "t1.start", "t2.start", RouteOptions(heading="along")).alternatives[0]
    assert "blocked by i1.t1:i1.t2 (infeasible: too sharp)" in quicker.lost


def test_a_heading_that_cannot_be_had_is_told() -> None:
    """Without the arm into T3 nothing on the ring turns the machine."""
    fixed = with_connection(ladder(), "i1.t1", "i1.t3", feasible=False)
    ring = replace(fixed, connections=tuple(one for one in fixed.connections if "t3" not in one.start + one.end))
    found = route(ring, "t1.start", "t1.end", RouteOptions(heading="along", goal_heading="along"))
    assert not found.feasible
    assert not found.blocked_by
    assert "cannot be turned" in found.reason
    assert "no connection" in route(ring, "DP1", "t1.end").reason


@pytest.mark.parametrize(
    ("ask", "told"),
    [
        ({"start": "DP2"}, "did you mean 'DP1'"),
        ({"goal": "t1.stat"}, "did you mean 't1.start'"),
        ({"avoid": ("T9",)}, "--avoid T9"),
        ({"avoid": ("T1:T2",)}, "nothing joins"),
        ({"avoid": ("T1:X2",)}, "no 'X2'"),
        ({"heading": "north"}, "--heading north"),
        ({"goal_heading": "nan"}, "--goal-heading nan"),
    ],
)
def test_wrong_names_and_headings_are_refused(ask: dict[str, object], told: str) -> None:
    start, goal = str(ask.pop("start", "DP1")), str(ask.pop("goal", "T2"))
    with pytest.raises(UsageError, match=told):
        route(ladder(), start, goal, RouteOptions(**ask))  # type: ignore[arg-type]


def assert_sound(topology: TopologicalMap, found: Route) -> None:
    """The states follow each other by the rules over free connections; places, times and inversions add up."""
    free = {(one.start, one.end): one for one in topology.connections if one.feasible and not one.closed}
    came = None
    for before, after in pairwise(found.states):
        k, m = NAMES.index(before.state), NAMES.index(after.state)
        a, b = topology.points[before.point], topology.points[after.point]
        assert after.at_s >= before.at_s
        if a is b:
            stops_at_goal = after is found.states[-1] and not before.stop and STATES[k].heading == STATES[m].heading
            assert stops_at_goal or (isinstance(a, Waypoint) and a.purpose == "turning_bay")
        elif a.node != b.node:
            assert getattr(a, "joins", None) == b.id
            assert m in successors(k, "front_front", within=False)
        elif (a.id, b.id) in free:
            one = free[a.id, b.id]
            assert m in successors(k, one.kind, within=True)
            assert after.at_m - before.at_m == pytest.approx(one.length_m)
        else:
            one = free[b.id, a.id]
            assert m in successors(k, reversed_kind(one.kind), within=True)
            assert after.at_m - before.at_m == pytest.approx(one.length_m)
        gear = STATES[m].gear or STATES[k].gear
        came = gear or came
    gears = [gear for step in found.states if (gear := STATES[NAMES.index(step.state)].gear)]
    assert found.inversions == sum(a != b for a, b in pairwise(gears))
    assert found.time_s >= found.distance_m / (12.0 / 3.6) - 1e-9


@settings(max_examples=80, deadline=None)
@given(
    st.sets(st.integers(0, 6), max_size=3),
    st.sampled_from(["T1", "T2", "DP1", "DP2", "t1.end", "i2.t2", "I1"]),
    st.sampled_from(["T3", "t2.end", "DP1", "DP2", "i1.t1", "I2"]),
    st.sampled_from([None, "along", "against"]),
    st.sampled_from([None, "along", "against"]),
    st.booleans(),
)
def test_routes_are_sound_and_the_way_back_is_as_far(
    shut: set[int], start: str, goal: str, heading: str | None, goal_heading: str | None, bay: bool
) -> None:
    topology = two_places(bay)
    connections = tuple(replace(one, feasible=k not in shut) for k, one in enumerate(topology.connections))
    topology = replace(topology, connections=connections)
    planner = RoutePlanner(topology)
    found = planner.route(start, goal, RouteOptions(heading, goal_heading, alternatives=1))
    back = planner.route(goal, start, RouteOptions(goal_heading, heading, alternatives=0))
    assert found.feasible == back.feasible
    if found.feasible:
        assert_sound(topology, found)
        assert_sound(topology, back)
        assert found.time_s == pytest.approx(back.time_s, rel=0.2, abs=3.0)
    else:
        assert found.reason


def two_places(bay: bool) -> TopologicalMap:
    """The ladder with a second waypoint in T3, 10 m before DP1: a stop next to a stop."""
    topology = ladder()
    first = topology.waypoints[0]
    second = Waypoint("w2", "DP2", "t3", pose(0.0, -16.0, -90.0), "turning_bay" if bay else "pass")
    into = next(one for one in topology.connections if one.end == "w1")
    cut = replace(into, end="w2", line_m=into.line_m[:11], length_m=10.0)
    last = replace(into, start="w2", line_m=into.line_m[10:], length_m=10.0, kind="front_back")
    connections = tuple(cut if one is into else one for one in topology.connections)
    return replace(topology, waypoints=(first, second), connections=(*connections, last))


def test_from_a_stop_to_the_next_within_a_tunnel() -> None:
    found = route(two_places(False), "DP2", "DP1", RouteOptions(heading="along"))
    assert [(step.point, step.state) for step in found.states] == [("w2", "v"), ("w1", "iii"), ("w1", "v")]
    assert found.distance_m == pytest.approx(10.0)
    a, d = MovementSettings().acceleration_mps2, MovementSettings().deceleration_mps2
    peak = math.sqrt(2.0 * 10.0 * a * d / (a + d))
    assert found.time_s == pytest.approx(peak / a + peak / d)

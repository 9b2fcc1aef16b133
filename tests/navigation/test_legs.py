"""Legs: where the leading axle stops, what a path is like, limits and wall preference, room for a change of gear."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lhdmap.guidance.directive import ROUTE, SPEED, WAY
from lhdmap.movement.route import Route
from lhdmap.movement.routes import RouteOptions, RoutePlanner
from lhdmap.navigation.leg import Leg, legs_of
from lhdmap.navigation.room import room_m, with_room
from lhdmap.navigation.settings import NavigationSettings
from lhdmap.topology.model import Preference, TopologicalMap

from tests.movement.mines import with_connection
from tests.topology.maps import ladder

WALLS: list[tuple[Preference, float]] = [("left", 1.0), ("right", -1.0), ("centre", 0.0)]
SETTINGS = NavigationSettings()
WHEELBASE_M, NOSE_M, TAIL_M = 3.4, 3.2, 6.5


def legs(start: str, goal: str, heading: str, goal_heading: str | None = None, topology: TopologicalMap | None = None,
         **more: Any) -> list[Leg]:  # fmt: skip
    topology = topology or ladder()
    asked = RouteOptions(heading=heading, goal_heading=goal_heading, alternatives=0)
    route = RoutePlanner(topology).route(start, goal, asked)
    assert route.feasible, route.reason
    return legs_of(topology, route, WHEELBASE_M, NOSE_M, SETTINGS, **more)


def at(leg: Leg, way_m: float) -> tuple[float, float]:
    x, y = (float(np.interp(way_m, leg.path[:, WAY], leg.path[:, k])) for k in (0, 1))
    return x, y


def test_a_forward_leg_stops_with_its_front_axle_at_the_goal() -> None:
    (leg,) = legs("t1.start", "t1.end", "against")  # its heading is into the intersection; the machine faces the tunnel
    assert (leg.gear, leg.inversion) == (1, False)
    assert leg.stop_m == pytest.approx(leg.goal_m)
    assert at(leg, leg.stop_m) == pytest.approx((54.0, 0.0), abs=0.05)


def test_in_reverse_the_rear_axle_goes_a_wheelbase_beyond_it() -> None:
    (leg,) = legs("t1.start", "t1.end", "along")
    assert leg.gear == -1
    assert leg.stop_m == pytest.approx(leg.goal_m + WHEELBASE_M)
    assert at(leg, leg.stop_m) == pytest.approx((54.0 + WHEELBASE_M, 0.0), abs=0.1)


def test_with_an_inversion_the_axle_that_leads_next_is_at_the_point() -> None:
    sharp = with_connection(ladder(), "i1.t1", "i1.t2", feasible=False)
    found = legs("t1.start", "t2.start", "along", topology=sharp)  # into the mouth of T3, and out of it in reverse
    assert [one.gear for one in found] == [1, -1]
    assert [one.inversion for one in found] == [True, False]
    assert found[0].stop_m == pytest.approx(found[0].goal_m + WHEELBASE_M)
    found = legs("t1.start", "t2.start", "against", topology=sharp)
    assert [one.gear for one in found] == [-1, 1]
    assert found[0].stop_m == pytest.approx(found[0].goal_m + WHEELBASE_M)


@pytest.mark.parametrize("heading", ["along", "against"])
def test_a_path_is_continuous_and_goes_on_beyond_its_ends(heading: str) -> None:
    for leg in legs("DP1", "t2.end", heading):
        steps = np.hypot(*np.diff(leg.path[:, :2], axis=0).T)
        assert steps.max() < 0.35
        turns = np.abs(np.diff(leg.path[:, 2]))
        assert turns.max() < math.radians(25.0)  # corners of the hand-made map are sharp
        assert leg.path[-1, WAY] - leg.stop_m > 5.0
        assert leg.begin_m > 10.0


def test_the_path_reaches_back_to_a_machine_that_is_away_from_the_first_point() -> None:
    (leg,) = legs("t1.start", "t2.start", "along", away_m=30.0)
    x, y = at(leg, leg.begin_m - 30.0)
    assert leg.gear == 1
    assert (x, y) == pytest.approx((36.0, 0.0), abs=0.5)


def test_limits_are_those_of_the_ways_and_of_the_gear() -> None:
    topology = ladder()
    topology = replace(topology, tunnels=tuple(replace(one, speed_limit_kmh=9.0) for one in topology.tunnels))
    (forward,) = legs("t1.start", "t1.end", "against", topology=topology)
    assert 3.6 * forward.path[:, SPEED].max() == pytest.approx(9.0)
    fast = replace(topology, tunnels=tuple(replace(one, speed_limit_kmh=40.0) for one in topology.tunnels))
    fast = replace(fast, connections=tuple(replace(one, speed_limit_kmh=40.0) for one in fast.connections))
    (forward,) = legs("t1.start", "t1.end", "against", topology=fast)
    (reverse,) = legs("t1.start", "t1.end", "along", topology=fast)
    (loaded,) = legs("t1.start", "t1.end", "against", topology=fast, loaded=True)
    tops = [3.6 * one.path[:, SPEED].max() for one in (forward, reverse, loaded)]
    assert tops == pytest.approx([20.0, 12.0, 18.0])


def test_the_route_counts_more_in_and_about_intersections() -> None:
    (leg,) = legs("t1.end", "t3.start", "along")
    weight = np.interp(
        [leg.begin_m + 20.0, leg.begin_m + 46.0, leg.begin_m + 54.0], leg.path[:, WAY], leg.path[:, ROUTE]
    )
    assert weight.tolist() == [1.0, SETTINGS.crossing_weight, SETTINGS.crossing_weight]


@pytest.mark.parametrize(("wall", "sign"), WALLS)
@pytest.mark.parametrize("back", [False, True])
def test_a_wall_preference_is_of_the_tunnel_whatever_the_direction(
    wall: Preference, sign: float, *, back: bool
) -> None:
    topology = ladder()
    wide = [
        replace(one, wall_preference=wall, half_widths_m=np.full_like(one.half_widths_m, 3.0))
        for one in topology.tunnels
    ]
    start, goal, heading = ("t1.end", "t1.start", "against") if back else ("t1.start", "t1.end", "against")
    (leg,) = legs(start, goal, heading, topology=replace(topology, tunnels=tuple(wide)))
    middle = leg.path[np.abs(leg.path[:, 0] - 30.0) < 5.0]
    assert middle[:, 1] == pytest.approx(sign * (3.0 - 1.225 - SETTINGS.beside_wall_m), abs=0.02)


def test_a_short_drift_has_room_up_to_its_end_alone() -> None:
    topology = ladder()
    route = RoutePlanner(topology).route("t1.end", "t2.end", RouteOptions(heading="against", alternatives=0))
    by_name = {step.point: step for step in route.states}
    assert all(math.isinf(room_m(topology, step, NOSE_M)) for step in by_name.values())
    into = RoutePlanner(topology).route("t1.end", "DP1", RouteOptions(alternatives=0))
    mouth = next(step for step in into.states if step.point == "t3.start")
    assert room_m(topology, mouth, NOSE_M) == pytest.approx(20.0 + NOSE_M)  # to where the bucket is at the draw point


def test_a_change_of_gear_without_room_is_avoided() -> None:
    topology = ladder()
    planner = RoutePlanner(topology)
    asked = RouteOptions(heading="against", goal_heading="along", alternatives=0)  # into the street the other way round
    seen: list[tuple[str, ...]] = []

    def ask(avoid: tuple[str, ...]) -> Route:
        seen.append(avoid)
        return planner.route("t1.end", "t2.start", replace(asked, avoid=avoid))

    free = with_room(topology, ask, (), NOSE_M, TAIL_M, 0.7)
    tight = with_room(topology, ask, (), 40.0, 40.0, 0.7)
    assert free.feasible
    assert seen[0] == ()
    assert not tight.feasible or tight.inversions == 0 or len(seen) > 2

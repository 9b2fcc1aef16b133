"""Routes: the gear follows from the way a machine came, inversions need room for all of it, ways are what a machine can follow."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.errors import UsageError
from lhdmap.machine import Machine
from lhdmap.mine.make_network import make_network
from lhdmap.mine.network import Network
from lhdmap.mine.plan import find_plan, load_plan
from lhdmap.mine.route import Start, parse_route, start_of
from lhdmap.mine.routes import RouteFinder
from lhdmap.mine.runs import Run
from lhdmap.mine.stands import overhang_m, stand_at
from lhdmap.mine.ways import STEP_M, Leg, legs_of

from tests.mine.plans import TEE, lines, network_of

MACHINE = Machine()


@pytest.fixture(scope="module")
def tee() -> Network:
    return network_of(TEE, place=[{"drift": "B", "kind": "draw_point", "side": "end", "name": "DP"}])


def runs_of(network: Network, route: str, start: str | None = None) -> list[Run]:
    stops = parse_route(route, network.plan)
    return RouteFinder(network, MACHINE).route(start_of(network, MACHINE, start), stops)


def gears(network: Network, runs: list[Run]) -> list[int]:
    return [leg.gear for leg in legs_of(network, runs, MACHINE)]


def test_a_drift_is_driven_to_its_end(tee: Network) -> None:
    (run,) = runs_of(tee, "A")
    front_overhang_m, rear_overhang_m = 3.2, 3.11
    assert run.from_m == pytest.approx(1.2 + rear_overhang_m + 3.4)
    assert run.to_m == pytest.approx(80.0 - 1.2 - front_overhang_m)


def test_a_turn_leaves_and_comes_in_where_its_arc_does(tee: Network) -> None:
    runs = runs_of(tee, "A,DP")
    assert [tee.tubes[run.tube].name for run in runs] == ["A", "I1 A B", "B"]
    reach = (6.0 + 2.25) * math.tan(math.pi / 4)
    assert runs[0].to_m == pytest.approx(40.0 - reach, abs=0.1)
    assert runs[2].from_m == pytest.approx(reach, abs=0.1)
    assert runs[2].stop == "DP"


def test_out_of_a_dead_end_it_goes_in_reverse(tee: Network) -> None:
    assert gears(tee, runs_of(tee, "A,DP,-A")) == [1, -1]


def test_to_go_on_forwards_it_passes_the_node_with_all_its_length(tee: Network) -> None:
    runs = runs_of(tee, "A,DP,A")
    assert gears(tee, runs) == [1, -1, 1]
    legs = legs_of(tee, runs, MACHINE)
    wheelbase_m = MACHINE.dimensions.wheelbase_m
    front_m = np.array([legs[2].x_m[0], legs[2].y_m[0]])
    rear_m = np.array([legs[1].x_m[-1], legs[1].y_m[-1]])
    assert np.hypot(*(front_m - rear_m)) == pytest.approx(wheelbase_m, abs=0.1)
    assert abs(rear_m[0] - 40.0) > (6.0 + 2.25)  # the rear axle, which led, is behind the turn


def test_a_route_that_begins_in_reverse(tee: Network) -> None:
    runs = runs_of(tee, "-A,B", "DP")
    assert gears(tee, runs)[0] == -1


@pytest.mark.parametrize(("route", "told"), [("A,Q", "'Q' is no drift or place of mine 'tee'"), ("A,-DP,DP", None)])
def test_names_that_are_not_in_the_plan_are_refused(tee: Network, route: str, told: str | None) -> None:
    if told is None:
        assert parse_route(route, tee.plan)[1] == ("DP", -1)
        return
    with pytest.raises(UsageError, match=told):
        parse_route(route, tee.plan)


def test_a_corner_that_is_not_cut_cannot_be_driven() -> None:
    network = network_of(TEE, junction=[{"at": [40, 0, 0], "corner_m": 0.0}])
    with pytest.raises(UsageError, match="no way to 'B'"):
        runs_of(network, "A,B")


@pytest.mark.parametrize("name", ["ring", "level"])
def test_a_teaching_drive_goes_through_every_edge(name: str) -> None:
    network = make_network(load_plan(find_plan(name)))
    runs = RouteFinder(network, MACHINE).teaching(start_of(network, MACHINE, None))
    legs = legs_of(network, runs, MACHINE)
    places = np.concatenate([np.stack([leg.x_m, leg.y_m], axis=1) for leg in legs])
    for edge in network.edges:
        middle = network.tubes[edge.tube].pose(0.5 * (edge.start_m + edge.end_m))[:2]
        dead_end = 1 in (network.nodes[edge.start].degree, network.nodes[edge.end].degree)
        assert np.hypot(*(places - middle).T).min() < (12.0 if dead_end else 1.0)


def uncut() -> Network:
    table = lines(("A", [[0, 0, 0], [80, 0, 0]]), ("B", [[40, -60, 0], [40, 0, 0]]))
    return network_of(table, junction=[{"at": [40, 0, 0], "corner_m": 0.0}])


@pytest.mark.parametrize(("name", "start"), [("haul_ring", None), ("", "B")])
def test_a_teaching_drive_that_ends_at_a_node_has_no_bumper_in_the_wall_ahead(name: str, start: str | None) -> None:
    network = make_network(load_plan(find_plan(name))) if name else uncut()
    runs = RouteFinder(network, MACHINE).teaching(start_of(network, MACHINE, start))
    leg, tube = legs_of(network, runs, MACHINE)[-1], network.tubes[runs[-1].tube]
    ahead_m = 0.5 + overhang_m(MACHINE, leg.gear)
    ahead = ahead_m * np.array([math.cos(leg.heading_rad[-1]), math.sin(leg.heading_rad[-1])])
    nose_m = np.array([leg.x_m[-1], leg.y_m[-1]]) + ahead
    places_m = tube.line.at(np.arange(0.0, tube.length_m, 0.1))[:, :2]
    assert np.hypot(*(places_m - nose_m).T).min() < tube.half_width_m(tube.length_m)


def test_a_teaching_drive_comes_to_each_draw_point_and_dump_bucket_first() -> None:
    """Into the short drift of DP2 of `branches` it could back to turn: it would never stand where machines load."""
    network = make_network(load_plan(find_plan("branches")))
    runs = RouteFinder(network, MACHINE).teaching(start_of(network, MACHINE, None))
    for place in network.plan.places:
        if place.kind in ("draw_point", "dump"):
            tube, at_m, facing = stand_at(network, place, MACHINE)
            ends = [run for run in runs if run.tube == tube and abs(run.to_m - at_m) < 0.1]
            assert any(run.gear > 0 and (run.to_m - run.from_m) * facing > 0.0 for run in ends), place.name


@pytest.mark.parametrize(("route", "start"), [("S1,DP1,-S1,OP1", None), ("-S1,OP1,-W,S2,TB1,-S2,DP9", "DP3")])
def test_ways_are_smooth_and_no_tighter_than_the_machine_bends(route: str, start: str | None) -> None:
    network = make_network(load_plan(find_plan("level")))
    for leg in legs_of(network, runs_of(network, route, start), MACHINE):
        assert _largest_step_m(leg) < 1.2 * STEP_M
        assert math.degrees(np.abs(leg.articulation_rad).max()) < MACHINE.dimensions.max_articulation_deg - 5.0
        assert np.abs(leg.curvature_pm).max() < 1.0 / 5.0


def _largest_step_m(leg: Leg) -> float:
    return float(np.hypot(np.diff(leg.x_m), np.diff(leg.y_m)).max())


def test_a_start_within_a_drift_is_kept(tee: Network) -> None:
    planner = RouteFinder(tee, MACHINE)
    runs = planner.route(Start(tee.tube("A"), 20.0, -1), parse_route("-A", tee.plan))
    assert runs[0].from_m == pytest.approx(23.4)  # in reverse the rear axle leads

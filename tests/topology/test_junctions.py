"""What counts as an opening, what is one junction, and where a junction ends."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lhdmap.messages import FloatArray
from lhdmap.topology.arms import Axis, corner_m, meeting_m, reach_m
from lhdmap.topology.edits import Spot, TopologyEdits
from lhdmap.topology.graph import Graph, Scale
from lhdmap.topology.reduce import graph_of
from lhdmap.topology.room import Room
from lhdmap.topology.settings import TopologySettings

from tests.topology.drawn import SCALE, Drift, World, steps

ALONG: Drift = ([(0, 0), (80, 0)], 4.6)
DRIVEN = steps(ALONG[0])


def niche(depth_m: float, width_m: float = 4.6, at: float = 40.0) -> Drift:
    """A side chamber that reaches so far beyond the wall of the drift along x."""
    return [(at, 0.0), (at, 2.3 + depth_m)], width_m


@pytest.mark.parametrize(("depth_m", "is_branch"), [(2.0, False), (3.0, False), (5.0, True), (7.0, True)])
def test_an_opening_is_a_branch_from_four_metres_on(depth_m: float, is_branch: bool) -> None:
    found = graph_of(World([ALONG, niche(depth_m)]).sheet(), DRIVEN, SCALE, TopologySettings())
    assert bool(found.junctions()) is is_branch
    if not is_branch and found.niches:
        assert found.niches[0].depth_m == pytest.approx(depth_m, abs=0.6)


def test_an_opening_that_the_machine_does_not_fit_into_is_none() -> None:
    found = graph_of(World([ALONG, niche(20.0, 2.4)]).sheet(), DRIVEN, SCALE, TopologySettings())
    assert not found.junctions()


def test_where_only_driven_arms_count_one_that_was_seen_does_not() -> None:
    world, scale = World([ALONG, niche(20.0)]), replace_scale(seen=False)
    assert not graph_of(world.sheet(), DRIVEN, scale, TopologySettings()).junctions()
    into = np.vstack([DRIVEN, steps([(40, 0), (40, 15)])])
    assert len(graph_of(world.sheet(), into, scale, TopologySettings()).junctions()) == 1


def replace_scale(*, seen: bool) -> Scale:
    return SCALE._replace(seen=seen, obstacle_m=SCALE.obstacle_m if seen else 1.0)


@pytest.mark.parametrize(("apart_m", "degrees"), [(2.0, [4]), (14.0, [3, 3])])
def test_near_junctions_are_one(apart_m: float, degrees: list[int]) -> None:
    """Branches to both sides, staggered."""
    south: Drift = ([(40 + apart_m, 0), (40 + apart_m, -30)], 4.6)
    world = World([ALONG, ([(40, 0), (40, 30)], 4.6), south])
    driven = np.vstack([DRIVEN, steps([(40, 0), (40, 25)]), steps([(40 + apart_m, 0), (40 + apart_m, -25)])])
    assert _degrees(graph_of(world.sheet(), driven, SCALE, TopologySettings())) == degrees


def test_edits_merge_and_split() -> None:
    south: Drift = ([(52, 0), (52, -30)], 4.6)
    world = World([ALONG, ([(40, 0), (40, 30)], 4.6), south])
    merged = TopologyEdits(merge=(Spot((46.0, 0.0)),))
    assert _degrees(graph_of(world.sheet(), DRIVEN, SCALE, TopologySettings(), (), merged)) == [4]
    near = World([ALONG, ([(40, 0), (40, 30)], 4.6), ([(43, 0), (43, -30)], 4.6)])
    split = TopologyEdits(split=(Spot((41.5, 0.0)),))
    assert _degrees(graph_of(near.sheet(), DRIVEN, SCALE, TopologySettings(), (), split)) == [3, 3]
    assert _degrees(graph_of(near.sheet(), DRIVEN, SCALE, TopologySettings())) == [4]


def _degrees(found: Graph) -> list[int]:
    return sorted(found.skeleton.degree(vertex) for vertex in found.junctions())


def axis(heading_deg: float, half_m: float = 2.3, through: tuple[float, float] = (0.0, 0.0)) -> Axis:
    a = math.radians(heading_deg)
    return Axis(np.array([math.cos(a), math.sin(a)]), np.array(through), half_m, 15.0)


@pytest.mark.parametrize("angle_deg", [30, 45, 60, 90, 120])
@pytest.mark.parametrize("half_m", [1.8, 2.3, 3.0])
def test_the_corner_is_where_both_walls_meet(angle_deg: float, half_m: float) -> None:
    """Against the crossing of the two wall lines, solved as equations."""
    own, other = axis(0.0), axis(angle_deg, half_m)
    left, right = np.array([0.0, 2.3]), half_m * np.array([other.along[1], -other.along[0]])
    s, _ = np.linalg.solve(np.column_stack([own.along, -other.along]), right - left)
    assert corner_m(own, other) == pytest.approx(s, abs=1e-9)


def test_arms_on_one_line_have_no_corner() -> None:
    assert corner_m(axis(0.0), axis(175.0)) is None
    assert reach_m(axis(0.0), [axis(180.0)], np.zeros(2)) == 0.0


def test_axes_meet_where_their_lines_do_and_not_far_away() -> None:
    axes = [axis(0.0, through=(5.0, 1.0)), axis(90.0, through=(-2.0, 9.0)), axis(180.0, through=(-7.0, 1.0))]
    assert np.allclose(meeting_m(axes, np.array([-1.0, 0.5]), 4.0), [-2.0, 1.0], atol=0.05)
    far = np.array([30.0, 0.0])
    assert np.allclose(meeting_m(axes, far, 3.0), far)


@pytest.mark.parametrize("angle_deg", [60, 75, 90])
@pytest.mark.parametrize("radius_m", [0.0, 3.0, 6.0])
def test_a_rounded_corner_begins_where_its_circle_touches_the_wall(angle_deg: float, radius_m: float) -> None:
    """Branch to the left; the corner ahead (its angle is the branch's) is rounded in the drawing."""
    a = math.radians(angle_deg)
    along, other = np.array([1.0, 0.0]), np.array([math.cos(a), math.sin(a)])
    world = World([ALONG, ([(30.0, 0.0), (30.0 + 40.0 * other[0], 40.0 * other[1])], 4.6)])
    own, branch, back = (axis(x, through=(30.0, 0.0)) for x in (0.0, angle_deg, 180.0))
    middle = np.array([30.0, 0.0])
    corner = corner_m(own, branch)
    assert corner is not None
    if radius_m:
        world.round_off((30.0 + corner, 2.3), along, other, radius_m)
    room = Room(world.free, world.sheet())
    begins = corner + (radius_m / math.tan(0.5 * a) if radius_m else 0.0)
    assert reach_m(own, [branch, back], middle, room) == pytest.approx(begins, abs=0.6 if radius_m else 0.1)


def test_between_near_junctions_the_drift_beyond_them_tells_the_axis() -> None:
    """Branches 14 m apart on opposite sides, corners rounded by 4 m: 1.4 m of straight wall are left between them."""
    world = World([ALONG, ([(33, 0), (33, 40)], 4.6), ([(47, 0), (47, -40)], 4.6)])
    for x, y in ((33.0, 1.0), (47.0, -1.0)):
        for side in (-1.0, 1.0):
            world.round_off((x + side * 2.3, y * 2.3), np.array([side, 0.0]), np.array([0.0, y]), 4.0)
    found = graph_of(world.sheet(), DRIVEN, SCALE, TopologySettings())
    assert len(found.junctions()) == 2
    for vertex in found.junctions():
        middle, axes = found.axes(vertex)
        assert min(np.linalg.norm(middle - [x, 0.0]) for x in (33.0, 47.0)) < 0.35
        assert all(_off_deg(one) < 2.0 for one in axes)


def _off_deg(one: Axis) -> float:
    return abs(math.degrees(math.remainder(one.heading_rad, 0.5 * math.pi)))


def test_a_place_beyond_the_grid_is_not_free() -> None:
    world = World([ALONG])
    room = Room(world.free, world.sheet())
    places: FloatArray = np.array([[40.0, 0.0], [40.0, 2.6], [1e4, 0.0], [-1e4, -1e4]])
    assert room.holds(places).tolist() == [True, False, False, False]
    found = room.to_wall_m(np.array([[40.0, 0.5]]), np.array([[0.0, 1.0]]))
    assert found[0] == pytest.approx(1.8, abs=0.08)


def test_settings_of_merging_are_kept() -> None:
    south: Drift = ([(45, 0), (45, -30)], 4.6)
    sheet = World([ALONG, ([(40, 0), (40, 30)], 4.6), south]).sheet()
    assert _degrees(graph_of(sheet, DRIVEN, SCALE, replace(TopologySettings(), merge=1.5))) == [4]
    assert _degrees(graph_of(sheet, DRIVEN, SCALE, replace(TopologySettings(), merge=0.1))) == [3, 3]

"""Skeletons of drawn shapes: how many arms meet, how many lines there are, and where."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.messages import FloatArray
from lhdmap.topology.graph import Graph
from lhdmap.topology.reduce import graph_of
from lhdmap.topology.settings import TopologySettings
from lhdmap.topology.skeleton import Line, Skeleton, Vertex, core_of, skeleton_of

from tests.topology.drawn import SCALE, Drift, World, steps

ALONG: Drift = ([(0, 0), (80, 0)], 4.6)


def graph(
    *drifts: Drift, driven: FloatArray | None = None, rocks: tuple[tuple[float, float, float, float], ...] = ()
) -> Graph:
    """The graph of drifts that were all driven, or one that was driven elsewhere."""
    world = World(drifts, rocks)
    way = np.vstack([steps(line) for line, _ in drifts]) if driven is None else driven
    return graph_of(world.sheet(), way, SCALE, TopologySettings())


def branch(at: float, angle_deg: float, length: float = 35.0) -> Drift:
    a = math.radians(angle_deg)
    return [(at, 0.0), (at + length * math.cos(a), length * math.sin(a))], 4.6


def degrees(found: Graph) -> list[int]:
    return sorted(found.skeleton.degree(vertex) for vertex in found.junctions())


@pytest.mark.parametrize("angle_deg", [45, 60, 90, 120, -75])
def test_a_branch_is_one_junction_where_the_centre_lines_meet(angle_deg: float) -> None:
    found = graph(ALONG, branch(35.0, angle_deg))
    assert degrees(found) == [3]
    middle, axes = found.axes(found.junctions()[0])
    assert np.linalg.norm(middle - [35.0, 0.0]) < 0.25
    headings = sorted(round(math.degrees(axis.heading_rad)) % 360 for axis in axes)
    assert np.allclose(headings, sorted([0, 180, angle_deg % 360]), atol=1.5)
    assert all(abs(axis.half_m - 2.3) < 0.12 for axis in axes)


def test_a_cross_has_four_arms() -> None:
    found = graph(ALONG, ([(40, -35), (40, 35)], 4.6))
    assert degrees(found) == [4]
    assert len(found.skeleton.lines) == 4


def test_a_bend_is_no_junction() -> None:
    assert degrees(graph(([(0, 0), (40, 0), (40, 40)], 4.6))) == []


def test_a_ring_without_a_branch_is_one_line_from_itself_to_itself() -> None:
    found = graph(([(0, 0), (50, 0), (50, 50), (0, 50), (0, -2)], 4.6))
    assert len(found.skeleton.lines) == 1
    assert found.skeleton.lines[0].start == found.skeleton.lines[0].end


def test_three_tunnels_between_the_same_two_junctions() -> None:
    ring: Drift = ([(0, 0), (60, 0), (60, 50), (0, 50), (0, -2.3)], 4.6)
    found = graph(ring, ([(30, 0), (30, 50)], 4.6))
    assert degrees(found) == [3, 3]
    a, b = found.junctions()
    assert [{line.start, line.end} for line in found.skeleton.lines] == [{a, b}] * 3


def test_a_tunnel_that_ends_where_it_began() -> None:
    loop: Drift = ([(40, 0), (40, 40), (75, 40), (75, -2.3)], 4.6)
    found = graph(([(0, 0), (77.3, 0)], 4.6), loop)
    assert degrees(found) == [3]
    own = [line for line in found.skeleton.lines if line.start == line.end]
    assert len(own) == 1
    assert own[0].length_m == pytest.approx(150.0, abs=12.0)
    assert found.skeleton.degree(own[0].start) == 3


@pytest.mark.parametrize(("length_m", "width_m", "count"), [(4.4, 1.8, 0), (9.0, 9.0, 2)])
def test_a_parked_machine_is_filled_and_a_pillar_is_not(length_m: float, width_m: float, count: int) -> None:
    """In a hall of 20 m width: a box with a diagonal below 6.5 m, and one above it."""
    hall: Drift = ([(30, 0), (56, 0)], 20.0)
    driven = np.vstack(
        [steps([(2, 0), (32, 0), (36, 7), (50, 7), (54, 0), (78, 0), (54, 0), (50, -7), (36, -7), (32, 0)])]
    )
    found = graph(ALONG, hall, driven=driven, rocks=((43.0, 0.0, length_m, width_m),))
    assert len(found.junctions()) == count


def test_what_was_driven_exists_however_narrow_it_is() -> None:
    world = World([ALONG], ((40.0, 0.0, 1.0, 10.0),))  # a wall across: a curtain
    core, distance = core_of(world.free, world.sheet(), steps(ALONG[0]), 1.0)
    found = skeleton_of(core, distance, world.sheet())
    ends = [vertex for vertex in found.vertices if found.degree(vertex) == 1]
    xs = sorted(found.vertices[vertex].point_m[0] for vertex in ends)
    assert xs[0] < 4.0
    assert xs[-1] > 76.0


def test_a_piece_that_nobody_was_in_is_left_out() -> None:
    found = graph(ALONG, ([(0, 30), (80, 30)], 4.6), driven=steps(ALONG[0]))
    assert len(found.skeleton.lines) == 1
    assert abs(found.skeleton.lines[0].points_m[:, 1]).max() < 4.0


def _line(start: int, end: int, *points: tuple[float, float]) -> Line:
    return Line(start, end, np.array(points, dtype=float), np.ones(len(points)))


def test_lines_at_a_vertex_with_two_become_one() -> None:
    found = Skeleton({0: Vertex(np.zeros(2), 1.0), 1: Vertex(np.ones(2), 1.0), 2: Vertex(np.array([2.0, 0.0]), 1.0)})
    found.lines = [_line(0, 1, (0, 0), (1, 1)), _line(2, 1, (2, 0), (1, 1))]
    found.straighten()
    assert [(line.start, line.end) for line in found.lines] in ([(0, 2)], [(2, 0)])
    assert found.lines[0].length_m == pytest.approx(2.0 * math.sqrt(2.0))


def test_a_loop_has_two_ends_at_its_vertex() -> None:
    found = Skeleton({0: Vertex(np.zeros(2), 1.0), 1: Vertex(np.array([5.0, 0.0]), 1.0)})
    loop, arm = _line(0, 0, (0, 0), (1, 1), (0, 2), (0, 0)), _line(0, 1, (0, 0), (5, 0))
    found.lines = [loop, arm]
    assert found.degree(0) == 3
    found.remove(loop)
    assert found.degree(0) == 1
    assert set(found.vertices) == {0, 1}
    found.remove(arm)
    assert not found.vertices

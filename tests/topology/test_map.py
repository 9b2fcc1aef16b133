"""The whole way from a drive's views to its map, in drawn drifts of known geometry."""

from __future__ import annotations

import functools
import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.errors import ConfigError
from lhdmap.messages import FloatArray
from lhdmap.topology.build import Seen, topology_of
from lhdmap.topology.edits import Close, Rename, TopologyEdits
from lhdmap.topology.model import DEAD_END, UNEXPLORED, TopologicalMap
from lhdmap.topology.settings import TopologySettings

from tests.topology.drawn import World, drive

CHORD_M = 26.0


@functools.cache
def tee() -> Seen:
    """T7 along x for 70 m, T8 from (30, 0) to the north for 30 m, both driven, and named."""
    world = World([([(0, 0), (70, 0)], 4.6), ([(30, 0), (30, 32)], 4.6)])
    way = [(3.0, 0.0), (30.0, 0.0), (30.0, 27.0), (30.0, 0.0), (66.0, 0.0)]
    return drive(world, way, ((0.0, "T7"), (24.0, "X"), (32.0, "T8"), (78.0, "X"), (86.0, "T9")))


@functools.cache
def ring() -> Seen:
    """A ring of 56 x 30 m with a chord: three tunnels join the same two intersections."""
    corners = [(0.0, 0.0), (56.0, 0.0), (56.0, 30.0), (0.0, 30.0), (0.0, -2.3)]
    world = World([(corners, 4.6), ([(CHORD_M, 0.0), (CHORD_M, 30.0)], 4.6)])
    way = [(2.0, 0.0), *corners[1:4], (0.0, 0.0), (CHORD_M, 0.0), (CHORD_M, 28.0)]
    return drive(world, way)


def found(seen: Seen, edits: TopologyEdits | None = None) -> TopologicalMap:
    return topology_of(seen, TopologySettings(), edits or TopologyEdits()).map


def ends(topology: TopologicalMap) -> list[tuple[str, ...]]:
    return sorted(tuple(sorted(tunnel.ends)) for tunnel in topology.tunnels)


def test_a_branch() -> None:
    topology = found(tee())
    assert [(node.name, node.degree) for node in topology.intersections] == [("X", 3)]
    node = topology.intersections[0]
    assert np.linalg.norm(node.pose_map_node[:2] - [30.0, 0.0]) < 0.3
    assert sorted(tunnel.name for tunnel in topology.tunnels) == ["T7", "T8", "T9"]
    assert ends(topology) == [(DEAD_END, "i1")] * 3
    lengths = {tunnel.name: tunnel.length_m for tunnel in topology.tunnels}
    assert lengths == pytest.approx({"T7": 27.7, "T8": 29.7, "T9": 37.7}, abs=0.9)
    assert all(np.median(tunnel.widths_m) == pytest.approx(4.6, abs=0.25) for tunnel in topology.tunnels)


def test_access_points_are_where_the_walls_corner_and_face_outward() -> None:
    topology = found(tee())
    own = [point for point in topology.access_points if point.node == "i1"]
    assert sorted(round(math.degrees(point.pose[3])) % 360 // 10 * 10 for point in own) in (
        [0, 90, 180],
        [0, 80, 180],
        [90, 170, 350],
    )
    for point in own:
        assert np.linalg.norm(point.pose[:2] - [30.0, 0.0]) == pytest.approx(2.3, abs=0.45)
        out = point.pose[:2] - np.array([30.0, 0.0])
        assert math.remainder(math.atan2(out[1], out[0]) - point.pose[3], 2 * math.pi) == pytest.approx(0.0, abs=0.2)


def test_access_points_join_in_pairs_at_one_place_facing_each_other() -> None:
    for topology in (found(tee()), found(ring())):
        points = {point.id: point for point in topology.access_points}
        for point in topology.access_points:
            assert point.joins is not None
            twin = points[point.joins]
            assert twin.joins == point.id
            assert twin.node != point.node
            assert np.allclose(point.pose[:3], twin.pose[:3])
            assert abs(math.remainder(point.pose[3] - twin.pose[3], 2 * math.pi)) == pytest.approx(math.pi)


def test_every_pair_of_a_node_s_points_has_one_connection() -> None:
    topology = found(tee())
    pairs = Counter(frozenset((one.start, one.end)) for one in topology.connections)
    assert set(pairs.values()) == {1}
    within = {one.id for one in topology.points_of("i1")}
    assert sum(pair <= within for pair in pairs) == 3
    driven = [one for one in topology.connections if {one.start, one.end} <= within and one.feasible]
    assert len(driven) >= 2


def test_a_driven_dead_end_has_a_waypoint_where_the_machine_came_farthest() -> None:
    topology = found(tee())
    places = {topology.nodes[point.node].name: point.pose[:2] for point in topology.waypoints}
    assert np.allclose(places["T8"], [30.0, 27.0], atol=0.8)
    assert np.allclose(places["T9"], [65.8, 0.0], atol=0.8)


def test_three_tunnels_join_the_same_two_intersections() -> None:
    topology = found(ring())
    assert [node.degree for node in topology.intersections] == [3, 3]
    assert ends(topology) == [("i1", "i2")] * 3
    lengths = sorted(tunnel.length_m for tunnel in topology.tunnels)
    assert lengths == pytest.approx([30 - 4.6, 2 * CHORD_M + 30 - 4.6, 2 * (56 - CHORD_M) + 30 - 4.6], abs=6.0)


def test_where_the_drive_ends_in_the_open_the_tunnel_is_unexplored() -> None:
    world = World([([(0, 0), (200, 0)], 4.6)])
    topology = found(drive(world, [(3.0, 0.0), (60.0, 0.0)]))
    assert topology.tunnels[0].ends == (DEAD_END, UNEXPLORED)


def test_edits_are_respected_and_wrong_ones_told() -> None:
    edits = TopologyEdits(rename=(Rename(node="X", name="Cross 4"),), close=(Close(at_m=(50.0, 0.0)),))
    topology = found(tee(), edits)
    assert topology.intersections[0].name == "Cross 4"
    assert [tunnel.name for tunnel in topology.tunnels if tunnel.closed] == ["T9"]
    with pytest.raises(ConfigError, match="T8"):
        found(tee(), TopologyEdits(close=(Close(node="T88"),)))


def test_nothing_seen_or_driven_makes_an_empty_map_that_says_so() -> None:
    seen = tee()
    assert found(seen._replace(views=[], view_poses=seen.view_poses[:0])).remarks
    assert not found(seen._replace(views=[], view_poses=seen.view_poses[:0])).tunnels


def moved(poses: FloatArray, turn: float, shift: tuple[float, float]) -> FloatArray:
    c, s = math.cos(turn), math.sin(turn)
    x, y = poses[:, 0], poses[:, 1]
    return np.column_stack([c * x - s * y + shift[0], s * x + c * y + shift[1], poses[:, 2], poses[:, 3] + turn])


@settings(max_examples=6, deadline=None)
@given(turn=st.floats(-math.pi, math.pi), x=st.floats(-500.0, 500.0), y=st.floats(-500.0, 500.0))
def test_turning_and_shifting_the_mine_turns_and_shifts_the_map(turn: float, x: float, y: float) -> None:
    seen = tee()
    other = seen._replace(view_poses=moved(seen.view_poses, turn, (x, y)), path=moved(seen.path, turn, (x, y)))
    a, b = found(seen), found(other)
    assert [tunnel.name for tunnel in a.tunnels] == [tunnel.name for tunnel in b.tunnels]
    assert ends(a) == ends(b)
    before = moved(np.array([point.pose for point in a.access_points]), turn, (x, y))
    after = np.array([point.pose for point in b.access_points])
    assert [point.id for point in a.access_points] == [point.id for point in b.access_points]
    assert np.linalg.norm(before[:, :2] - after[:, :2], axis=1).max() < 0.45
    assert np.abs(np.remainder(before[:, 3] - after[:, 3] + math.pi, 2 * math.pi) - math.pi).max() < math.radians(3.0)

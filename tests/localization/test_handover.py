"""From node to node: a drift of two tunnels with an intersection between them, and a tunnel of another level above it."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from lhdmap.config import settings_from
from lhdmap.geometry import se2
from lhdmap.landmarks.build import landmarks_of
from lhdmap.landmarks.scans import NodeScan
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.localization.rows import TRACKING, LocalizationRow
from lhdmap.messages import FloatArray, Message, Mount
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.pipeline.localize import Localizer
from lhdmap.simulation.planar import PlanarScanner, simulate_scans
from lhdmap.topology.model import DEAD_END, AccessPoint, Intersection, TopologicalMap, Tunnel

from tests.localization import known
from tests.settings.streams import RATE_HZ, wheels_of

FIRST_M, LAST_M = 20.0, 27.0  # where the intersection begins and ends
ABOVE_M = 6.0
SPEED_MPS = 2.5
FORTH = ((8.0, 40.0),)
FORTH_AND_BACK = ((8.0, 40.0), (40.0, 12.0))
INVERSION = ((8.0, 23.5), (23.5, 10.0))
HALF_WAY = ((8.0, 21.0), (21.0, 14.0), (14.0, 36.0))


@functools.cache
def parted_map() -> KnownMap:
    """Return the drift of `known` as tunnels `a` and `b` with the intersection `i` between them, and a tunnel `up` above."""
    line = np.column_stack([known.world().centre_line_m[:, :2], np.zeros(len(known.world().centre_line_m))])[::25]
    along = 0.5 * np.arange(len(line))
    tunnels = [
        _tunnel("a", line[along <= FIRST_M], ("i", DEAD_END)),
        _tunnel("b", line[along >= LAST_M], ("i", DEAD_END)),
        _tunnel(
            "up", np.column_stack([np.full(40, 23.0), np.arange(-20.0, 20.0), np.full(40, ABOVE_M)]), (DEAD_END,) * 2
        ),
    ]
    middle = known.poses_at(np.array([0.5 * (FIRST_M + LAST_M)]))[0]
    node = Intersection("i", "I", 3, np.array([middle[0], middle[1], 0.0, middle[2]]), np.zeros((0, 2)))
    ends = [known.poses_at(np.array([at]))[0] for at in (FIRST_M, LAST_M)]
    points = [
        AccessPoint(f"i{k}", "i", np.array([x, y, 0.0, h + (math.pi if k == 0 else 0.0)]))
        for k, (x, y, h) in enumerate(ends)
    ]
    topology = TopologicalMap(tunnels=tuple(tunnels), intersections=(node,), access_points=tuple(points))
    places = np.arange(2.0, 48.0, 0.5)
    poses = known.poses_at(places)
    hits = known.hits_at(poses, 1)
    names = ["a" if at < FIRST_M else "b" if at > LAST_M else "i" for at in places]
    begins = {"a": 0.0, "b": LAST_M, "i": FIRST_M}
    scans = [
        NodeScan(name, float(at - begins[name]), pose, points)
        for name, at, pose, points in zip(names, places, poses, hits, strict=True)
    ]
    rng = np.random.default_rng(3)
    scans += [
        NodeScan("up", float(y + 20.0), np.array([23.0, y, 0.5 * math.pi]), rng.uniform(-8.0, 8.0, (200, 2)))
        for y in range(-20, 20)
    ]
    nodes: list[Tunnel | Intersection] = [*tunnels, node]
    frames = {one.id: one.pose_map_node for one in nodes}
    landmarks = landmarks_of(scans, frames, {"a", "b", "up"}, LandmarkSettings())
    return KnownMap(topology, landmarks, known.known_map().sheets)


def _tunnel(name: str, line: FloatArray, ends: tuple[str, str]) -> Tunnel:
    way = line[1] - line[0]
    frame = np.array([*line[0], math.atan2(way[1], way[0])])
    return Tunnel(name, name.upper(), ends, line, np.full((len(line), 2), 2.0), frame)


class Passed(NamedTuple):
    """A drive: rows, true poses (N, 3), where along the drift (N,)."""

    rows: list[LocalizationRow]
    poses: FloatArray
    way_m: FloatArray

    @property
    def nodes(self) -> list[str]:
        """Nodes in order, each once."""
        named = [row.node for row in self.rows]
        return [one for k, one in enumerate(named) if k == 0 or one != named[k - 1]]

    def steps(self) -> FloatArray:
        """Return by how much each row's step differs from the true one, m; after the first metres."""
        said = np.array([[row.x_m, row.y_m] for row in self.rows])
        return np.linalg.norm(np.diff(said, axis=0) - np.diff(self.poses[:, :2], axis=0), axis=1)[75:]

    def errors(self) -> FloatArray:
        """Return errors (N, 3) in the machine's axes after the first metres."""
        said = [np.array([row.x_m, row.y_m, row.yaw_rad]) for row in self.rows]
        return np.array([se2.between(pose, one) for pose, one in zip(self.poses, said, strict=True)])[75:]


@functools.cache
def passed(legs: tuple[tuple[float, float], ...], method: str = "surface", *, back: bool = False) -> Passed:
    """Drive along legs (from, to) of the drift, one after the other, facing its end or `back` to its start."""
    parts = [np.full(25, legs[0][0])]
    for start, end in legs:
        count = round(abs(end - start) / SPEED_MPS * RATE_HZ)
        parts.append(start + (end - start) * (0.5 - 0.5 * np.cos(np.linspace(0.0, math.pi, count))))
    way = np.concatenate(parts)
    poses = known.poses_at(way) + np.array([0.0, 0.0, math.pi if back else 0.0])
    scans = simulate_scans(known.world(), poses, PlanarScanner(), RATE_HZ, 3)
    messages: list[tuple[str, Message]] = [("front", scan) for scan in scans]
    messages += wheels_of("tachometer", poses, [scan.stamp_ns for scan in scans])
    messages.sort(key=lambda one: one[1].stamp_ns)
    settings = settings_from({"localization.method": method})
    with Localizer(parted_map(), settings, None, np.array([*poses[0], 0.0])) as localizer:
        localizer.update("tf_static", Mount(0, "base_link", "laser", np.eye(4)))
        for role, message in messages:
            localizer.update(role, message)
        localizer.finish()
    return Passed(localizer.rows, poses, way)


@pytest.mark.parametrize(
    ("legs", "back", "nodes"),
    [
        (FORTH, False, ["a", "i", "b"]),
        (tuple((50.0 - a + 0.0, 50.0 - b) for a, b in FORTH), True, ["b", "i", "a"]),
        (FORTH_AND_BACK, False, ["a", "i", "b", "i", "a"]),
        (INVERSION, False, ["a", "i", "a"]),
        (HALF_WAY, False, ["a", "i", "a", "i", "b"]),
    ],
    ids=[
        "forwards",
        "the other direction",
        "and back in reverse",
        "inversion in the intersection",
        "out again half-way",
    ],
)
def test_nodes_change_and_the_pose_does_not_jump(
    legs: tuple[tuple[float, float], ...], back: bool, nodes: list[str]
) -> None:
    drive = passed(legs, back=back)
    assert {row.status for row in drive.rows} == {TRACKING}
    assert drive.nodes == nodes
    assert drive.steps().max() < 0.02
    errors = np.abs(drive.errors())
    assert errors[:, :2].max() < 0.04
    assert errors[:, 2].max() < math.radians(0.4)


def test_places_in_the_nodes_follow_the_way() -> None:
    drive = passed(FORTH)
    for row, way in zip(drive.rows[75:], drive.way_m[75:], strict=True):
        if row.node == "i":
            assert abs(row.rho_m) <= 0.5 * (LAST_M - FIRST_M) + 0.6  # in an intersection: x in its frame
        else:
            assert row.rho_m == pytest.approx(way - (LAST_M if row.node == "b" else 0.0), abs=0.1)
        assert abs(row.z_m) < 0.5


def test_another_level_above_is_never_entered() -> None:
    assert "up" not in passed(FORTH_AND_BACK).nodes


@pytest.mark.parametrize("legs", [FORTH_AND_BACK, INVERSION], ids=["there and back", "inversion"])
def test_the_papers_method_hands_over_too(legs: tuple[tuple[float, float], ...]) -> None:
    """Section 3.3.3: the pose is transferred, so that it changes at a boundary by no more than a match may move it."""
    drive = passed(legs, "paper")
    named = [row.node for row in drive.rows]
    assert named[0] == named[-1] == "a"
    assert "i" in named
    assert {row.source for row in drive.rows} >= {"landmarks", ""}
    changes = [k for k in range(76, len(named)) if named[k] != named[k - 1]]
    steps = drive.steps()
    assert all(steps[k - 76] < 0.25 for k in changes)
    assert np.abs(drive.errors()[-25:, 0]).max() < 0.4


def test_a_row_is_the_same_whichever_name_the_nodes_have() -> None:
    """A hand-over is a change of name alone: in one piece the drift gives the same poses."""
    parted, whole = passed(FORTH), _in_one_piece()
    for one, other in zip(parted.rows[75:], whole[75:], strict=True):
        assert math.hypot(one.x_m - other.x_m, one.y_m - other.y_m) < 0.01


def _in_one_piece() -> list[LocalizationRow]:
    drive = passed(FORTH)
    scans = simulate_scans(known.world(), drive.poses, PlanarScanner(), RATE_HZ, 3)
    messages: list[tuple[str, Message]] = [("front", scan) for scan in scans]
    messages += wheels_of("tachometer", drive.poses, [scan.stamp_ns for scan in scans])
    messages.sort(key=lambda one: one[1].stamp_ns)
    whole = replace(known.known_map().topology, waypoints=())
    known_map = KnownMap(whole, known.known_map().landmarks, known.known_map().sheets)
    with Localizer(known_map, settings_from({}), None, np.array([*drive.poses[0], 0.0])) as localizer:
        localizer.update("tf_static", Mount(0, "base_link", "laser", np.eye(4)))
        for role, message in messages:
            localizer.update(role, message)
        localizer.finish()
    return localizer.rows

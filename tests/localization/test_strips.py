"""Strips of a map with an intersection: two straight drifts that meet one from the side, walls known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.landmarks.model import Landmarks, NodeSurface
from lhdmap.landmarks.quality import UNMEASURED
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.landmarks.surface import fused
from lhdmap.localization.strips import Strips, strips_of
from lhdmap.messages import FloatArray
from lhdmap.topology.model import UNEXPLORED, AccessPoint, Intersection, TopologicalMap, Tunnel

HALF_M, MOUTH_M, LENGTH_M = 2.0, 5.0, 40.0
ARMS = {"west": math.pi, "east": 0.0, "north": 0.5 * math.pi}


def _at(direction: float, along_m: FloatArray, lateral_m: float) -> FloatArray:
    c, s = math.cos(direction), math.sin(direction)
    return np.column_stack([c * along_m - s * lateral_m, s * along_m + c * lateral_m])


def strips(chi2: float = math.nan) -> Strips:
    tunnels, points, surfaces = [], [], {}
    for name, direction in ARMS.items():
        line = _at(direction, np.arange(MOUTH_M, LENGTH_M + 0.1, 1.0), 0.0)
        flat = np.column_stack([line, np.zeros(len(line))])
        frame = np.array([*flat[0], 0.0])
        half = np.full((len(line), 2), HALF_M)
        tunnels.append(Tunnel(name, name, ("x", UNEXPLORED), flat, half, frame))
        points.append(AccessPoint(f"{name}.t", name, np.array([*flat[0], direction + math.pi]), f"{name}.x"))
        points.append(AccessPoint(f"{name}.x", "x", np.array([*flat[0], direction]), f"{name}.t"))
        walls = [_at(direction, np.arange(MOUTH_M, LENGTH_M, 0.05), side * HALF_M) - frame[:2] for side in (1, -1)]
        surfaces[name] = NodeSurface(fused(walls, 0.05), UNMEASURED._replace(chi2=chi2), None)
    x = np.arange(-MOUTH_M, MOUTH_M, 0.05)
    beside = np.abs(x) >= HALF_M
    inner = [
        np.column_stack([x, np.full(len(x), -HALF_M)]),
        np.column_stack([x[beside], np.full(beside.sum(), HALF_M)]),
    ]
    inner += [_at(0.5 * math.pi, np.arange(HALF_M, MOUTH_M, 0.05), side * HALF_M) for side in (1, -1)]
    surfaces["x"] = NodeSurface(fused(inner, 0.05), UNMEASURED, None)
    middle = Intersection("x", "x", 3, np.zeros(4), np.zeros((0, 2)))
    none = np.zeros(0)
    landmarks = Landmarks(
        np.zeros((0, 2), np.float32), np.zeros(1, np.int64), np.zeros((0, 3)), np.zeros(0, np.str_), none, none, none,
        np.zeros(0, np.int32), np.zeros(0, np.bool_), {}, surfaces,
    )  # fmt: skip
    topology = TopologicalMap(tuple(tunnels), (middle,), tuple(points))
    return strips_of(topology, landmarks, LandmarkSettings())


def test_there_is_a_strip_for_each_tunnel_and_pair_of_arms_in_both_directions() -> None:
    made = strips()
    assert sorted(made.nodes) == sorted(2 * [*ARMS, "x", "x", "x"])
    assert made.values.shape == (3, len(made.poses))
    assert made.noise == 1.0


def test_a_way_runs_on_through_the_intersection() -> None:
    made = strips()
    for s in range(len(made.nodes)):
        for before in made.before[made.before_starts[s] : made.before_starts[s + 1]]:
            last, first = made.poses[made.starts[before + 1] - 1], made.poses[made.starts[s]]
            assert math.dist(last[:2], first[:2]) < 0.3
            assert abs(math.remainder(last[2] - first[2], 2.0 * math.pi)) < 0.1
    into: dict[str, list[int]] = {name: [] for name in ("x", *ARMS)}
    for s, name in enumerate(made.nodes):
        into[name].append(int(made.before_starts[s + 1] - made.before_starts[s]))
    assert sorted(into["x"]) == [1] * 6
    assert all(sorted(into[arm]) == [0, 2] for arm in ARMS)  # from outside; from the intersection's two other arms


def test_walls_and_directions() -> None:
    made = strips()
    own = [slice(made.starts[s], made.starts[s + 1]) for s, name in enumerate(made.nodes) if name == "east"]
    assert len(own) == 2
    for rows in own:
        known = made.known[:2, rows].all(axis=0)
        assert made.values[:2, rows][:, known] == pytest.approx(HALF_M, abs=0.03)
    headings = [float(np.median(made.poses[rows, 2])) for rows in own]
    assert abs(math.remainder(headings[0] - headings[1], 2.0 * math.pi)) == pytest.approx(math.pi, abs=0.01)
    assert made.node_at(int(made.starts[1])) == made.nodes[1]


def test_noise_is_what_the_map_tells_of_its_own_scans() -> None:
    assert strips(0.2).noise == pytest.approx(0.4)
    assert strips(0.001).noise == pytest.approx(0.1)
    quiet, loud = strips(0.2), strips(2.0)
    assert (quiet.variances[:2] <= loud.variances[:2]).all()
    assert (quiet.evidence[:2] >= loud.evidence[:2]).all()


def test_a_map_without_walls_has_none() -> None:
    none = np.zeros(0)
    empty = Landmarks(
        np.zeros((0, 2), np.float32), np.zeros(1, np.int64), np.zeros((0, 3)), np.zeros(0, np.str_), none, none, none,
        np.zeros(0, np.int32), np.zeros(0, np.bool_),
    )  # fmt: skip
    assert strips_of(TopologicalMap(), empty, LandmarkSettings()).values.shape == (3, 0)

"""Where a drive begins, where that is known roughly: in a node, or about a place. The best of many poses, by the first scan."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.matching import Hits, Prior, match
from lhdmap.scan_matching.submap import OTHER_VISIT
from lhdmap.topology.lookup import each_metre
from lhdmap.topology.model import Point, TopologicalMap, Tunnel

_HEADINGS = 8  # of an intersection
_FEW_HITS, _HITS = 150, 500
_FINER = 4  # of the best are matched anew, with more hits
_ABOUT_M = 6.0
_ALONG_M, _ALONG_STEP_M = 4.0, 0.8
_TURNS_RAD = tuple(math.radians(turn) for turn in (0.0, -12.0, 12.0, -24.0, 24.0))
_STD = np.array([0.6, 0.6, math.radians(6.0)])  # poses are a metre apart, and a machine need not stand in the middle
_KAPPA = 10.0  # hits that are neighbours share the map's errors
_SAME_M, _SAME_RAD = 1.5, math.radians(30.0)


class BestStart(NamedTuple):
    """The best pose (3,) and floor height; `support`: share of hits that agree, `rival`: that of the best other place."""

    pose: FloatArray
    height_m: float
    support: float
    rival: float


def poses_in(topology: TopologicalMap, node: str) -> FloatArray:
    """Return poses (K, 4: x, y, yaw, z) in a node (id): each metre of a tunnel both ways, all round in an intersection."""
    found = topology.nodes[node]
    if isinstance(found, Tunnel):
        line = each_metre(found.line_m)
        way = np.gradient(line[:, :2], axis=0)
        yaw = np.arctan2(way[:, 1], way[:, 0])
        one_way = np.column_stack([line[:, :2], yaw, line[:, 2]])
        return np.concatenate([one_way, one_way + np.array([0.0, 0.0, math.pi, 0.0])])
    middle = found.pose_map_node
    places = np.vstack([middle[None, :3], *(point.pose[None, :3] for point in topology.points_of(node))])
    yaws = middle[3] + 2.0 * math.pi * np.arange(_HEADINGS) / _HEADINGS
    return np.array([[x, y, yaw, z] for x, y, z in places.tolist() for yaw in yaws.tolist()])


def poses_about(topology: TopologicalMap, point: Point) -> FloatArray:
    """Return the poses (K, 4) in a point's node that are near it: a machine has stood there, perhaps facing the other way."""
    poses = poses_in(topology, point.node)
    near = np.hypot(*(poses[:, :2] - point.pose[:2]).T) < _ABOUT_M
    about: FloatArray = poses[near]
    return about


def poses_anywhere(topology: TopologicalMap) -> FloatArray:
    """Return poses (K, 4) in all nodes of a map."""
    return np.concatenate([np.zeros((0, 4)), *(poses_in(topology, node) for node in topology.nodes)])


def poses_along(pose: FloatArray, height_m: float) -> FloatArray:
    """Return poses (K, 4) before and behind a pose (3,), in its direction and turned: a blind machine may have been in a bend."""
    way = np.arange(-_ALONG_M, _ALONG_M + 0.1, _ALONG_STEP_M)
    poses = []
    for turn in _TURNS_RAD:
        x, y = pose[0] + way * math.cos(pose[2] + 0.5 * turn), pose[1] + way * math.sin(pose[2] + 0.5 * turn)
        poses.append(np.column_stack([x, y, np.full_like(way, pose[2] + turn), np.full_like(way, height_m)]))
    return np.concatenate(poses)


def poses_round(pose: FloatArray, height_m: float, far_m: float) -> FloatArray:
    """Return poses (K, 4) all round a pose (3,), up to `far_m` to each side, about in its direction: where odometry has led to."""
    steps = math.ceil(far_m / _ALONG_STEP_M)
    way = _ALONG_STEP_M * np.arange(-steps, steps + 1)
    x, y, turn = np.meshgrid(way, way, np.array(_TURNS_RAD[:3]), indexing="ij")
    shifted = [pose[0] + x.ravel(), pose[1] + y.ravel(), pose[2] + turn.ravel()]
    return np.column_stack([*shifted, np.full(x.size, height_m)])


def best_start(walls: MapWalls, starts: FloatArray, points: FloatArray) -> BestStart:
    """Return the start of several (K, 4) from which hits (N, 2) in the machine's frame fit the walls best."""
    few, many = (points[:: max(len(points) // most, 1)] for most in (_FEW_HITS, _HITS))
    found = [(*_matched(walls, one, few, _STD), float(one[3])) for one in starts]
    found.sort(key=lambda one: -one[1])
    finer = [_finer(walls, one, many) for one in found[:_FINER]]
    pose, support, height = max(finer, key=lambda one: one[1])
    others = [one[1] for one in (*finer, *found[_FINER:]) if _apart(one[0], pose)]
    return BestStart(pose, height, support, max(others, default=0.0))


_Place = tuple[FloatArray, float, float]  # pose (3,), support, height of the floor


def _finer(walls: MapWalls, place: _Place, points: FloatArray) -> _Place:
    """Return a place matched anew with more hits, little held by where it was."""
    pose, _, height = place
    for _ in range(2):
        pose, support = _matched(walls, np.append(pose, height), points, 4.0 * _STD)
    return pose, support, height


def _matched(walls: MapWalls, start: FloatArray, points: FloatArray, std: FloatArray) -> tuple[FloatArray, float]:
    """Return the pose (3,) that a start (4,) leads to, and the share of its hits that agree."""
    around, origin = walls.around(start[[0, 1, 3]])
    shift = np.array([origin[0], origin[1], 0.0])
    hits = Hits(np.column_stack([points, np.zeros(len(points))]), len(points), layered=False)
    prior = Prior(start[:3] - shift, np.diag(_KAPPA / std**2))
    found = match(around, hits, prior, start[:3] - shift, OTHER_VISIT)
    return found.pose + shift, float(found.support)


def _apart(one: FloatArray, other: FloatArray) -> bool:
    off = se2.between(one, other)
    return math.hypot(off[0], off[1]) > _SAME_M or abs(math.remainder(float(off[2]), 2.0 * math.pi)) > _SAME_RAD

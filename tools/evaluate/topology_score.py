"""A topological map against the truth: intersections, degrees, tunnels and names, and how far access points are off."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from lhdmap.messages import FloatArray
from lhdmap.topology.build import Seen
from lhdmap.topology.model import Intersection, TopologicalMap
from scipy.optimize import linear_sum_assignment

_NEAR_M = 5.0


class Placement(NamedTuple):
    """From the truth's grid to the map: rotation (2, 2), shift (2,), rise."""

    R: FloatArray
    shift_m: FloatArray
    rise_m: float

    def point(self, position: Sequence[float]) -> FloatArray:
        """Return a true position (2 or 3) in the map, (3,)."""
        x, y = self.R @ np.asarray(position[:2]) + self.shift_m
        return np.array([x, y, (position[2] if len(position) > 2 else 0.0) + self.rise_m])

    @property
    def turn_rad(self) -> float:
        """Angle of the rotation."""
        return math.atan2(self.R[1, 0], self.R[0, 0])


SAME = Placement(np.eye(2), np.zeros(2), 0.0)


class Score(NamedTuple):
    """Counts of intersections and tunnels, and the errors of all access points: `in_map_m`, `in_node_m`, `heading_deg`."""

    nodes: int
    found: int
    extra: int
    degrees: int
    edges: int
    missing: list[tuple[str, ...]]
    surplus: list[tuple[str, ...]]
    names: int
    in_map_m: FloatArray
    in_node_m: FloatArray
    heading_deg: FloatArray
    worst: str

    @property
    def right(self) -> bool:
        """Whether all intersections, degrees and tunnels are right and none is too many."""
        return self.found == self.degrees == self.nodes and not (self.extra or self.missing or self.surplus)


def rigid(of: FloatArray, onto: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return rotation (2, 2) and shift (2,) that take points (N, 2) onto others best."""
    a, b = of.mean(axis=0), onto.mean(axis=0)
    U, _, Vt = np.linalg.svd((of - a).T @ (onto - b))
    R = Vt.T @ np.diag([1.0, np.linalg.det(Vt.T @ U.T)]) @ U.T
    return R, b - R @ a


def placed(true: Seen, own: Seen) -> Placement:
    """Return where the truth lies in a map of own poses: the true path fitted onto the own one."""
    along = [np.interp(own.path_ns.astype(float), true.path_ns.astype(float), true.path[:, k]) for k in range(3)]
    R, shift = rigid(np.column_stack(along[:2]), own.path[:, :2])
    return Placement(R, shift, float(np.median(own.path[:, 2] - along[2])))


def score(found: TopologicalMap, truth: Mapping[str, Any], placement: Placement = SAME) -> Score:
    """Return how a map compares with the true topology of its plan (`.topology.json`)."""
    pairs = _pairs(found, truth, placement)
    named = {found.intersections[k].id: truth["intersections"][i]["name"] for k, i in pairs.items()}
    wanted = Counter(_ends(one["ends"]) for one in truth["tunnels"])
    there = Counter(_ends([named.get(end, end) for end in one.ends]) for one in found.tunnels)
    rows = [
        row
        for k, i in pairs.items()
        for row in _access(found, found.intersections[k], truth["intersections"][i], placement)
    ]
    errors = np.array([row[:3] for row in rows]).reshape(-1, 3)
    last = max(rows, key=lambda row: row[0], default=(0.0, 0.0, 0.0, ""))
    return Score(
        len(truth["intersections"]),
        len(pairs),
        len(found.intersections) - len(pairs),
        sum(found.intersections[k].degree == truth["intersections"][i]["degree"] for k, i in pairs.items()),
        sum(wanted.values()),
        list((wanted - there).elements()),
        list((there - wanted).elements()),
        sum(found.intersections[k].name == truth["intersections"][i]["name"] for k, i in pairs.items()),
        errors[:, 0],
        errors[:, 1],
        errors[:, 2],
        last[3],
    )


def _pairs(found: TopologicalMap, truth: Mapping[str, Any], placement: Placement) -> dict[int, int]:
    """Return the true intersection of each one found, by numbers."""
    nodes = truth["intersections"]
    if not nodes or not found.intersections:
        return {}
    true = np.array([placement.point(node["position"]) for node in nodes])
    there = np.array([node.pose_map_node[:3] for node in found.intersections])
    apart = np.linalg.norm((true[:, None] - there[None]) * [1.0, 1.0, 2.0], axis=2)
    rows, columns = linear_sum_assignment(apart)
    return {int(k): int(i) for i, k in zip(rows, columns, strict=True) if apart[i, k] < _NEAR_M}


def _ends(ends: Sequence[str]) -> tuple[str, ...]:
    return tuple(sorted("end" if end in ("dead_end", "unexplored", "closed") else end for end in ends))


def _access(
    found: TopologicalMap, node: Intersection, true: Mapping[str, Any], placement: Placement
) -> list[tuple[float, float, float, str]]:
    """Return for each true access point of a node: error in the map (m), in the node's frame (m), heading (deg), which it is."""
    own = [point for point in found.access_points if point.node == node.id]
    shift = node.pose_map_node[:2] - placement.point(true["position"])[:2]
    rows = []
    for one in true["access_points"] if own else []:
        place, heading = placement.point(one["position"])[:2], math.radians(one["heading_deg"]) + placement.turn_rad
        best = max(own, key=lambda point: math.cos(point.pose[3] - heading))
        off = best.pose[:2] - place
        turned = abs(math.degrees(math.remainder(best.pose[3] - heading, 2.0 * math.pi)))
        name = f"{true['name']} {one['drift']}"
        rows.append((float(np.linalg.norm(off)), float(np.linalg.norm(off - shift)), turned, name))
    return rows

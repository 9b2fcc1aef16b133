"""Do the links touch anything on the way? Capsules around boom, outer boom and breaker, swept along the path.

Conservative: between two positions of a link, and between two points of its axis, half a step is added to its radius.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.corridor import Refusal
from lhdmap.rockbreaker.machine import JOINTS, Rockbreaker
from lhdmap.rockbreaker.paths import Path

_STEP_M = 0.04  # way of the tip between two positions that are checked
_MOST_STEPS = 600
_SPACING_M = 0.1  # of the points along a link
_FAR_M = 1.0  # distances beyond it are not told apart, nor beyond half of it more than a link's radius
_CUBE_M = 0.1
_SKIN_M = 0.05  # around the arm where it stands: what a cloud shows there is the arm itself


@dataclass(frozen=True, slots=True)
class Contact:
    """Least clearance along a path, metres, and why the path is refused, if it is."""

    clearance_m: float = math.inf
    refusal: Refusal | None = None


@dataclass(frozen=True)
class Obstacles:
    """Boxes (K, 2, 3) with their names, and points (N, 3) of walls and grizzly, all in the base's frame, metres."""

    boxes_m: FloatArray | None = None
    names: tuple[str, ...] = ()
    points_m: FloatArray | None = None

    @cached_property
    def _trees(self) -> tuple[Any, Any]:
        """All points, and one in each small cube: most of the links is far from everything, and told so by few points."""
        from scipy.spatial import cKDTree

        points = np.zeros((0, 3)) if self.points_m is None else self.points_m
        _, first = np.unique(np.floor(points / _CUBE_M).astype(np.int64), axis=0, return_index=True)
        return cKDTree(points), cKDTree(points[first])

    @property
    def none(self) -> bool:
        """Whether there is nothing to touch."""
        return (self.boxes_m is None or not len(self.boxes_m)) and (self.points_m is None or not len(self.points_m))

    def first_contact(self, path: Path) -> Contact:
        """Return the least clearance of the links along the path, and where they first touch something."""
        if self.none:
            return Contact()
        sigma, half_step_m = _steps(path)
        axis_m, link = axis_points(path.machine, path.theta(sigma))
        radius = np.hypot(path.machine.per_joint("radius_m")[link], 0.5 * _SPACING_M)
        distance_m, names = self._distances(axis_m, float(radius.max()) + half_step_m)
        clearance_m = distance_m - radius - half_step_m
        worst = np.min(clearance_m, axis=1)
        if (worst >= 0.0).all():
            return Contact(float(worst.min()))
        step = int(np.argmax(worst < 0.0))
        point = int(np.argmin(clearance_m[step]))
        name = JOINTS[link[point]].replace("_", " ")
        text = (
            f"the {name} comes within {max(distance_m[step, point] - radius[point], 0.0):.2f} m of {names[step, point]}"
        )
        return Contact(float(worst.min()), Refusal("obstacle", text, float(sigma[step])))

    def _distances(self, axis_m: FloatArray, near_m: float) -> tuple[FloatArray, Any]:
        """Return the distance of each point of the links (T, P, 3) to the nearest obstacle (T, P), and its name.

        Distances to points are exact below `near_m`, above it up to the diagonal of a cube too large.
        """
        far_m = max(_FAR_M, near_m + 0.5 * _FAR_M)
        distance_m = np.full(axis_m.shape[:2], far_m)
        names = np.full(axis_m.shape[:2], "the cloud", dtype=object)
        if self.points_m is not None and len(self.points_m):
            distance_m = np.minimum(self._trees[1].query(axis_m, distance_upper_bound=far_m)[0], far_m)
            near = distance_m < near_m + math.sqrt(3.0) * _CUBE_M
            distance_m[near] = self._trees[0].query(axis_m[near])[0]
        for box, name in zip(self.boxes_m if self.boxes_m is not None else (), self.names, strict=True):
            outside = np.maximum(np.maximum(box[0] - axis_m, axis_m - box[1]), 0.0)
            to_box_m = np.linalg.norm(outside, axis=-1)
            names[to_box_m < distance_m] = f"box '{name}'"
            distance_m = np.minimum(distance_m, to_box_m)
        return distance_m, names


def _steps(path: Path) -> tuple[FloatArray, float]:
    """Return σ (T,) at which the links are checked, and half the longest way of a point of them between two of those."""
    coarse = path.tip(np.linspace(0.0, 1.0, 101))
    length_m = float(np.linalg.norm(np.diff(coarse, axis=0), axis=1).sum())
    sigma = np.linspace(0.0, 1.0, min(max(math.ceil(length_m / _STEP_M), 24), _MOST_STEPS) + 1)
    axis_m, _ = axis_points(path.machine, path.theta(sigma))
    return sigma, 0.5 * float(np.linalg.norm(np.diff(axis_m, axis=0), axis=-1).max())


def without_arm(machine: Rockbreaker, points_m: FloatArray, theta: FloatArray) -> FloatArray:
    """Return the points of a cloud (N, 3) that are not of the machine's own arm as it stands at joints θ (4,); NaN: all."""
    from scipy.spatial import cKDTree

    if np.isnan(theta).any():
        return points_m
    axis_m, link = axis_points(machine, theta[None])
    own = np.zeros(len(points_m), dtype=bool)
    for joint in (1, 2, 3):
        within_m = math.hypot(machine.joints[joint].radius_m + _SKIN_M, 0.5 * _SPACING_M)
        distance_m, _ = cKDTree(axis_m[0, link == joint]).query(points_m, distance_upper_bound=within_m)
        own |= np.isfinite(distance_m)
    return points_m[~own]


def joint_positions(machine: Rockbreaker, theta: FloatArray) -> FloatArray:
    """Return R2, R3, R4 and P (T, 4, 3) of θ (T, 4), metres."""
    angles = np.cumsum(theta[:, 1:], axis=1)
    steps = machine.links_m[1:] * np.stack([np.cos(angles), np.sin(angles)])
    along = machine.links_m[0] + np.concatenate([np.zeros((len(theta), 1)), np.cumsum(steps[0], axis=1)], axis=1)
    up = machine.base.height_m + np.concatenate([np.zeros((len(theta), 1)), np.cumsum(steps[1], axis=1)], axis=1)
    swing = theta[:, :1]
    return np.stack([along * np.cos(swing), along * np.sin(swing), up], axis=-1)


def axis_points(machine: Rockbreaker, theta: FloatArray) -> tuple[FloatArray, Any]:
    """Return points on the axes of the three links (T, P, 3), and which joint (P,) carries each.

    The breaker's end before its tip by its radius, so that the capsule's cap ends at the tip.
    """
    joints_m = joint_positions(machine, theta)
    parts, links = [], []
    for link in (1, 2, 3):
        used = 1.0 - (machine.joints[3].radius_m / machine.links_m[3] if link == 3 else 0.0)
        share = np.linspace(0.0, max(used, 0.0), max(math.ceil(machine.links_m[link] / _SPACING_M), 1) + 1)[:, None]
        start, end = joints_m[:, None, link - 1], joints_m[:, None, link]
        parts.append(start + share * (end - start))
        links += [link] * len(share)
    return np.concatenate(parts, axis=1), np.array(links)

"""How far the corner between two arms is rounded off, so that a machine can turn there.

Walls that meet at an angle φ are rounded by a circle of radius ρ that touches both: it begins ρ / tan(φ/2) beyond their corner. A
point of the rock between them, at a distance r of the corner and an angle θ from the bisector, is cut away by all radii from

    ρ* = r (cos θ + √(cos² θ - cos² (φ/2))) sin (φ/2) / cos² (φ/2)

on. The radius found is the one that calls the fewest points wrongly: free ones beyond it, and rock before it. It counts areas,
which rough walls change little, where a distance measured at one place depends on the one stone there.
"""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.topology.room import WALL_CELLS, Room

_STEP_M = 0.15
_LONGEST_M = 12.0  # from the corner to where the rounding begins
_WIDEST_RADIUS_M = 9.0  # loaders turn in less
_LEAST_M2, _ROUGH = 0.1, 0.7  # of rock cut away; and for each metre as much as the walls are rough: less is roughness
_WIDEST_RAD = math.radians(150.0)  # walls so nearly straight have no corner that could be rounded


def rounding_m(corner_m: FloatArray, along: FloatArray, other: FloatArray, rough_m: float, room: Room) -> float:
    """Return how far beyond a corner (2,) its rounding begins, along the walls in the directions `along` and `other` (2,).

    `rough_m`: standard deviation of the walls.
    """
    angle = float(np.arccos(np.clip(along @ other, -1.0, 1.0)))
    if angle > _WIDEST_RAD:
        return 0.0
    points, radii = _between(corner_m, along, other, angle)
    bisector = (along + other) / np.linalg.norm(along + other)
    free = room.holds(points - WALL_CELLS * room.sheet.cell_m / math.sin(0.5 * angle) * bisector)
    order = np.argsort(radii)
    begins = radii[order] / math.tan(0.5 * angle)
    gain_m2 = _STEP_M**2 * np.cumsum(np.where(free[order], 1.0, -1.0)) - _ROUGH * rough_m * begins
    best = int(gain_m2.argmax())
    return float(begins[best]) if gain_m2[best] > _LEAST_M2 else 0.0


def _between(corner_m: FloatArray, along: FloatArray, other: FloatArray, angle: float) -> tuple[FloatArray, FloatArray]:
    """Return points (N, 2) between two walls, and for each the least radius (N,) of a rounding that cuts it away."""
    half = 0.5 * angle
    at = np.arange(0.5 * _STEP_M, _LONGEST_M, _STEP_M)
    u, v = (grid.ravel() for grid in np.meshgrid(at, at))
    points = corner_m + u[:, None] * along + v[:, None] * other
    away = points - corner_m
    bisector = along + other
    bisector = bisector / np.linalg.norm(bisector)
    r = np.linalg.norm(away, axis=1)
    cosine = away @ bisector / r
    root = np.sqrt(np.maximum(cosine**2 - math.cos(half) ** 2, 0.0))
    radii = r * (cosine + root) * math.sin(half) / math.cos(half) ** 2
    near = radii <= min(_LONGEST_M * math.tan(half), _WIDEST_RADIUS_M)
    return points[near], radii[near]

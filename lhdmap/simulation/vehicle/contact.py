"""Contact of a machine's bodies with the world: boxes against the triangles of walls, roof and what stands in the way.

Floors are what wheels stand on and do not count. A body that is between two steps of 10 ms cannot pass a wall: it moves by
less than 7 cm, and boxes are filled.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.simulation.vehicle.bodies import Boxes
from lhdmap.simulation.vehicle.contact_grid import Grid, build_grid
from lhdmap.simulation.vehicle.contact_kernel import clearance, deepest, near_pieces

_FLOOR_UPRIGHT = math.cos(math.radians(45.0))

Bools = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.integer]


class BodyContact(NamedTuple):
    """A body that touches: its name, the point of the world that is deepest in it (3,) in `map`, and how deep, m."""

    body: str
    point_m: FloatArray
    depth_m: float


def is_flat(vertices_m: FloatArray, triangles: Indices) -> Bools:
    """Return which triangles lie flatter than 45 degrees, shape (M,): those that may be a floor (or a roof)."""
    a, b, c = (np.asarray(vertices_m, dtype=float)[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    return np.abs(normal[:, 2]) >= _FLOOR_UPRIGHT * np.linalg.norm(normal, axis=1)


class ContactPiece:
    """A piece of the world's surface, ready to be touched."""

    def __init__(self, vertices_m: FloatArray, triangles: Indices, floor: Bools | None = None) -> None:
        """Take vertices (N, 3) in `map` and triangles (M, 3).

        `floor` (M,) says which triangles belong to the floor: those of them that are flatter than 45 degrees do not count.
        """
        vertices = np.asarray(vertices_m, dtype=float)
        if floor is not None and len(triangles):
            triangles = triangles[~(floor & is_flat(vertices, triangles))]
        self.grid: Grid = build_grid(vertices[triangles])

    @property
    def bounds_m(self) -> FloatArray:
        """Lower and upper corner in `map`, shape (2, 3)."""
        return self.grid.bounds_m


class Contacts:
    """Pieces of a world; only those near the machine are looked at."""

    def __init__(self, pieces: Iterable[ContactPiece]) -> None:
        self._grids = [piece.grid for piece in pieces if len(piece.grid.spheres)]
        self._bounds = np.array([grid.bounds_m for grid in self._grids]).reshape(-1, 2, 3)

    def touching(self, boxes: Boxes) -> list[BodyContact]:
        """Return each body that touches something, where it does so most."""
        found = np.full((len(boxes.names), 4), -1.0)
        for k in near_pieces(self._bounds, boxes.centre_m, boxes.axes, boxes.half_m, 0.0):
            deepest(self._grids[k], boxes.centre_m, boxes.axes, boxes.half_m, found)
        return [
            BodyContact(name, row[:3].copy(), float(row[3]))
            for name, row in zip(boxes.names, found, strict=True)
            if row[3] >= 0.0
        ]

    def clearance_m(self, boxes: Boxes, limit_m: float = 1.0) -> float:
        """Return the least distance of a body from anything, `limit_m` where that is more; 0 where it touches."""
        least = limit_m
        for k in near_pieces(self._bounds, boxes.centre_m, boxes.axes, boxes.half_m, limit_m):
            least = clearance(self._grids[k], boxes.centre_m, boxes.axes, boxes.half_m, least)
        return float(least)

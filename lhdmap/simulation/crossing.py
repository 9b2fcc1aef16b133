"""Drifts that open into the main one: the union of their volumes, so that rays pass from one into the other.

Of each drift's surface the triangles inside the other are left out; those on the seam stay, so that it has no gaps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import UsageError
from lhdmap.messages import FloatArray
from lhdmap.mine.centre_line import Start, centre_line
from lhdmap.settings import figure
from lhdmap.simulation.drift import Drift, Mesh
from lhdmap.simulation.raycast import Surface

_REACH_M = 16.0  # the main drift this far from the opening takes part in the union
_FLOOR_M = 4.0  # so far along the main drift its floor counts
_SILL_M = 0.15  # the side drift's floor lies above the main one's, so that the machine's way stays as it was


class Side(NamedTuple):
    """A drift that opens into the main one at arc length `at_m`."""

    at_m: float
    drift: Drift


class Crossing:
    """The main drift with its side openings."""

    def __init__(self, main: Drift, sides: list[Side], *, planar: bool = False) -> None:
        """`planar`: all walls are upright and reach from floor to roof, so that one height decides what is inside."""
        self._main = main
        self._openings = [_Opening(main, side, planar=planar) for side in sides]

    def mesh(self, first: int, last: int) -> Mesh:
        """Mesh the rings `first` to `last` of the main drift with all that opens into them; its own ends are closed."""
        mesh = self.main_mesh(first, last)
        for opening in self._near(first, last):
            mesh = joined(mesh, opening.side_mesh())
        return mesh

    def pieces(self, rings: int) -> Iterator[Mesh]:
        """Yield the whole surface in pieces of at most so many rings, and each side drift as one."""
        for first in range(0, self._main.ring_count() - 1, rings):
            yield self.main_mesh(first, first + rings + 1)
        for opening in self._openings:
            yield opening.side_mesh()

    def main_mesh(self, first: int, last: int) -> Mesh:
        """Mesh the rings `first` to `last` (exclusive) of the main drift with its openings cut out."""
        mesh = self._main.mesh(first, last, closed=(first <= 0, last >= self._main.ring_count()))
        for opening in self._near(first, last):
            mesh = opening.cut(mesh)
        return mesh

    def _near(self, first: int, last: int) -> list[_Opening]:
        start_m, end_m = first * self._main.settings.mesh_m - _REACH_M, last * self._main.settings.mesh_m + _REACH_M
        return [opening for opening in self._openings if start_m <= opening.at_m <= end_m]


class _Opening:
    """One opening: the surface of the side drift outside the main one, and what it cuts out of the main one."""

    def __init__(self, main: Drift, side: Side, *, planar: bool) -> None:
        self.at_m, self._main, self._side, self._planar = side.at_m, main, side, planar
        self._side_volume: _Volume | None = None
        self._side_mesh: Mesh | None = None

    def cut(self, mesh: Mesh) -> Mesh:
        """Return the main drift's mesh without the triangles that lie inside the side drift."""
        if self._side_volume is None:
            self._side_volume = _Volume(self._side.drift.mesh(0, self._side.drift.ring_count(), closed=(True, True)))
        return _without(mesh, self._inside(self._side_volume, mesh.vertices_m))

    def side_mesh(self) -> Mesh:
        """Return the side drift's mesh without the triangles that lie inside the main drift."""
        if self._side_mesh is None:
            spacing = self._main.settings.mesh_m
            first, last = int((self.at_m - _REACH_M) / spacing), int((self.at_m + _REACH_M) / spacing)
            main_volume = _Volume(self._main.mesh(first, last, closed=(True, True)))
            mesh = self._side.drift.mesh(0, self._side.drift.ring_count(), closed=(True, True))
            self._side_mesh = _without(mesh, self._inside(main_volume, mesh.vertices_m))
        return self._side_mesh

    def _inside(self, volume: _Volume, points_m: FloatArray) -> npt.NDArray[np.bool_]:
        """Return which points, shape (N,), lie inside a closed mesh."""
        if self._planar:
            middle_m = float(self._main.line.z_m[0]) + 0.5 * self._main.settings.height_m
            points_m = np.column_stack([points_m[:, :2], np.full(len(points_m), middle_m)])
        return volume.holds(points_m)


class _Volume:
    """The inside of a closed mesh."""

    def __init__(self, mesh: Mesh) -> None:
        self._surface = Surface(mesh)
        self._low_m, self._high_m = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)

    def holds(self, points_m: FloatArray) -> npt.NDArray[np.bool_]:
        """Return which points, shape (N,), lie inside: a ray upwards crosses the surface an odd number of times."""
        result = np.zeros(len(points_m), dtype=bool)
        candidates = np.flatnonzero(((points_m > self._low_m) & (points_m < self._high_m)).all(axis=1))
        directions = np.broadcast_to(np.array([0.013, 0.007, 1.0]), (len(candidates), 3))
        rays = np.hstack([points_m[candidates] - self._surface.origin_m, directions]).astype(np.float32)
        result[candidates] = self._surface.crossings(rays) % 2 == 1
        return result


def _without(mesh: Mesh, inside: npt.NDArray[np.bool_]) -> Mesh:
    """Return the mesh without the triangles all of whose corners are inside."""
    return Mesh(mesh.vertices_m, mesh.triangles[~inside[mesh.triangles].all(axis=1)])


def joined(a: Mesh, b: Mesh) -> Mesh:
    """Return two meshes as one."""
    return Mesh(
        np.concatenate([a.vertices_m, b.vertices_m]),
        np.concatenate([a.triangles, (b.triangles.astype(np.int64) + len(a.vertices_m)).astype(np.uint32)]),
    )


def side_drift(
    main: Drift, opening: tuple[float, float, float], rng: np.random.Generator, *, planar: bool = False
) -> Side:
    """Return the level, straight drift of an `opening`: (arc length on the main drift m, angle deg, length m).

    Raises:
        UsageError: the main drift is not that long.
    """
    at_m, angle_deg, length_m = opening
    line = main.line
    x, y, z, heading = line.at(np.array([at_m]))[0]
    if not planar:
        floor_m = line.z_m[np.abs(line.s_m - at_m) < _FLOOR_M]
    if not len(floor_m):
        beyond_m = at_m - float(line.s_m[-1])
        raise UsageError(f"a cross drift lies {figure(beyond_m)} m beyond the end of the drift; name a place on it")
    z = float(floor_m.max()) + _SILL_M
    start = Start(float(x), float(y), float(z), float(heading) + math.radians(angle_deg))
    pieces = ((length_m + 1.0, 0.0, 0.0),)
    settings = replace(main.settings, pieces=pieces, cross_drifts=(), widenings=())
    return Side(at_m, Drift(settings, centre_line(pieces, length_m, 0.0, start), rng, planar=planar))

"""The skeleton of the free space's core as a multigraph: vertices where lines meet or end, edges as lines of points.

The core is the free space farther than a radius from the walls, united with a band around the driven line: a drift that was driven
exists, whatever the grid says of its width.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from scipy.ndimage import label

from lhdmap.messages import FloatArray
from lhdmap.topology.sheet import Sheet

Flags = npt.NDArray[np.bool_]
_BAND_M = 0.5  # around the driven line
_FEWEST_DRIVEN = 20  # poses in a piece of the core: fewer are the rest behind a barrier
_AROUND = [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)]


class Vertex(NamedTuple):
    """Where lines meet or end: place (2,) in `map` and free radius there, metres."""

    point_m: FloatArray
    radius_m: float


@dataclass(slots=True)
class Line:
    """An edge of the skeleton from vertex `start` to vertex `end`: points (N, 2) and free radius (N,) along it."""

    start: int
    end: int
    points_m: FloatArray
    radii_m: FloatArray

    @property
    def length_m(self) -> float:
        """Length along the points."""
        return float(np.linalg.norm(np.diff(self.points_m, axis=0), axis=1).sum())

    def leaving(self, vertex: int) -> Line:
        """Return the line in the direction away from a vertex at one of its ends."""
        return self if self.start == vertex else self.reversed()

    def reversed(self) -> Line:
        """Return the line from its end to its start."""
        return Line(self.end, self.start, self.points_m[::-1], self.radii_m[::-1])


@dataclass(slots=True)
class Skeleton:
    """A multigraph: `vertices` by number (numbers stay when others go), `lines` between them."""

    vertices: dict[int, Vertex] = field(default_factory=dict)
    lines: list[Line] = field(default_factory=list)

    def at(self, vertex: int) -> list[Line]:
        """Return the lines at a vertex; one that begins and ends there is in it twice."""
        ends = [line for line in self.lines if line.start == vertex]
        return ends + [line for line in self.lines if line.end == vertex]

    def degree(self, vertex: int) -> int:
        """Return how many ends of lines are at a vertex."""
        return len(self.at(vertex))

    def remove(self, line: Line) -> None:
        """Take out a line, and its ends where nothing is left at them."""
        self.lines = [one for one in self.lines if one is not line]
        for vertex in {line.start, line.end}:
            if not self.at(vertex):
                self.vertices.pop(vertex, None)

    def straighten(self) -> None:
        """Join the two lines at each vertex that has just two, but for a lone ring."""
        for vertex in list(self.vertices):
            lines = self.at(vertex)
            if len(lines) != 2 or lines[0] is lines[1]:
                continue
            first, second = lines[0].leaving(vertex).reversed(), lines[1].leaving(vertex)
            joined = Line(
                first.start,
                second.end,
                np.vstack([first.points_m, second.points_m]),
                np.concatenate([first.radii_m, second.radii_m]),
            )
            self.lines = [one for one in self.lines if one is not lines[0] and one is not lines[1]]
            self.lines.append(joined)
            del self.vertices[vertex]


def core_of(
    free: Flags, sheet: Sheet, driven_m: FloatArray, radius_m: float, barriers_m: Sequence[FloatArray] = ()
) -> tuple[Flags, npt.NDArray[np.float32]]:
    """Return the core of free cells and the distance of each cell from the walls (m).

    `driven_m` (N, 2): the way driven; `barriers_m`: lines (2, 2) that end the sheet.
    """
    band, pixels = band_of(sheet, driven_m, 2.0 * _BAND_M), sheet.at(driven_m)[:, ::-1]
    known = free | band
    distance_m = cv2.distanceTransform(known.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * sheet.cell_m
    core = ((distance_m > radius_m) | band).astype(np.uint8)
    for barrier in barriers_m:
        start, end = sheet.at(barrier)[:, ::-1].tolist()
        cv2.line(core, start, end, 0, 2)
    labels, _ = label(core, np.ones((3, 3)))
    driven = np.bincount(labels[pixels[:, 1], pixels[:, 0]], minlength=int(labels.max()) + 1)
    driven[0] = 0
    kept = np.flatnonzero(driven >= min(_FEWEST_DRIVEN, driven.max(initial=1)))
    return np.isin(labels, kept), distance_m


def band_of(sheet: Sheet, driven_m: FloatArray, width_m: float) -> Flags:
    """Return the cells of a sheet within a band of this width along a way (N, 2)."""
    band = np.zeros(sheet.cells.shape, np.uint8)
    pixels = sheet.at(driven_m)[:, ::-1].astype(np.int32)
    for start, end in pairwise(pixels):
        if np.abs(end - start).max() * sheet.cell_m < 3.0:  # else the machine was elsewhere in between
            cv2.line(band, start.tolist(), end.tolist(), 1, max(int(width_m / sheet.cell_m), 1))
    return band > 0


def skeleton_of(core: Flags, distance_m: npt.NDArray[np.float32], sheet: Sheet) -> Skeleton:
    """Return the skeleton of a core as a multigraph."""
    from skimage.morphology import skeletonize

    thin = skeletonize(core)  # type: ignore[no-untyped-call]
    rows, columns = np.nonzero(thin)
    if not len(rows):
        return Skeleton()
    number = np.full(np.array(thin.shape) + 2, -1)
    number[rows + 1, columns + 1] = np.arange(len(rows))
    neighbours = np.column_stack([number[rows + 1 + dy, columns + 1 + dx] for dy, dx in _AROUND])
    points = sheet.middles_m(np.column_stack([rows, columns]))
    return _traced(neighbours, points, distance_m[rows, columns].astype(float))


def _traced(neighbours: npt.NDArray[np.int64], points_m: FloatArray, radii_m: FloatArray) -> Skeleton:
    """Follow the pixels from vertex to vertex; `neighbours` (N, 8): numbers of the pixels around each, -1 for none."""
    lists = [[int(n) for n in row if n >= 0] for row in neighbours]
    special = np.array([len(row) != 2 for row in lists])
    cluster = _clusters(lists, special)
    found = Skeleton()
    for vertex in range(int(cluster.max(initial=-1)) + 1):
        members = np.flatnonzero(cluster == vertex)
        widest = members[int(radii_m[members].argmax())]
        found.vertices[vertex] = Vertex(points_m[members].mean(axis=0), float(radii_m[widest]))
    used = special.copy()
    for pixel in np.flatnonzero(special):
        for first in lists[pixel]:
            if not used[first]:
                _follow(int(pixel), first, lists, cluster, used, points_m, radii_m, found)
    _short_lines(lists, cluster, points_m, radii_m, found)
    for pixel in np.flatnonzero(~used):  # rings without a junction
        if not used[pixel]:
            _ring(int(pixel), lists, used, points_m, radii_m, found)
    return found


def _clusters(lists: list[list[int]], special: Flags) -> npt.NDArray[np.int64]:
    """Return the vertex of each special pixel, adjacent ones sharing one unless both are ends; -1 for the others."""
    cluster = np.full(len(lists), -1)
    count = 0
    for pixel in np.flatnonzero(special):
        if cluster[pixel] >= 0:
            continue
        stack, cluster[pixel] = [int(pixel)], count
        while stack:
            for near in lists[stack.pop()]:
                if special[near] and cluster[near] < 0 and len(lists[near]) > 1 and len(lists[pixel]) > 1:
                    cluster[near] = count
                    stack.append(near)
        count += 1
    return cluster


def _follow(
    pixel: int,
    first: int,
    lists: list[list[int]],
    cluster: npt.NDArray[np.int64],
    used: Flags,
    points_m: FloatArray,
    radii_m: FloatArray,
    found: Skeleton,
) -> None:
    """Add the line that leaves a vertex's pixel by `first`."""
    way, before, at = [pixel], pixel, first
    while cluster[at] < 0:
        used[at] = True
        way.append(at)
        onward = [near for near in lists[at] if near != before]
        vertices = [
            near for near in onward if cluster[near] >= 0 and not (len(way) == 2 and cluster[near] == cluster[pixel])
        ]
        before, at = at, (vertices or onward)[0]
    way.append(at)
    _add_line(found, int(cluster[pixel]), int(cluster[at]), points_m[way], radii_m[way])


def _short_lines(
    lists: list[list[int]],
    cluster: npt.NDArray[np.int64],
    points_m: FloatArray,
    radii_m: FloatArray,
    found: Skeleton,
) -> None:
    """Add the lines between vertices whose pixels touch: an end right at a junction."""
    for pixel in np.flatnonzero(cluster >= 0):
        for near in lists[pixel]:
            if cluster[near] > cluster[pixel]:
                way = [int(pixel), near]
                _add_line(found, int(cluster[pixel]), int(cluster[near]), points_m[way], radii_m[way])


def _ring(
    pixel: int, lists: list[list[int]], used: Flags, points_m: FloatArray, radii_m: FloatArray, found: Skeleton
) -> None:
    """Add a ring without a junction: a line from a vertex to itself."""
    way, before, at = [pixel], pixel, lists[pixel][0]
    used[pixel] = True
    while at != pixel and not used[at]:
        used[at] = True
        way.append(at)
        onward = [near for near in lists[at] if near != before]
        before, at = at, onward[0] if onward else pixel
    vertex = max(found.vertices, default=-1) + 1
    found.vertices[vertex] = Vertex(points_m[pixel], float(radii_m[pixel]))
    _add_line(found, vertex, vertex, points_m[[*way, pixel]], radii_m[[*way, pixel]])


def _add_line(found: Skeleton, start: int, end: int, points_m: FloatArray, radii_m: FloatArray) -> None:
    found.lines.append(Line(start, end, points_m, radii_m))

"""What has changed in the world since the map was made: where the hits of a drive contradict the map, though its place is known.

Each 0.3 m of travel the hits are set against the map: one in the map's free room, away from all walls, is of something new
(a parked machine, a pile, a wall that came nearer); one behind a wall of the map tells that the wall is gone. Both are counted
along the tunnels, each side by itself; a stretch is changed where they are most of what was seen there, from several places. What
walks by is seen too shortly for that. While the machine is lost, what it sees is kept apart, and counts where the place that is
found again is the one that the odometry led to: then the world was another one, and not the place.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from lhdmap.geometry import se2
from lhdmap.localization.stretches import AlongNode, WallStretch, stretches
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import FREE, OCCUPIED, UNKNOWN, Sheet

CAME, WENT = "came", "went"
"""Kinds of a change: something stands in what was free; a wall is not there any more."""
_EVERY_M = 0.3
_NOT_KNOWN = -1
_NEW_M, _GONE_M = 0.2, 0.4  # from all walls of the map: nearer is roughness at another height
_HEIGHT = 0.1  # a metre of height is as far as so many in plan: walls of another level are not near
_LEVEL_M, _CELL_M, _SURE_VIEWS = 4.0, 0.2, 2
_AROUND = np.array([(x << 22) + y for x in range(-2, 3) for y in range(-2, 3)], dtype=np.int64)
_CROSSED_M = np.arange(0.4, 3.01, 0.1)  # before a hit, where the wall that is gone may have stood
_KEPT_M = 100.0  # of travel
_SAME_M, _DRIFT = 0.5, 0.02  # of a place that is found again, from the one that the odometry led to
_FARTHEST_LOST_M = 60.0


class Change(NamedTuple):
    """A stretch that is not as in the map: `kind` (`came`, `went`), `node` (id), from `start_m` to `end_m` along it.

    `side`: `left`, `right` of the tunnel's line, empty in an intersection (then the stretch is NaN). `depth_m`: how far the hits
    are from the map's walls, median; `at_m` (3,): its middle in `map`; `length_m`: how long it is; `since_ns`, `until_ns`: when
    it was seen first and last; `views`: from how many places.
    """

    kind: str
    node: str
    side: str
    start_m: float
    end_m: float
    length_m: float
    depth_m: float
    at_m: tuple[float, float, float]
    since_ns: int
    until_ns: int
    views: int


class Seen(NamedTuple):
    """Hits (N, 2) in `map` at one moment: each `agrees` (0), is new (1) or behind a wall (2); `depth_m` (N,) from the walls."""

    stamp_ns: int
    points: FloatArray
    kinds: npt.NDArray[np.int8]
    depth_m: FloatArray
    height_m: float


class _NewCells:
    """Cells of 0.2 m in which something new was seen, from how many places, and those around the ones that are sure.

    What was seen more than some 100 m of travel ago is forgotten: what moves would come to cover all of the floor in a day.
    """

    def __init__(self) -> None:
        self._views: dict[int, int] = {}
        self._sure = self._before = np.zeros(0, np.int64)
        self._since_m = 0.0

    def add(self, travelled_m: float, points: FloatArray, height_m: float) -> None:
        """Count the new hits (N, 2) of one view."""
        if travelled_m - self._since_m > _KEPT_M:
            self._since_m, self._views = travelled_m, {}
            self._sure, self._before = np.zeros(0, np.int64), self._sure
        keys = np.unique(_cell_keys(points, height_m))
        for key in keys.tolist():
            self._views[key] = self._views.get(key, 0) + 1
        sure = keys[[self._views[key] == _SURE_VIEWS for key in keys.tolist()]]
        self._sure = np.union1d(self._sure, (sure[:, None] + _AROUND).ravel())

    def has(self, points: FloatArray, height_m: float) -> npt.NDArray[np.bool_]:
        """Return which points (N, 2) are in cells that are surely new, or near one: some hits of a nearer wall are not new."""
        keys, found = _cell_keys(points, height_m), np.zeros(len(points), np.bool_)
        for sure in (self._sure, self._before):
            if len(sure):
                found |= sure[np.minimum(np.searchsorted(sure, keys), len(sure) - 1)] == keys
        return found


def _cell_keys(points: FloatArray, height_m: float) -> npt.NDArray[np.int64]:
    cells = np.floor(points / _CELL_M).astype(np.int64) + (1 << 19)
    keys: npt.NDArray[np.int64] = (round(height_m / _LEVEL_M) << 44) + (cells[:, 0] << 22) + cells[:, 1]
    return keys


class WorldChanges:
    """Takes what a machine sees, with its place; tells what has changed at any time. Its memory grows with the map alone.

    `told`: whether somebody asks for `changes`; else hits are not counted along the nodes.
    """

    def __init__(self, topology: TopologicalMap, sheets: list[Sheet], walls: MapWalls, *, told: bool = True) -> None:
        self._sheets, self._along, self._told = sheets, AlongNode(topology), told
        self._tree = KDTree(walls.cells() * [1.0, 1.0, _HEIGHT])
        self._taken_m, self._new = -math.inf, _NewCells()
        self._apart: list[Seen] = []
        self._lost_m: float | None = None  # way at which the place was lost
        self._was_right = False

    def update(
        self,
        stamp_ns: int,
        travelled_m: float,
        place: tuple[FloatArray, float],
        points: FloatArray,
        *,
        known: bool,
        holds: bool,
    ) -> None:
        """Take hits (N, 2) in the machine's frame at a place (pose (3,), height); `known`: whether it is sure.

        `holds`: whether the walls agree with it in this very scan: then what contradicts them is new, not a sign of another place.
        """
        if travelled_m - self._taken_m < _EVERY_M or not len(points):
            return
        self._taken_m = travelled_m
        seen = self._set_against(stamp_ns, *place, points)
        if known:
            self._settle()
            self._count(seen)
            if holds:
                self._new.add(travelled_m, seen.points[seen.kinds == 1], seen.height_m)
            return
        self._lost_m = travelled_m if self._lost_m is None else self._lost_m
        if travelled_m - self._lost_m < _FARTHEST_LOST_M:
            self._apart.append(seen)

    def stands_in(self, pose: FloatArray, height_m: float, points: FloatArray) -> npt.NDArray[np.bool_]:
        """Return which hits (N, 2) in the machine's frame are of something that surely was not there when the map was made."""
        return self._new.has(se2.transform(pose, points), height_m)

    def unknown_share(self, pose: FloatArray, height_m: float, points: FloatArray) -> float:
        """Return the share of hits (N, 2) in the machine's frame of which the map says nothing: no wall, no free room."""
        kinds = self._set_against(0, pose, height_m, points).kinds
        return float((kinds == _NOT_KNOWN).mean()) if len(kinds) else 0.0

    def found(self, travelled_m: float, carried: FloatArray, pose: FloatArray) -> None:
        """Say that a lost place may be found at `pose` (3,), while the odometry has led to `carried` (3,)."""
        off = se2.between(carried, pose)
        way = 0.0 if self._lost_m is None else travelled_m - self._lost_m
        self._was_right = math.hypot(off[0], off[1]) < _SAME_M + _DRIFT * way

    def _settle(self) -> None:
        """Count what was seen while the machine was lost, if it was where the odometry said."""
        for seen in self._apart if self._was_right else []:
            self._count(seen)
        self._lost_m, self._apart, self._was_right = None, [], False

    def _count(self, seen: Seen) -> None:
        if self._told:
            self._along.add(seen)

    def walls(self) -> FloatArray:
        """Return the map's walls (M, 3): x, y, height of the floor."""
        return self._tree.data / [1.0, 1.0, _HEIGHT]

    def changes(self) -> list[Change]:
        """Return the changed stretches, those that began first in front; none where they are not `told`."""
        found = [_change(one) for one in stretches(self._along)]
        return sorted(found, key=lambda one: one.since_ns)

    def _set_against(self, stamp_ns: int, pose: FloatArray, height_m: float, points: FloatArray) -> Seen:
        in_map = se2.transform(pose, points)
        level = np.full((len(in_map), 1), height_m * _HEIGHT)
        apart = np.asarray(self._tree.query(np.hstack([in_map, level]), distance_upper_bound=5.0)[0], dtype=float)
        cells = self._cells(in_map, height_m)
        new = (cells == FREE) & (apart > _NEW_M)
        behind = (cells == UNKNOWN) & (apart > _GONE_M)
        behind[behind] = self._crossed(pose, in_map[behind], height_m)
        kinds = np.where(new, 1, np.where(behind, 2, 0)).astype(np.int8)
        kinds[(kinds == 0) & (apart > _GONE_M)] = _NOT_KNOWN  # of what the map does not know, nothing is said
        return Seen(stamp_ns, in_map, kinds, np.minimum(apart, 5.0), height_m)

    def _crossed(self, pose: FloatArray, hits: FloatArray, height_m: float) -> npt.NDArray[np.bool_]:
        """Return for hits (N, 2) whether a wall of the map stands before each of them, seen from the machine."""
        back = pose[:2] - hits
        far = np.maximum(np.linalg.norm(back, axis=1, keepdims=True), 1e-6)
        on_ray = hits[:, None, :] + np.minimum(_CROSSED_M, far)[:, :, None] * (back / far)[:, None, :]
        cells = self._cells(on_ray.reshape(-1, 2), height_m).reshape(len(hits), len(_CROSSED_M))
        crossed: npt.NDArray[np.bool_] = (cells == OCCUPIED).any(axis=1)
        return crossed

    def _cells(self, points: FloatArray, height_m: float) -> npt.NDArray[np.uint8]:
        """Return what the map says of points (N, 2) on a level; a wall on any sheet of it counts before free room."""
        out = np.full(len(points), UNKNOWN, np.uint8)
        for sheet in self._sheets:
            if not sheet.heights_m[0] - _LEVEL_M < height_m < sheet.heights_m[1] + _LEVEL_M:
                continue
            rows = sheet.at(points)
            inside = ((rows >= 0) & (rows < sheet.cells.shape)).all(axis=1)
            out[inside] = np.maximum(out[inside], sheet.cells[rows[inside, 0], rows[inside, 1]])
        return out


def _change(one: WallStretch) -> Change:
    return Change((CAME, WENT)[one.kind - 1], *one[1:])

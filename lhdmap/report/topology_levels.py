"""What of a topological map is on which level: each level gets a picture of its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.topology.model import UNEXPLORED, TopologicalMap
from lhdmap.topology.sheet import OCCUPIED, Sheet

_STRAY_PCT = 0.5
Indices = npt.NDArray[np.int64]


class DrawnLevel(NamedTuple):
    """A level: its name, and its free space where that is known."""

    name: str
    sheet: Sheet | None = None


class Levels:
    """The levels of a map, lowest first; without sheets there is one, and all is on it."""

    def __init__(self, topology: TopologicalMap, sheets: Sequence[Sheet] = ()) -> None:
        self._ranges = np.array([sheet.heights_m for sheet in sheets], dtype=float).reshape(-1, 2)
        self.all = [DrawnLevel(name, sheet) for name, sheet in zip(self._names(topology, sheets), sheets, strict=True)]
        self.all = self.all or [DrawnLevel("all levels")]

    def of(self, points_m: FloatArray) -> Indices:
        """Return the index of the level that each point (N, 3) is on: whose heights hold it, or are next to it."""
        if not len(self._ranges):
            return np.zeros(len(points_m), dtype=np.int64)
        z = points_m[:, 2:3]
        away = np.maximum(np.maximum(self._ranges[:, 0] - z, z - self._ranges[:, 1]), 0.0)
        levels: Indices = np.argmin(away, axis=1)
        return levels

    def on(self, level: int, lines_m: Sequence[FloatArray]) -> list[FloatArray]:
        """Return the parts of lines (N, 3) that are on a level, each with the point beyond its ends, so that no gap is left."""
        parts = []
        for line in lines_m:
            flags = self.of(line) == level
            edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
            parts += [line[start : stop + 1] for start, stop in edges.reshape(-1, 2).tolist()]
        return parts

    def _names(self, topology: TopologicalMap, sheets: Sequence[Sheet]) -> list[str]:
        """Return the name that the intersections on each sheet have for their level; else its number."""
        nodes = topology.intersections
        on = self.of(np.array([one.pose_map_node[:3] for one in nodes]).reshape(-1, 3))
        told = [
            {str(one.level) for one, k in zip(nodes, on.tolist(), strict=True) if k == n} for n in range(len(sheets))
        ]
        return [next(iter(names)) if len(names) == 1 else str(n) for n, names in enumerate(told)]


def coarser(sheet: Sheet, longest: int) -> Sheet:
    """Return a sheet with its cells joined to squares, so that no side has more than `longest`; of a square the wall shows."""
    step = -(-max(sheet.cells.shape, default=1) // longest)
    if step <= 1:
        return sheet
    rows, columns = (-(-side // step) for side in sheet.cells.shape)
    padded = np.zeros((rows * step, columns * step), dtype=np.uint8)
    padded[: sheet.cells.shape[0], : sheet.cells.shape[1]] = sheet.cells
    cells: npt.NDArray[np.uint8] = padded.reshape(rows, step, columns, step).max(axis=(1, 3))
    return sheet._replace(cells=cells, cell_m=step * sheet.cell_m)


def middle(line_m: FloatArray) -> FloatArray:
    """Return the point half way along a line (N, D)."""
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m, axis=0), axis=1))])
    return np.array([np.interp(0.5 * at[-1], at, column) for column in line_m.T])


def extent_m(sheet: Sheet) -> FloatArray:
    """Return lower and upper corner (2, 2) of the walls of a sheet, without the last few: what stray beams have hit."""
    rows_columns = np.argwhere(sheet.cells == OCCUPIED)
    if not len(rows_columns):
        return np.empty((0, 2))
    return sheet.middles_m(np.percentile(rows_columns, [_STRAY_PCT, 100.0 - _STRAY_PCT], axis=0).astype(np.int64))


def summary(topology: TopologicalMap, sheets: Sequence[Sheet] = ()) -> str:
    """Return in one line what a topological map holds."""
    infeasible = sum(not one.feasible for one in topology.connections)
    unexplored = sum(one.ends.count(UNEXPLORED) for one in topology.tunnels)
    seen = sum(not one.driven for one in topology.tunnels)
    levels = len(sheets) or max(len({str(one.level) for one in topology.intersections}), bool(topology.tunnels))
    found = [
        counted(len(topology.tunnels), "tunnel") + (f" ({seen} only seen)" if seen else ""),
        counted(len(topology.intersections), "intersection"),
        counted(levels, "level"),
        counted(len(topology.waypoints), "waypoint"),
        f"{counted(unexplored, 'end')} unexplored",
        *([f"{counted(infeasible, 'connection')} infeasible"] if infeasible else []),
    ]
    return ", ".join(found)


def counted(count: int, word: str) -> str:
    """Return a count with its word."""
    return f"{count} {word}{'' if count == 1 else 's'}"

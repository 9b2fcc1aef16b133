"""The walls of a node, fused from all its scans: what localization matches against.

Hits are averaged in cells of 5 cm in the node's frame; only cells with hits are stored. `surface_map` puts them into the grids of
`lhdmap.scan_matching`, so that `match` works on a node as it does on the local map of the odometry.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.geometry import se2
from lhdmap.landmarks.scans import NodeScan, in_node, near
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.scan_matching.surface_map import SurfaceMap, empty_map, insert_all

_BAND_M = 3.0  # of height: hits seen from floors of one band share a cell
_BAND_M = 3.0  # of height: hits seen from floors of one band share a cell
_LEAST_CELLS, _MOST_CELLS, _MARGIN_CELLS = 256, 4096, 32
_WEIGHED_HITS = 16  # more hits than this make a cell no surer
_MOST_COUNT = np.iinfo(np.uint16).max


class Cells(NamedTuple):
    """Averaged hits in the node's frame: `points_m` (M, 2) float32, `counts` (M,) uint16, ordered by cell of `cell_m`.

    `heights_m` (M,) float32: of the floor in `map` where they were seen from; None in maps that do not tell it.
    """

    points_m: Float32Array
    counts: npt.NDArray[np.uint16]
    cell_m: float
    heights_m: Float32Array | None = None


def fused(placed: list[FloatArray], cell_m: float, heights_m: Sequence[float] | None = None) -> Cells:
    """Return the averaged hits of clouds (N, 2) that are in one frame; whatever order they come in.

    `heights_m`: of the floor that each cloud was seen from: cells of floors that are far apart in height stay apart.
    """
    points = np.concatenate([np.zeros((0, 2)), *placed])
    of_cloud = [0.0] * len(placed) if heights_m is None else heights_m
    heights = np.repeat(np.asarray(of_cloud, dtype=float), [len(one) for one in placed])
    keys = np.column_stack([np.floor(points / cell_m), np.floor(heights / _BAND_M)]).astype(np.int64)
    order = np.lexsort((points[:, 1], points[:, 0], keys[:, 2], keys[:, 1], keys[:, 0]))
    keys, points, heights = keys[order], points[order], heights[order]
    starts = np.flatnonzero(np.r_[True, (np.diff(keys, axis=0) != 0).any(axis=1)]) if len(points) else np.zeros(0, int)
    counts = np.diff(np.r_[starts, len(points)])
    # summed about the cell, so that places far from the node's origin are as exact as near ones
    corners = keys[:, :2] * cell_m
    offsets = np.add.reduceat(points - corners, starts, axis=0) if len(starts) else np.zeros((0, 2))
    means = corners[starts] + offsets / counts[:, None]
    mean_heights = None
    if heights_m is not None:
        mean_heights = ((np.add.reduceat(heights, starts) if len(starts) else np.zeros(0)) / counts).astype(np.float32)
    return Cells(means.astype(np.float32), np.minimum(counts, _MOST_COUNT).astype(np.uint16), cell_m, mean_heights)


def placed(scan: NodeScan, pose_map_node: FloatArray, settings: LandmarkSettings) -> FloatArray:
    """Return the hits (N, 2) of a scan that enter the fused walls, in the node's frame."""
    points: FloatArray = se2.transform(
        in_node(scan, pose_map_node), near(scan.points_m, settings.surface_range_m, settings.centre_m)
    )
    return points


def most_reach_m(cell_m: float) -> float:
    """Return how far to each side a map with such cells can reach at most, m."""
    return 0.5 * (_MOST_CELLS - _MARGIN_CELLS) * cell_m


def surface_map(cells: Cells, about_m: FloatArray | None = None, reach_m: float = 60.0) -> SurfaceMap:
    """Return the walls as a `SurfaceMap` in the node's frame, all at height 0: match with `Hits(…, layered=False)`.

    Args:
        cells: fused walls.
        about_m: (2,) around which they are wanted; None: all of them.
        reach_m: ... and how far to each side of it.

    Raises:
        InputError: all are wanted, and they are farther apart than a map can hold (205 m with cells of 5 cm).
    """
    points, counts = cells.points_m.astype(np.float64), cells.counts
    if about_m is not None:
        inside = (np.abs(points - about_m) <= reach_m).all(axis=1)
        points, counts = points[inside], counts[inside]
    wide = float(np.ptp(points, axis=0).max()) / cells.cell_m + _MARGIN_CELLS - 1 if len(points) else 0.0
    if wide > _MOST_CELLS:
        raise InputError(
            f"the walls of the node are {wide * cells.cell_m:.0f} m wide, a map holds {_MOST_CELLS * cells.cell_m:.0f} m: "
            "say about_m, around which they are wanted, and how far (reach_m)"
        )
    size = max(_LEAST_CELLS, 1 << int(np.ceil(np.log2(max(wide, 1.0)))))
    walls = empty_map(cells.cell_m, size)
    repeated = np.repeat(points, np.minimum(counts, _WEIGHED_HITS), axis=0)
    insert_all(walls, np.column_stack([repeated, np.zeros(len(repeated))]), float(_MOST_COUNT))
    return walls

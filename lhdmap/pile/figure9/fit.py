"""Small geometry for Fig. 9: voxel grid, largest cluster, robust plane."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lhdmap.geometry.plane import robust_plane, tukey
from lhdmap.messages import FloatArray

_ROUNDS = 20  # of the robust plane: weights have settled long before


def voxelised(points_m: FloatArray, size_m: tuple[float, float, float]) -> FloatArray:
    """Return the mean of the points (N, 3) in each voxel, shape (M, 3); points that are not finite are left out."""
    points = points_m[np.isfinite(points_m).all(axis=1)]
    if not len(points):
        return points
    cells = np.floor(points / np.asarray(size_m)).astype(np.int64)  # absolute, as in `integration.voxel_grid`
    cells -= cells.min(axis=0)
    extent = cells.max(axis=0) + 1
    keys = (cells[:, 0] * extent[1] + cells[:, 1]) * extent[2] + cells[:, 2]
    _, place = np.unique(keys, return_inverse=True)
    counts = np.bincount(place)
    return np.stack([np.bincount(place, weights=points[:, axis]) / counts for axis in range(3)], axis=-1)


def largest_cluster(points_m: FloatArray, gap_m: float) -> npt.NDArray[np.bool_]:
    """Return which points (N, 3) belong to the largest set that is connected by steps of at most `gap_m`, shape (N,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    n = len(points_m)
    if n == 0:
        return np.zeros(0, dtype=bool)
    pairs = cKDTree(points_m).query_pairs(gap_m, output_type="ndarray")
    links = coo_array((np.ones(len(pairs), dtype=bool), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, labels = connected_components(links, directed=False)
    largest: npt.NDArray[np.bool_] = labels == np.bincount(labels).argmax()
    return largest


def face_plane(points_m: FloatArray) -> FloatArray:
    """Return a, b, c (3,) of x = a + b y + c z through points (N, 3), by Tukey's weights; NaN where (y, z) lie on a line."""
    if not len(points_m):
        return np.full(3, math.nan)
    found = robust_plane(points_m[:, 1:], points_m[:, 0], tukey, _ROUNDS)
    return found.terms if found.determined else np.full(3, math.nan)


def plane_inclination_deg(points_m: FloatArray) -> float:
    """Return the inclination -atan2(1, dx/dz) of the robust plane through points (N, 3), Table 6's sign; x into the pile."""
    return -math.degrees(math.atan2(1.0, float(face_plane(points_m)[2])))

"""Which way is up in a plain cloud, and which of its points are alone."""

from __future__ import annotations

import numpy as np

from lhdmap.errors import UsageError
from lhdmap.messages import FloatArray
from lhdmap.pile.clouds.height_map import Mask

AXES = ("x", "y", "z", "-x", "-y", "-z")
_NEIGHBOUR = 6
_ALONE = 12.0
_ALONE_SHARE = 0.02


def rotation_to_up(axis: str) -> FloatArray:
    """Return R_up_cloud (3, 3) that turns the named axis of the cloud to z; the other two follow in their order.

    Raises:
        UsageError: there is no such axis.
    """
    if axis not in AXES:
        raise UsageError(f"--up {axis}: one of {', '.join(AXES)} or auto was wanted")
    k = "xyz".index(axis[-1])
    up = np.zeros(3)
    up[k] = -1.0 if axis.startswith("-") else 1.0
    first = np.zeros(3)
    first[(k + 1) % 3] = 1.0
    rotation: FloatArray = np.stack([first, np.cross(up, first), up])
    return rotation


def vertical_axis(points_m: FloatArray) -> str:
    """Return the axis x, y or z along which points (N, 3) extend least: heaps and drifts are wider than high.

    Whether it points up or down cannot be told from a cloud alone; up is taken.
    """
    low, high = np.percentile(points_m, [1.0, 99.0], axis=0)
    return "xyz"[int(np.argmin(high - low))]


def isolated(points_m: FloatArray) -> Mask:
    """Return which points (N, 3) are alone, shape (N,): their sixth neighbour is twelve times farther than usual.

    And at least 2 % of the cloud's extent away: where the density varies much, thin parts are not alone.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(points_m)
    sample = points_m[:: max(len(points_m) // 5000, 1)]
    usual = float(np.median(tree.query(sample, k=_NEIGHBOUR + 1)[0][:, -1]))
    extent = float(np.ptp(np.percentile(points_m, [1.0, 99.0], axis=0), axis=0).max())
    limit = max(_ALONE * usual, _ALONE_SHARE * extent, 1e-9)
    far = tree.query(points_m, k=_NEIGHBOUR + 1, distance_upper_bound=limit)[0][:, -1]
    alone: Mask = ~np.isfinite(far)
    return alone

"""Which parts of the skeleton were driven: each pose marks the point of the skeleton nearest to it, and a metre around."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from lhdmap.messages import FloatArray
from lhdmap.topology.skeleton import Line, Skeleton

_MARKED_M = 1.0
_FARTHEST_M = 8.0  # a pose farther from all lines is in a room that has none


class DrivenShare(NamedTuple):
    """Of one line: the share of its points that were driven, and how far (m) from its start and from its end they reach."""

    share: float
    from_start_m: float
    from_end_m: float


def driven_shares(skeleton: Skeleton, driven_m: FloatArray) -> list[DrivenShare]:
    """Return what of each line was driven by a machine at `driven_m` (N, 2)."""
    lines = skeleton.lines
    if not lines:
        return []
    points = np.concatenate([line.points_m for line in lines])
    owner = np.repeat(np.arange(len(lines)), [len(line.points_m) for line in lines])
    within = np.concatenate([np.arange(len(line.points_m)) for line in lines])
    apart, nearest = KDTree(points).query(driven_m)
    nearest = nearest[apart < _FARTHEST_M]
    return [_share(line, np.unique(within[nearest[owner[nearest] == k]])) for k, line in enumerate(lines)]


def _share(line: Line, marked: npt.NDArray[np.int64]) -> DrivenShare:
    along = arc_m(line.points_m)
    if not len(marked):
        return DrivenShare(0.0, 0.0, 0.0)
    covered = np.zeros(len(along), bool)
    for at in along[marked]:
        covered |= np.abs(along - at) <= _MARKED_M
    reached = along[marked]
    return DrivenShare(float(covered.mean()), float(reached.max()), float(along[-1] - reached.min()))


def arc_m(points_m: FloatArray) -> FloatArray:
    """Return the length along points (N, 2 or more) at each of them, shape (N,)."""
    steps = np.linalg.norm(np.diff(points_m, axis=0), axis=1)
    along: FloatArray = np.concatenate([[0.0], np.cumsum(steps)])
    return along

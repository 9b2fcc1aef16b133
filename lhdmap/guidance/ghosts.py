"""Hits of what has left: the newest scans see through the place where it stood.

A tilted scanner looks lower the farther it looks, so that it sees over low rock that is near. A hit is therefore given up only
where its place was hit from as near as the scanner is now, and only while the machine stands: what it drives past stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

_BINS = 360
_THROUGH_M, _AGAIN_M, _NEARER_M = 0.3, 0.15, 0.3
_RANGE_M, _LEAST_M = 15.0, 0.5
_TIMES = 4  # in a row
_CELL_M = 0.2


class Eye(NamedTuple):
    """A scanner: its place (2,) and its hits (N, 2), in one frame."""

    place: FloatArray
    points: FloatArray


class Ghosts:
    """Watches remembered hits (N, 2) while the machine stands; `seen_m` (N,): from how far each was hit."""

    def __init__(self, hits: FloatArray, seen_m: FloatArray) -> None:
        self._hits = hits
        self._nearest_m = _least_by_place(hits, seen_m)
        self._times = np.zeros(len(hits), np.int64)

    def gone(self, eyes: Sequence[Eye]) -> npt.NDArray[np.bool_]:
        """Take a scan of each scanner, in the frame of the hits; return which hits (N,) are of what has left."""
        through, again = np.zeros(len(self._hits), bool), np.zeros(len(self._hits), bool)
        for eye in eyes:
            past, met, range_m = _looked(eye, self._hits)
            through |= past & (range_m > self._nearest_m - _NEARER_M)
            again |= met
            self._nearest_m = np.where(met, np.minimum(self._nearest_m, range_m), self._nearest_m)
        self._times = np.where(through & ~again, self._times + 1, np.where(again, 0, self._times))
        gone: npt.NDArray[np.bool_] = self._times >= _TIMES
        return gone


def _looked(eye: Eye, hits: FloatArray) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_], FloatArray]:
    """Return which hits (N,) a scanner looks past, which it meets again, and how far (N,) they are from it."""
    seen_m = np.full(_BINS, np.inf)
    bearing, range_m = _polar(eye.points - eye.place)
    np.minimum.at(seen_m, bearing, range_m)
    returned = np.isfinite(seen_m)
    beside = np.minimum(np.minimum(np.roll(seen_m, 1), np.roll(seen_m, -1)), seen_m)
    bearing, range_m = _polar(hits - eye.place)
    first = beside[bearing]
    near = returned[bearing] & (range_m < _RANGE_M) & (range_m > _LEAST_M)
    return near & (first > range_m + _THROUGH_M), near & (np.abs(first - range_m) < _AGAIN_M), range_m


def _polar(offsets: FloatArray) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Return bins (N,) of bearings, and ranges (N,)."""
    angle = np.arctan2(offsets[:, 1], offsets[:, 0])
    bins = np.floor((angle + np.pi) * (_BINS / (2.0 * np.pi))).astype(np.int64) % _BINS
    return bins, np.hypot(offsets[:, 0], offsets[:, 1])


def _least_by_place(hits: FloatArray, seen_m: FloatArray) -> FloatArray:
    """Return from how near (N,) anything at the place of each hit was hit."""
    cells = np.floor(hits / _CELL_M).astype(np.int64)
    _, which = np.unique(cells[:, 0] * 1_000_003 + cells[:, 1], return_inverse=True)
    least = np.full(int(which.max(initial=-1)) + 1, np.inf)
    np.minimum.at(least, which, seen_m)
    by_place: FloatArray = least[which]
    return by_place

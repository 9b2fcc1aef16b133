"""Views: what the scanners saw of the drift, kept each half metre of a drive: for the free space, and later for landmarks.

A view has a fan for each scanner: where the scanner was, and its hits in the order of their angles, thinned to an even density.
Like key scans they grow with the map and not with the drive: a place that was seen often wants no more of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.messages import Float32Array, FloatArray
from lhdmap.scan_matching.places import Places

STEP_M = 0.5
"""Travel between views."""
_STEP_RAD = math.radians(15.0)
_APART_M = 0.08  # of neighbouring hits: nearer ones say nothing more


class Fan(NamedTuple):
    """One scanner's part: `origin_m` (2,) and hits (N, 3) in the level frame of `base_link`, heights over its floor."""

    origin_m: FloatArray
    hits_m: Float32Array


class View(NamedTuple):
    """What was seen at `time_ns`, `travelled_m` along the drive."""

    time_ns: int
    travelled_m: float
    fans: tuple[Fan, ...]

    @property
    def hits_m(self) -> FloatArray:
        """Hits (N, 3) of all scanners in the level frame of `base_link`."""
        return np.concatenate([np.zeros((0, 3)), *(fan.hits_m for fan in self.fans)])


class Views:
    """Collects views while the odometry runs."""

    def __init__(self) -> None:
        self._places = Places(STEP_M)
        self._views: list[View] = []
        self._kept: FloatArray | None = None
        self._last: FloatArray | None = None
        self._travelled_m = 0.0

    def __len__(self) -> int:
        return len(self._views)

    def __iter__(self) -> Iterator[View]:
        return iter(self._views)

    def wants(self, pose: FloatArray, height_m: float) -> bool:
        """Go on to a pose (3,) by odometry; return whether a view is wanted there."""
        if self._last is not None:
            self._travelled_m += math.hypot(pose[0] - self._last[0], pose[1] - self._last[1])
        self._last = pose.copy()
        if self._kept is not None:
            turned = abs(math.remainder(pose[2] - self._kept[2], 2.0 * math.pi))
            if math.hypot(pose[0] - self._kept[0], pose[1] - self._kept[1]) < STEP_M and turned < _STEP_RAD:
                return False
        if not self._places.wants(pose, height_m, self._travelled_m):
            return False
        self._kept = pose.copy()
        return True

    def add(self, time_ns: int, fans: list[tuple[FloatArray, FloatArray]]) -> None:
        """Keep what was seen: of each scanner its place (2,) and its hits (N, 3) in the order of their angles."""
        thinned = tuple(Fan(origin.copy(), thin(hits)) for origin, hits in fans if len(hits))
        if thinned:
            self._views.append(View(time_ns, self._travelled_m, thinned))


def thin(hits_m: FloatArray) -> Float32Array:
    """Return hits (M, 3) in their order without those next to the one before: near walls have no more hits than far ones."""
    return hits_m[_thinned(np.ascontiguousarray(hits_m, dtype=float), _APART_M)].astype(np.float32)


@nb.njit(cache=True, nogil=True)
def _thinned(hits_m: FloatArray, apart_m: float) -> npt.NDArray[np.bool_]:
    """Return which hits are at least `apart_m` from the kept one before; the last before a leap is kept, too."""
    kept = np.zeros(len(hits_m), np.bool_)
    last = -1
    for i in range(len(hits_m)):
        if last >= 0:
            near = (hits_m[i, 0] - hits_m[last, 0]) ** 2 + (hits_m[i, 1] - hits_m[last, 1]) ** 2 < apart_m * apart_m
            if near:
                continue
            leap = (hits_m[i, 0] - hits_m[i - 1, 0]) ** 2 + (hits_m[i, 1] - hits_m[i - 1, 1]) ** 2
            if leap > (2.0 * apart_m) ** 2:
                kept[i - 1] = True
        kept[i] = True
        last = i
    return kept

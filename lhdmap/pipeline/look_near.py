"""A lost place taken up again near where the odometry has carried it, where two looks in a row say the same."""

from __future__ import annotations

import math
from collections.abc import Callable

from lhdmap.geometry import se2
from lhdmap.localization.method import Tracks
from lhdmap.localization.starting import best_start, poses_along
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray

# Time between two looks; travel after the loss until which it looks; what two looks may differ; how much better than any other
# place the found one must fit; hits that a look needs.
_LOOK_NS, _NEAR_M, _SAME_M, _CLEARLY, _LEAST_HITS = 400_000_000, 5.0, 0.3, 0.05, 40
# A place where the odometry leads to needs two looks. Another one must fit much better than it has to, or be seen from so much
# way: a machine that stands sees the same.
_AS_CARRIED_M, _FITS_WELL, _FROM_M = 0.2, 0.15, 1.5


class NearLook:
    """`lost` where a place is lost, then `look` with each scan until it gives a pose."""

    def __init__(self, walls: MapWalls) -> None:
        self._walls = walls
        self._lost_m, self._next_ns = 0.0, 0
        self._before: tuple[FloatArray, FloatArray] | None = None
        self._since_m = 0.0  # where the first of the looks was that say the same

    def lost(self, stamp_ns: int, travelled_m: float) -> None:
        """Begin to look."""
        self._lost_m, self._before, self._next_ns = travelled_m, None, stamp_ns + _LOOK_NS

    def look(
        self, stamp_ns: int, travelled_m: float, tracker: Tracks, points: FloatArray, wanted: Callable[[], float]
    ) -> FloatArray | None:
        """Return the pose (3,) where hits (N, 2) fit again, near that of the tracker; None where they do not, or not surely.

        `wanted`: tells which share of the hits must agree with the walls.
        """
        if len(points) < _LEAST_HITS or stamp_ns < self._next_ns or travelled_m - self._lost_m > _NEAR_M:
            return None
        self._next_ns = stamp_ns + _LOOK_NS
        found = best_start(self._walls, poses_along(tracker.pose, tracker.height_m), points)
        before, self._before = self._before, None
        if found.support < max(wanted(), found.rival + _CLEARLY):
            return None
        self._before = tracker.pose.copy(), found.pose
        if (
            before is None
            or _apart_m(se2.compose(before[1], se2.between(before[0], tracker.pose)), found.pose) > _SAME_M
        ):
            self._since_m = travelled_m
            return None
        surely = _apart_m(tracker.pose, found.pose) <= _AS_CARRIED_M or found.support >= wanted() + _FITS_WELL
        if not surely and travelled_m - self._since_m < _FROM_M:
            return None
        self._before = None
        return found.pose.copy()


def _apart_m(one: FloatArray, other: FloatArray) -> float:
    return math.hypot(one[0] - other[0], one[1] - other[1])

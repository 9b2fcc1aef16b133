"""A lost place taken up again where the odometry has led to, as after a room that the map does not have.

Of a room that is not in the map a scan says little, so the share counts that agrees of the hits of which the map can tell. A place
that fits by chance does not go on: several looks over some metres must say the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from lhdmap.geometry import se2
from lhdmap.localization.method import Tracks
from lhdmap.localization.starting import best_start, poses_round
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray

_EVERY_M, _AGREE_M, _LOOKS = 0.5, 3.0, 4  # way between looks; over which so many at least must agree
_SAME_M, _CLEARLY, _LEAST_HITS = 0.3, 0.05, 40  # as for a look near by
_TURN_RAD = math.radians(10.0)
_OFF_M, _DRIFT, _MOST_M = 0.3, 0.02, 3.0  # of the odometry: share of the way, and how far off it is looked for at most


class CarriedRules(NamedTuple):
    """`wanted`: which share of the hits must agree with the walls; `told`: a share at a pose (3,), of hits the map can tell of."""

    wanted: Callable[[], float]
    told: Callable[[float, FloatArray], float]


class _Look(NamedTuple):
    """`travelled_m`; the pose (3,) that the odometry has led to, and the one that was found."""

    travelled_m: float
    carried: FloatArray
    found: FloatArray


class CarriedLook:
    """`lost` where a place is lost, then `look` with each scan until it gives a pose."""

    def __init__(self, walls: MapWalls) -> None:
        self._walls = walls
        self._lost_m = self._next_m = 0.0
        self._agreeing: list[_Look] = []

    def lost(self, travelled_m: float) -> None:
        """Begin to look."""
        self._lost_m, self._next_m, self._agreeing = travelled_m, travelled_m + _EVERY_M, []

    def leads_to(self, travelled_m: float, carried: FloatArray, found: FloatArray) -> bool:
        """Return whether the odometry has led to a pose (3,), within what it may be off since the loss."""
        apart = se2.between(carried, found)
        off_m = self._off_m(travelled_m)
        return off_m <= _MOST_M and math.hypot(apart[0], apart[1]) <= off_m and abs(apart[2]) <= _TURN_RAD

    def look(self, travelled_m: float, tracker: Tracks, points: FloatArray, rules: CarriedRules) -> FloatArray | None:
        """Return the pose (3,) where hits (N, 2) fit again, about that of the tracker; None where they do not, or not surely."""
        off_m = self._off_m(travelled_m)
        if len(points) < _LEAST_HITS or travelled_m < self._next_m or off_m > _MOST_M:
            return None
        self._next_m = travelled_m + _EVERY_M
        found = best_start(self._walls, poses_round(tracker.pose, tracker.height_m, off_m), points)
        if found.support < found.rival + _CLEARLY or rules.told(found.support, found.pose) < rules.wanted():
            self._agreeing = []
            return None
        look = _Look(travelled_m, tracker.pose.copy(), found.pose.copy())
        self._agreeing = [*(self._agreeing if self._follows(look) else []), look]
        if len(self._agreeing) < _LOOKS or travelled_m - self._agreeing[0].travelled_m < _AGREE_M:
            return None
        self._agreeing = []
        return look.found

    def _off_m(self, travelled_m: float) -> float:
        return _OFF_M + _DRIFT * (travelled_m - self._lost_m)

    def _follows(self, look: _Look) -> bool:
        """Return whether a look found the machine where the one before leads to by the odometry."""
        if not self._agreeing:
            return False
        before = self._agreeing[-1]
        off = se2.between(se2.compose(before.found, se2.between(before.carried, look.carried)), look.found)
        return math.hypot(off[0], off[1]) <= _SAME_M

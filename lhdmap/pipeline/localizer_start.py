"""Where a drive begins, where that is known about: the first scan that is matched decides."""

from __future__ import annotations

from lhdmap.localization.method import Tracks
from lhdmap.localization.starting import best_start
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray


class StartChoice:
    """`start`: (3,) or (4,) about where, several (K, 4), or None where it is not known: then there is nothing to choose."""

    def __init__(self, walls: MapWalls, start: FloatArray | None) -> None:
        self._walls = walls
        self._open = start is not None
        self._several = None if start is None or start.ndim == 1 else start

    def choose(self, tracker: Tracks, points: FloatArray) -> None:
        """Set a tracker to the start that hits (N, 2) of the first scan fit best; of one, turn it where that fits better.

        A waypoint's heading is its node's: the machine may face the other way.
        """
        if not self._open:
            return
        self._open = False
        if self._several is None:
            tracker.turn_if_better(points)
            return
        best = best_start(self._walls, self._several, points)
        tracker.pose, tracker.height_m = best.pose.copy(), best.height_m

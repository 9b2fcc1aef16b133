"""Which hits of a scan are matched: all of a level scanner; of a tilted one a part, beside what the rear scanner sees again."""

from __future__ import annotations

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.odometry.anchored.rear_view import NO_POINTS, Behind, JointOffset
from lhdmap.scan_matching.matching import Hits, Match, MatchModel
from lhdmap.scan_matching.slant import slants

_FRONT_STEP = 3  # one in three hits of the front scanner: as exact with the rear one's, and faster


class HitChoice:
    """`of` a scan gives its hits; `behind`: the rear ones among the last, shape (N, 3), level base frame."""

    def __init__(self) -> None:
        self._joint = JointOffset()
        self._turn = 0
        self.behind = NO_POINTS

    def of(self, points: FloatArray, seen: Behind, rise: FloatArray, *, layered: bool) -> Hits:
        """Return what is matched: a level scanner sees the same curve of the walls again by itself."""
        self.behind = NO_POINTS
        if not layered:
            return Hits(points, len(points), layered=False)
        along = slants(points, rise)
        if not len(seen.points):
            return Hits(points, len(points), True, along)
        self._turn = (self._turn + 1) % _FRONT_STEP
        front, self.behind = points[self._turn :: _FRONT_STEP], self._joint.turned(seen)
        both = np.concatenate([along[self._turn :: _FRONT_STEP], slants(self.behind, rise)])
        return Hits(np.concatenate([front, self.behind]), len(front), True, both)

    def learn(self, found: Match, hits: Hits, model: MatchModel, cell_m: float, joint_x_m: float) -> None:
        """Learn the joint's offset from a match of hits that hold some of the rear scanner."""
        if len(hits.points) > hits.front:
            self._joint.update(found, hits, model, cell_m, joint_x_m)

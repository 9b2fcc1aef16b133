"""What the matcher is in the middle of: its states beside plain tracking, each with its way in and its way out."""

from __future__ import annotations

import numpy as np

from lhdmap.messages import FloatArray

# A scan whose heights differ by less is planar: a level scanner's differ by the inclinometer's noise, a tilted one's by metres.
_FLAT_M = 0.02
# Scans that are flagged after a jump, that is a pose that the motion did not predict: it takes some
# travel to see whether the place was right, or someone who walks beside the machine was taken for a wall.
_DOUBTFUL_SCANS = 25
_OFFSET_KEPT = 0.96  # of an offset from scan to scan: half of it is gone after 17 scans, before the doubt ends
# Share of agreeing hits below which a scan is doubtful without a jump: walls alone give 0.8 and more, less may be a crowd that
# moves along.
_DOUBTFUL_SUPPORT = 0.58
_LOST_BEFORE_RESTART = 5  # scans: one or two are lost to dust or someone near; five are another place
NO_OFFSET = np.zeros(3)  # of a motion that no jump has contradicted


class MatcherState:
    """The states of the matcher beside plain tracking; several may hold at once. Another one, `young`, is the map's (`young`).

    * layered: the scanner tilts, so that heights count. Begins with the first scan that is not flat, and stays.
    * doubtful: after a jump, for some scans. `offset` (3,) says by how much jumps have left the motion meanwhile.
    * lost: scans in a row that fitted nowhere. Ends with one that fits, or with a new map.
    """

    def __init__(self) -> None:
        self.layered = False
        self.jumped = False  # with the scan that is being matched
        self.offset = NO_OFFSET
        self._doubtful_scans = self._lost_scans = 0

    def begins_to_tilt(self, points: FloatArray) -> bool:
        """Return whether hits (N, 3) are the first of which heights tell that the scanner tilts."""
        if self.layered or not len(points) or np.ptp(points[:, 2]) <= _FLAT_M:
            return False
        self.layered = True
        return True

    def jump(self, offset: FloatArray) -> None:
        """Take it that the scan was placed off the motion's prediction by `offset` (3,)."""
        self.jumped, self._doubtful_scans = True, _DOUBTFUL_SCANS
        self.offset = self.offset + offset

    def lose(self) -> bool:
        """Take it that a scan fitted nowhere; return whether a new map is to begin."""
        self._lost_scans += 1
        restart = self._lost_scans >= _LOST_BEFORE_RESTART
        self._lost_scans = 0 if restart else self._lost_scans
        return restart

    def find(self) -> None:
        """Take it that a scan was placed."""
        self._lost_scans = 0

    def doubts(self, support: float) -> bool:
        """Return whether a scan of this support is doubtful; with each scan that is placed the doubt of a jump gets less."""
        doubtful = self._doubtful_scans > 0 or support < _DOUBTFUL_SUPPORT
        self._doubtful_scans = max(self._doubtful_scans - 1, 0)
        self.offset = _OFFSET_KEPT * self.offset if self._doubtful_scans else NO_OFFSET
        return doubtful

"""The path that sweeps are integrated at: the odometry's own, or where scans are realigned, what they say some metres later."""

from __future__ import annotations

from functools import partial

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.pile.moved import moved_report
from lhdmap.pile.result import PileReport
from lhdmap.pipeline.track import Track, TrackRows
from lhdmap.smoothing.moves import Moves
from lhdmap.smoothing.realign import AlignedScan, Realigner
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.smoother import Correction, corrected


class FinalPath:
    """`track` is the odometry's; `final` holds the poses that nothing but loop closures will move any more."""

    def __init__(self, track: Track) -> None:
        self.track = self.final = track
        self._realigner: Realigner | None = None
        self._used = self._moves = 0

    def realign(self, settings: SmoothingSettings, joint_x_m: float) -> None:
        """Realign the scans from now on, the first one: poses become final with a lag."""
        self._realigner, self.final = Realigner(settings, joint_x_m), Track()

    def update(self, scan: AlignedScan) -> None:
        """Take a processed scan whose pose is in the track."""
        if self._realigner is not None:
            self._realigner.update(scan)
            if len(self._realigner.moves) > self._moves:
                self._advance(self._realigner.moves, self._realigner.moves.last_ns)

    def finish(self) -> None:
        """Make the whole path final."""
        if self._realigner is not None:
            self._realigner.finish()
            self._advance(self._realigner.moves, self.track.last_ns or 0)

    def correction(self) -> Correction | None:
        """Return how the final path moves the odometry's, None where it does not."""
        if self._realigner is None or not len(self._realigner.moves):
            return None
        return Correction(*self._realigner.moves.since(0), 0)

    def moved(self, report: PileReport) -> PileReport:
        """Return a pile that was measured on the odometry's path as it lies on the final one."""
        correction = self.correction()
        return report if correction is None else moved_report(report, partial(motion_at, correction))

    def _advance(self, moves: Moves, until_ns: int) -> None:
        """Take over the odometry's poses up to a time, moved as the final nodes around them are."""
        rows = self.track.rows_after(self._used, until_ns)
        if len(moves) and len(rows.times_ns):
            recent = Correction(*moves.since(max(self._moves - 1, 0)), 0)
            self.final.extend(TrackRows(rows.times_ns, corrected(rows.poses, rows.times_ns, recent)))
        self._used, self._moves = self._used + len(rows.times_ns), len(moves)


def motion_at(correction: Correction, time_ns: int) -> FloatArray:
    """Return the planar motion (3,) of what was measured at a time."""
    at = int(np.searchsorted(correction.times_ns, time_ns))
    motion: FloatArray = correction.pose_map_odom[min(at, len(correction.pose_map_odom) - 1)]
    return motion

"""The path that sweeps are integrated at: the odometry's own, or where scans are realigned, what they say some metres later."""

from __future__ import annotations

import numpy as np

from lhdmap.pipeline.track import Rows, Track
from lhdmap.smoothing.realign import AlignedScan, Realigner
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.smoother import Correction, corrected


class FinalPath:
    """`track` is the odometry's; `final` holds the poses that nothing but loop closures will move any more."""

    def __init__(self, track: Track) -> None:
        self.track = self.final = track
        self._realigner: Realigner | None = None
        self._used = self._moves = 0

    def realign(self, settings: SmoothingSettings) -> None:
        """Realign the scans from now on, the first one: poses become final with a lag."""
        self._realigner, self.final = Realigner(settings), Track()

    @property
    def realigned(self) -> bool:
        """Whether the final path is another than the odometry's."""
        return self._realigner is not None

    def update(self, scan: AlignedScan) -> None:
        """Take a processed scan whose pose is in the track."""
        if self._realigner is not None:
            self._realigner.update(scan)
            self._advance(finished=False)

    def finish(self) -> None:
        """Make the whole path final."""
        if self._realigner is not None:
            self._realigner.finish()
            self._advance(finished=True)

    def correction(self) -> Correction | None:
        """Return how the final path moves the odometry's, None where it does not."""
        if self._realigner is None or not self._realigner.moves:
            return None
        return _correction(self._realigner.moves)

    def _advance(self, *, finished: bool) -> None:
        """Take over the odometry's poses up to the newest final node, moved as the nodes around them are."""
        assert self._realigner is not None
        moves = self._realigner.moves
        if len(moves) == self._moves and not finished:
            return
        until_ns = self.track.last_ns if finished else moves[-1][0]
        rows = self.track.rows_after(self._used, until_ns or 0)
        if moves and len(rows.times_ns):
            recent = _correction(moves[max(self._moves - 1, 0) :])
            self.final.extend(Rows(rows.times_ns, corrected(rows.poses, rows.times_ns, recent)))
        self._used, self._moves = self._used + len(rows.times_ns), len(moves)


def _correction(moves: list[tuple[int, np.ndarray]]) -> Correction:
    times, T_map_odom = zip(*moves, strict=True)
    return Correction(np.array(times, dtype=np.int64), np.array(T_map_odom), 0)

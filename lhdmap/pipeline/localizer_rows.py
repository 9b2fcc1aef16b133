"""The rows of a `Localizer`: one a front scan, rewritten once a smoother has made its pose final."""

from __future__ import annotations

from lhdmap.localization.fixed_lag import Belief, FixedLag, LagPlaced, LagStep, placed_row
from lhdmap.localization.place_on_map import Placer
from lhdmap.localization.rows import NOWHERE, TRACKING, LocalizationRow
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pipeline.localizer_says import row_of
from lhdmap.pipeline.place_held import HeldPlace


class LocalizerRows:
    """`add` a scan, then `smooth`, which does nothing without a smoother (`lag`).

    `newest_only`: the row before goes, as nobody asks for it; a shift has a million of them.
    """

    def __init__(self, placer: Placer, lag: FixedLag | None, *, newest_only: bool = False) -> None:
        self._placer, self._lag = placer, lag
        self._newest_only = newest_only and lag is None
        self.rows: list[LocalizationRow] = []

    def add(self, stamp_ns: int, place: HeldPlace, step: OdometryStep, source: str, latency_ms: float) -> None:
        """Add the row of a scan."""
        row = NOWHERE._replace(
            stamp_ns=stamp_ns, status=place.status, probability=place.probability, source=source, latency_ms=latency_ms
        )
        tracker = place.tracker
        if tracker is not None:
            on_map = self._placer.at(tracker.pose, tracker.height_m, float(step.velocity[0]))
            row = row_of(row._replace(information_along=place.support.information), on_map, tracker)
        if self._newest_only:
            self.rows.clear()
        self.rows.append(row)

    def smooth(self, step: OdometryStep, turn_rad: float | None, predicted: Belief | None, place: HeldPlace) -> None:
        """Hand the newest scan to the smoother, with the belief before and after its match; rewrite the rows that are final."""
        if self._lag is None:
            return
        believed = place.belief
        if believed is None or predicted is None or place.status != TRACKING:
            self._rewrite(self._lag.restart())
            return
        said = LagStep(len(self.rows) - 1, step.pose_odom_base, step.error.covariance, turn_rad)
        self._rewrite(self._lag.take(said, predicted, believed))

    def finish(self) -> None:
        """Make all rows final."""
        if self._lag is not None:
            self._rewrite(self._lag.restart())

    def _rewrite(self, final: list[LagPlaced]) -> None:
        for one in final:
            self.rows[one.row] = placed_row(self.rows[one.row], one, self._placer)

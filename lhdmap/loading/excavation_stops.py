"""When a dig is over: the stops of Fig. 19 that all methods share."""

from __future__ import annotations

from lhdmap.loading.digging_settings import ExcavationSettings
from lhdmap.loading.signals import Signals


class Stops:
    """β_max, α_max and d_max; α counts from the racked bucket (E5), and as reached a tolerance before it (E6).

    The way is that of the scan odometry since the dig began. The time limit is the state machine's.
    """

    def __init__(self, settings: ExcavationSettings, boom_max_rad: float, advance_max_m: float) -> None:
        self._boom_rad, self._advance_m = boom_max_rad, advance_max_m
        self._bucket_rad = settings.racked_rad + settings.alpha_max_rad - settings.alpha_tolerance_rad
        self._from_m = 0.0

    def begin(self, signals: Signals) -> None:
        """Count the way from here."""
        self._from_m = signals.travel_m

    def advance_m(self, signals: Signals) -> float:
        """Return the way since the dig began."""
        return signals.travel_m - self._from_m

    def reached(self, signals: Signals) -> str:
        """Return which stop is reached, empty where none is; what is NaN has not been reached."""
        if signals.boom_rad >= self._boom_rad:
            return "boom"
        if signals.bucket_rad >= self._bucket_rad:
            return "racked"
        return "advance" if self.advance_m(signals) >= self._advance_m else ""

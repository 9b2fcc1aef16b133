"""The bucket shake of section 3.5: short movements down and up, so that what lies loose falls before the weighing."""

from __future__ import annotations

from lhdmap.loading.digging_settings import ExcavationSettings
from lhdmap.loading.signals import Pedals, Signals, Turn
from lhdmap.loading.weighing_settings import WeighingSettings


class Shake:
    """Tilts down and up `shakes` times, then back until the bucket is racked or time is up; ends with `shaken`."""

    def __init__(self, settings: WeighingSettings, excavation: ExcavationSettings) -> None:
        self._settings = settings
        self._racked_rad = excavation.racked_rad - excavation.alpha_tolerance_rad
        self._began_ns = 0

    def begin(self, signals: Signals) -> None:
        """Begin with a movement down."""
        self._began_ns = signals.now_ns

    def step(self, signals: Signals) -> Turn:
        """Return the tilt of this moment; the machine stands braked."""
        one = self._settings
        passed_s = (signals.now_ns - self._began_ns) * 1e-9
        shaken_s = 2.0 * one.shakes * one.shake_s
        if passed_s < shaken_s:
            down = int(passed_s / one.shake_s) % 2 == 0
            return Turn(Pedals(tilt=-1.0 if down else 1.0, full_rpm=True, brake=True))
        if signals.bucket_rad >= self._racked_rad or passed_s >= shaken_s + one.racked_s:
            return Turn(Pedals(brake=True), "shaken", (("bucket_rad", signals.bucket_rad),))
        return Turn(Pedals(tilt=1.0, full_rpm=True, brake=True))

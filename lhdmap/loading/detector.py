"""Has the machine touched the pile? The paper's two thresholds, and force, slip and range together."""

from __future__ import annotations

import math
from typing import NamedTuple

from lhdmap.loading.detector_force import Cusum, ForceResidual
from lhdmap.loading.digging_settings import ChargingSettings
from lhdmap.loading.signals import Signals
from lhdmap.loading.skid import SkidFactor


class Felt(NamedTuple):
    """What a detector says of a moment: the cause of a touch (empty: none), whether the bucket presses too hard."""

    touch: str = ""
    pressed: bool = False


class PaperDetector:
    """Section 3.3: the transmission above 300 bar, or the skid factor above 0.5."""

    def __init__(self, settings: ChargingSettings) -> None:
        self._settings = settings

    def update(self, signals: Signals, skid: float) -> Felt:
        """Return what is felt; NaN triggers nothing."""
        if signals.transmission_bar > self._settings.pressure_bar:
            return Felt("pressure")
        return Felt("skid") if skid > self._settings.skid else Felt()


class FusedDetector:
    """Sums of force and slip, believed only where the perceived toe can be; before that a force is a bucket on the floor.

    A bump and a toe feel alike; the range tells them apart, however small the force (loading findings, section 6).
    Without a range the paper's thresholds decide.
    """

    def __init__(self, settings: ChargingSettings) -> None:
        self._settings, self._paper = settings, PaperDetector(settings)
        one = settings
        self._force = ForceResidual(one.force_kn_per_bar, one.mass_t, one.rolling_kn, one.slope_s)
        self._pushed = Cusum(one.force_kn, one.force_sum_kns)
        self._slipped = Cusum(one.slip_free_mps, one.slip_m)
        self._slip = SkidFactor(one.window_s, one.floor_mps, lag_matched=True)

    def update(self, signals: Signals, skid: float) -> Felt:
        """Return what is felt."""
        one = self._settings
        self._slip.update(signals)
        pushed = self._pushed.update(signals.now_ns, self._force.update(signals))
        slipped = self._slipped.update(signals.now_ns, self._slip.wheels_mps - signals.scan_mps)
        std_m = signals.toe_std_m if math.isfinite(signals.toe_std_m) else 0.0
        before_m = signals.toe_m - one.gate_std * std_m - one.gate_m
        if math.isnan(before_m):
            return self._paper.update(signals, skid)
        if before_m > 0.0:
            for each in (self._pushed, self._slipped):
                if pushed or slipped:
                    each.reset()
            return Felt(pressed=pushed)
        if pushed or slipped:
            return Felt("force" if pushed else "slip")
        return Felt("inside") if signals.toe_m + one.gate_std * std_m < -one.inside_m else Felt()


Detector = PaperDetector | FusedDetector


def detector_of(settings: ChargingSettings, name: str = "") -> Detector:
    """Return the detector of that name, of the settings where none is told."""
    return PaperDetector(settings) if (name or settings.detector) == "paper" else FusedDetector(settings)

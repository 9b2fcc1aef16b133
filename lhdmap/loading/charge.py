"""Charging: into the pile at a constant pedal, until the detector feels it."""

from __future__ import annotations

from lhdmap.loading.detector import Detector, detector_of
from lhdmap.loading.detector_force import Cusum, ForceResidual
from lhdmap.loading.digging_settings import ChargingSettings
from lhdmap.loading.signals import Pedals, Signals, Turn
from lhdmap.loading.skid import SkidFactor


class Charge:
    """The controller of charging; ends with `pressure`, `skid`, `force`, `slip` or `inside`: what told the touch.

    The values of its last turn: `skid`, `pressure_bar`, `force_kn`, `toe_m`, and `delay_s`, from the moment since when the
    force has been above `force_kn` without a break, which is the likeliest one of the touch.
    """

    def __init__(self, settings: ChargingSettings, detector: str = "") -> None:
        self._settings, self._name = settings, detector
        self._detector: Detector = detector_of(settings, detector)
        self._skid = SkidFactor(settings.window_s, settings.floor_mps, lag_matched=settings.lag_matched)
        self._began_ns = self._relieved_ns = 0

    def begin(self, signals: Signals) -> None:
        """Begin at this moment."""
        one = self._settings
        self._detector = detector_of(one, self._name)
        self._skid = SkidFactor(one.window_s, one.floor_mps, lag_matched=one.lag_matched)
        self._force = ForceResidual(one.force_kn_per_bar, one.mass_t, one.rolling_kn, one.slope_s)
        self._onset = Cusum(one.force_kn, 0.0)
        self._began_ns, self._relieved_ns = signals.now_ns, 0

    def step(self, signals: Signals) -> Turn:
        """Return pedals, and the cause where the pile is felt."""
        skid, force_kn = self._skid.update(signals), self._force.update(signals)
        self._onset.update(signals.now_ns, force_kn)
        felt = self._detector.update(signals, skid)
        touch = felt.touch if signals.now_ns - self._began_ns >= self._settings.launch_s * 1e9 else ""
        values = (
            ("skid", skid),
            ("pressure_bar", signals.transmission_bar),
            ("force_kn", force_kn),
            ("toe_m", signals.toe_m),
            ("delay_s", (signals.now_ns - self._onset.since_ns) * 1e-9 if self._onset.sum > 0.0 else 0.0),
        )
        return Turn(
            Pedals(propel=self._settings.pedal, tilt=self._relief(signals, pressed=felt.pressed)), touch, values
        )

    def _relief(self, signals: Signals, *, pressed: bool) -> float:
        """Return the tilt that eases a bucket that is pressed on the floor."""
        pulse_ns = round(self._settings.relief_s * 1e9)
        if pressed and pulse_ns and signals.now_ns - self._began_ns >= self._settings.launch_s * 1e9:
            self._relieved_ns = signals.now_ns + pulse_ns
        return 1.0 if signals.now_ns < self._relieved_ns else 0.0

"""Our own excavation: the bucket is tilted by force and penetration, not by the clock."""

from __future__ import annotations

import math

from lhdmap.loading.detector_force import ForceResidual
from lhdmap.loading.digging_settings import ExcavationSettings
from lhdmap.loading.excavation_lift import SlipLift
from lhdmap.loading.excavation_stops import Stops
from lhdmap.loading.excavation_stuck import BackOff
from lhdmap.loading.signals import Pedals, Signals, Turn
from lhdmap.loading.skid import SkidFactor

_SPILLED_M = 2.0  # of way at most before the pile resists


class AdaptiveDig:
    """An admittance: `tilt = (F - F_0) / F_1 + (v_0 - v) / v_1`, within 0 and 1; F is what the pile holds, without inertia.

    While the lip goes in easily, nothing is tilted; the more the rock resists and the slower the machine gets on, the more
    the bucket turns. Slip lifts the boom (as in the paper), no higher than the roof allows, and takes pedal away. Where nothing
    moves, it backs out a little.
    """

    def __init__(self, settings: ExcavationSettings) -> None:
        self._settings = settings
        self._stops = Stops(settings, settings.boom_max_rad, settings.advance_max_m)

    def begin(self, signals: Signals) -> None:
        """Begin at this moment."""
        one = self._settings
        self._skid = SkidFactor(one.window_s, one.floor_mps, lag_matched=one.lag_matched)
        self._lift = SlipLift(one.skid_max, one.hysteresis, one.lift_least_s)
        self._force = ForceResidual(one.force_kn_per_bar, one.mass_t, 0.0, one.slope_s)
        self._back_off = BackOff(one)
        self._stops.begin(signals)
        self._smoothed, self._smoothed_ns = 0.0, signals.now_ns
        self._resisted, self._begun_m = False, signals.travel_m

    def step(self, signals: Signals) -> Turn:
        """Return the pedals of this moment, and the stop where one is reached."""
        one, skid = self._settings, self._smooth(self._skid.update(signals), signals.now_ns)
        force_kn = self._force.update(signals)
        self._count_way(force_kn, signals)
        ended = self._stops.reached(signals)
        values = (
            ("advance_m", self._stops.advance_m(signals)),
            ("skid", skid),
            ("force_kn", force_kn),
            ("bucket_rad", signals.bucket_rad),
            ("boom_rad", signals.boom_rad),
            ("back_offs", float(self._back_off.pulses)),
        )
        if ended:
            return Turn(Pedals(), ended, values)
        if self._back_off.update(signals):
            return Turn(Pedals(propel=-one.back_off_pedal), values=values)
        slipping = self._lift.update(signals.now_ns, skid)
        pedal = one.pedal * (one.pedal_slipping if slipping else 1.0)
        tilt = self._tilt(force_kn, signals)
        lifts = slipping and signals.boom_rad < one.lift_most_rad
        if slipping and not lifts:
            tilt = 1.0  # the boom is as high as it may be: the bucket is turned out of the rock instead
        return Turn(Pedals(pedal, tilt=tilt, lift=float(lifts), full_rpm=True), values=values)

    def _smooth(self, skid: float, now_ns: int) -> float:
        """Return the low-passed skid; where it is not known, the one before."""
        if math.isfinite(skid):
            passed_s = (now_ns - self._smoothed_ns) * 1e-9
            self._smoothed += (skid - self._smoothed) * (passed_s / max(self._settings.skid_smooth_s + passed_s, 1e-9))
        self._smoothed_ns = now_ns
        return self._smoothed

    def _count_way(self, force_kn: float, signals: Signals) -> None:
        """Let the way begin where the pile first resists: spilled rock before it is felt, too, and is soon passed."""
        if not self._resisted:
            spilled_m = signals.travel_m - self._begun_m
            self._resisted = force_kn > self._settings.resists_kn or spilled_m > _SPILLED_M
            self._stops.begin(signals)

    def _tilt(self, force_kn: float, signals: Signals) -> float:
        """Return the tilt command; without scan odometry the tachometer tells the advance, without a pressure it is half."""
        one = self._settings
        advance_mps = signals.scan_mps if math.isfinite(signals.scan_mps) else signals.tacho_mps
        asked = (force_kn - one.force_kn) / one.force_range_kn + (one.advance_mps - advance_mps) / one.advance_range_mps
        return min(max(asked, 0.0), 1.0) if math.isfinite(asked) else 0.5

"""The paper's excavation: Eq. (8), Figs. 18 and 19, as printed or with the errata that make it work."""

from __future__ import annotations

from lhdmap.loading.digging_settings import ExcavationSettings, PaperDigSettings
from lhdmap.loading.excavation_lift import SlipLift
from lhdmap.loading.excavation_stops import Stops
from lhdmap.loading.signals import Pedals, Signals, Turn
from lhdmap.loading.skid import SkidFactor


class PaperDig:
    """Two states in turn: S_tilt ramps the tilt up, S_push pushes at full engine speed and lifts while the wheels slip.

    The boom is lifted no higher than the roof allows (`excavation.lift_most_rad`), as by all methods, whatever β_max is.
    Eq. (8)'s ramp ends where `R_0 (t - t_tilt) > 1` (erratum: `b` is not defined). The switches of `PaperDigSettings` bring
    back what is printed; evaluation/loading.md has what each of them costs.
    """

    def __init__(self, common: ExcavationSettings, settings: PaperDigSettings) -> None:
        self._common, self._settings = common, settings
        self._stops = Stops(common, settings.boom_max_rad, settings.advance_max_m)
        self._tilting, self._since_ns = True, 0

    def begin(self, signals: Signals) -> None:
        """Begin in S_tilt."""
        common, one = self._common, self._settings
        self._skid = SkidFactor(common.window_s, common.floor_mps, lag_matched=one.lag_matched)
        self._lift = SlipLift(one.skid_max, one.hysteresis, one.lift_least_s)
        self._stops.begin(signals)
        self._tilting, self._since_ns = True, signals.now_ns

    def step(self, signals: Signals) -> Turn:
        """Return the pedals of Eq. (8) at this moment, and the stop where one is reached."""
        skid, ended = self._skid.update(signals), self._stops.reached(signals)
        values = (
            ("advance_m", self._stops.advance_m(signals)),
            ("skid", skid),
            ("bucket_rad", signals.bucket_rad),
            ("boom_rad", signals.boom_rad),
            ("pressure_bar", signals.transmission_bar),
        )
        if ended:
            return Turn(Pedals(), ended, values)
        return Turn(self._pedals(signals, skid), values=values)

    def _pedals(self, signals: Signals, skid: float) -> Pedals:
        """Return the commands of one pass through Fig. 19; the state changes for the next one."""
        one, now_ns = self._settings, signals.now_ns
        in_state_s = (now_ns - self._since_ns) * 1e-9
        pedals = Pedals(one.pedal)
        if self._tilting:
            pedals = Pedals(one.pedal, tilt=min(one.ramp_per_s * in_state_s, 1.0))
            if not self._tilt_ends(signals, in_state_s):
                return pedals
            self._tilting, self._since_ns = False, now_ns
            if one.time_read_again:
                return pedals
        lift = self._lift.update(now_ns, skid)  # as printed, S_push is entered in the same pass, with S_tilt's time
        lift &= not signals.boom_rad >= self._common.lift_most_rad
        pedals = Pedals(one.pedal, lift=float(lift), full_rpm=True)
        if self._push_ends(signals, in_state_s):
            self._tilting, self._since_ns, self._lift.on = True, now_ns, False
        return pedals

    def _tilt_ends(self, signals: Signals, in_state_s: float) -> bool:
        one = self._settings
        early = one.tilt_ends_early and in_state_s > one.phase_min_s
        return in_state_s > one.phase_max_s or (early and signals.transmission_bar < one.pressure_max_bar)

    def _push_ends(self, signals: Signals, in_state_s: float) -> bool:
        one = self._settings
        pressed = signals.transmission_bar > one.pressure_max_bar
        if one.pressure_needed:
            return pressed and (in_state_s > one.phase_min_s or in_state_s > one.phase_max_s)
        return (pressed and in_state_s > one.phase_min_s) or in_state_s > one.phase_max_s

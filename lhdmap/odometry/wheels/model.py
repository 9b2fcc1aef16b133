"""The wheels' part in the planar odometry, in one place: whether their steps are used, how, and how far.

A step of the wheels goes through four questions, in this order, and the first "no" is its cause in `diagnostics.parquet`:

1. Is it a measurement of this step, or a pose that is repeated while the machine moves (`StaleWheels`)?
2. Have walls that held the motion contradicted the wheels lately (`WheelTrust`)?
3. Does it agree with the motion before (`WheelGate`)? Slip does not, for seconds; other contradiction is believed after a moment.
4. How well? Scale and turn that walls have taught are applied (`WheelTurn`; the scale of the speed is in the motion's state).

Where a scan fits elsewhere than predicted, `log_odds_against` says how much the wheels speak against it.
"""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.motion import FORWARD, TURNING, PlanarMotion
from lhdmap.odometry.settings import OdometrySettings
from lhdmap.odometry.steps import Matched, WheelStep
from lhdmap.odometry.wheels.gate import WheelGate
from lhdmap.odometry.wheels.stale import StaleWheels
from lhdmap.odometry.wheels.stretch import WheelStretch
from lhdmap.odometry.wheels.trust import WheelTrust
from lhdmap.odometry.wheels.turn import WheelTurn

_SHORTEST_STEP_S = 1e-3  # a displacement over less gives no speed
_OTHER_WAY_M = 0.03  # between two scans, by wheels and by walls: more than noise makes of either
_SOON_M = 0.5  # stretch of the first comparison of speeds: wheels that are wrong pull the first scans off
_FREEDOM = 4.0  # of Student's t: with slip and lag, large errors are likelier than normal


class WheelUse(StrEnum):
    """What became of the wheels' step before a scan, and why."""

    NONE = "none"  # nothing was measured
    USED = "used"
    BELIEVED = "believed against the motion"  # contradicted it for long where walls do not hold it
    REPEATED = "left out: repeated"
    CONTRADICTED = "left out: contradicts walls"
    SLIPS = "left out: slip"

    @property
    def used(self) -> bool:
        """Whether the wheels' speed went into the motion."""
        return self in (WheelUse.USED, WheelUse.BELIEVED)


class WheelModel:
    """`fuse` with each step of the wheels, `learn` with each scan that was matched; `use` is what became of the last step."""

    def __init__(self, settings: OdometrySettings, motion: PlanarMotion) -> None:
        self._settings, self._motion = settings, motion
        self.use = WheelUse.NONE
        self.stale, self.trust, self.gate = StaleWheels(), WheelTrust(), WheelGate(motion)
        self.turn = WheelTurn(settings.wheel_scale_std, settings.wheel_curvature_std)
        self._at, self._since_m = np.zeros(3), 0.0
        self._all = WheelStretch(_SOON_M)
        self._good = WheelStretch()  # only steps that agreed with the motion

    def fuse(self, wheels: WheelStep | None, dt_s: float) -> WheelUse:
        """Tell the motion the wheels' mean speeds over `dt_s`; return what became of them."""
        self.gate.waited(dt_s)
        self.use = self._fused(wheels, dt_s)
        return self.use

    def _fused(self, wheels: WheelStep | None, dt_s: float) -> WheelUse:
        absent = wheels is None or dt_s < _SHORTEST_STEP_S
        if wheels is None or absent or not self.stale.believes(wheels, self._motion.velocity, dt_s):
            self._all.missed()
            self._good.missed()
            return WheelUse.NONE if absent else WheelUse.REPEATED
        self._all.measured(wheels.forward_m)
        self._since_m += wheels.forward_m
        if not self.trust.believed:
            self._good.missed()
            return WheelUse.CONTRADICTED
        sigma_mps = math.hypot(wheels.forward_sigma_m / dt_s, self._settings.wheel_noise_mps)
        agrees = self.gate.fuse(FORWARD, wheels.forward_m / dt_s, sigma_mps, scaled=True)
        use = WheelUse.SLIPS if not agrees else WheelUse.BELIEVED if self.gate.overridden else WheelUse.USED
        if wheels.turn_rad is not None:
            self._fuse_turn(wheels, wheels.turn_rad, dt_s)
        if not use.used or wheels.turn_rad is None:
            self._good.missed()
        return use

    def _fuse_turn(self, wheels: WheelStep, measured_rad: float, dt_s: float) -> None:
        """Tell the motion the wheels' turn, put right by what walls told of it."""
        noise_rad = math.hypot(wheels.turn_sigma_rad, self._settings.wheel_turn_noise_rps * dt_s)
        turn_rad, off_rad = self.turn.corrected(measured_rad, self._motion.step_forward_m)
        self.gate.fuse(TURNING, turn_rad / dt_s, math.hypot(noise_rad, off_rad) / dt_s, scaled=False)
        self._good.measured(wheels.forward_m, measured_rad, noise_rad)

    def learn(self, pose: FloatArray, matched: Matched, *, held: bool) -> None:
        """Compare with the pose (3,) after a scan; `held`: walls hold it, also along the drift."""
        self._motion.held = held
        if held and matched.jumped and self._other_way(pose):
            self.trust.contradicted()
        self._at, self._since_m = pose, 0.0
        sound = not (matched.lost or matched.doubtful)
        for stretch, known, learner in ((self._all, held, self.trust), (self._good, sound, self.turn)):
            compared = stretch.matched(pose) if known else None
            if not known:
                stretch.missed()
            if compared is not None:
                learner.learn(compared)

    @property
    def scale(self) -> float:
        """What wheels measure over what the machine drives, as walls have taught it."""
        return self._motion.wheel_scale

    def log_odds_against(self, error: FloatArray, information: FloatArray) -> float:
        """Return the log-odds (nats) of the wheels' step against a pose that is `error` (3,) off the prediction; 0 without one."""
        if not self._motion.measured:
            return 0.0
        return 0.5 * _FREEDOM * math.log1p(float(error @ information @ error) / _FREEDOM)

    def _other_way(self, pose: FloatArray) -> bool:
        """Return whether since the last match wheels went forward and the machine back, or the other way round."""
        walls_m = float(se2.between(self._at, pose)[0])
        return walls_m * self._since_m < 0.0 and min(abs(walls_m), abs(self._since_m)) > _OTHER_WAY_M

    def warnings(self) -> list[str]:
        """Return what a user should know of the wheels."""
        stale = self.stale.steps
        told = (
            [f"wheels: they stand while the machine moves (repeated values?); {stale} steps left out"] if stale else []
        )
        against = self.trust.warning()
        return told if against is None else [*told, against]

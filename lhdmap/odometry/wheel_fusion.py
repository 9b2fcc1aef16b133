"""The wheels' part in the planar odometry: which of their steps are used, put right by what walls told of them."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.motion import FORWARD, TURNING, Motion
from lhdmap.odometry.settings import OdometrySettings
from lhdmap.odometry.stale import StaleWheels
from lhdmap.odometry.steps import Matched, WheelStep
from lhdmap.odometry.stretch import Stretch
from lhdmap.odometry.wheel_trust import WheelTrust
from lhdmap.odometry.wheel_turn import WheelTurn

_SHORTEST_STEP_S = 1e-3
_BOTH_WAYS_M = 0.03
_SOON_M = 0.5  # wheels that are wrong pull the first scans off


class WheelFusion:
    """`fuse` with each step of the wheels, `learn` with each scan that was matched."""

    def __init__(self, settings: OdometrySettings, motion: Motion) -> None:
        self._settings, self._motion = settings, motion
        self.stale, self.trust = StaleWheels(), WheelTrust()
        self.turn = WheelTurn(settings.wheel_scale_std, settings.wheel_curvature_std)
        self._at, self._since_m = np.zeros(3), 0.0
        self._all = Stretch(_SOON_M)
        self._good = Stretch()  # only steps that agreed with the motion

    def fuse(self, wheels: WheelStep | None, dt_s: float) -> bool:
        """Tell the motion the wheels' mean speeds; return whether the forward one was used: slipping wheels stay out."""
        moving = self._motion.velocity
        if wheels is None or dt_s < _SHORTEST_STEP_S or not self.stale.believes(wheels, moving, dt_s):
            self._all.missed()
            self._good.missed()
            return False
        self._all.measured(wheels.forward_m)
        self._since_m += wheels.forward_m
        s = self._settings
        if not self.trust.believed:
            self._good.missed()
            return False
        sigma_mps = math.hypot(wheels.forward_sigma_m / dt_s, s.wheel_noise_mps)
        used = self._motion.fuse_speed(FORWARD, wheels.forward_m / dt_s, sigma_mps, scaled=True)
        if wheels.turn_rad is not None:
            noise_rad = math.hypot(wheels.turn_sigma_rad, s.wheel_turn_noise_rps * dt_s)
            turn_rad, off_rad = self.turn.corrected(wheels.turn_rad, self._motion.way_forward_m)
            self._motion.fuse_speed(TURNING, turn_rad / dt_s, math.hypot(noise_rad, off_rad) / dt_s, scaled=False)
            self._good.measured(wheels.forward_m, wheels.turn_rad, noise_rad)
        if not used or wheels.turn_rad is None:
            self._good.missed()
        return used

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

    def _other_way(self, pose: FloatArray) -> bool:
        """Return whether since the last match wheels went forward and the machine back, or the other way round."""
        walls_m = float(se2.between(self._at, pose)[0])
        return walls_m * self._since_m < 0.0 and min(abs(walls_m), abs(self._since_m)) > _BOTH_WAYS_M

    def warnings(self) -> list[str]:
        """Return what a user should know of the wheels."""
        stale = self.stale.steps
        told = (
            [f"wheels: they stand while the machine moves (repeated values?); {stale} steps left out"] if stale else []
        )
        against = self.trust.warning()
        return told if against is None else [*told, against]

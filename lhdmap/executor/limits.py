"""Filters between the queue and the actuators: Eqs. (20) and (21), acceleration, jerk, rate of the joint."""

from __future__ import annotations

import math

from lhdmap.driving.model import DriveModel
from lhdmap.messages import FloatArray

_CATCH_S = 0.5  # time in which a miss is made up for
LEAST_BRAKE_MPS2 = 0.2
"""A full brake is not taken for less, however steep it is."""


def pull_mps2(T_odom_base: FloatArray) -> float:
    """Return gravity along x of a machine at a pose (4, 4), m/s²: positive where its nose is lower."""
    return 9.81 * float(-T_odom_base[2, 0])


def speed_bound(model: DriveModel, left_s: float, period_s: float, pull_mps2: float = 0.0) -> float:
    """Return u_v,max of Eq. (20) for |u_v|: from it a full brake ends before the last queued command does.

    The paper's bound is D Q_dt. What a brake is late (a period, the dead time, its ramp) is taken from Q_dt, else the machine
    would still roll at its end; downhill it gains speed in the ramp, when the drive has let it go. `|u_v|`: the paper bounds
    forward speed alone (errata). `pull_mps2`: gravity along the motion, positive downhill; uphill counts as level.
    """
    pull = max(pull_mps2, 0.0)
    brake = max(model.brake_mps2 - pull, LEAST_BRAKE_MPS2)
    late_s = period_s + model.dead_time_s
    return max(brake * (left_s - late_s) - 0.5 * model.brake_mps2 * model.brake_ramp_s, 0.0)


def dead_zone(rate_rps: float, zone_rps: float) -> float:
    """Return a steering command after Eq. (21)."""
    return rate_rps if abs(rate_rps) > zone_rps else 0.0


class SpeedLimiter:
    """Follows a speed with limited acceleration and jerk, without overshoot; passes through a standstill between gears."""

    def __init__(self) -> None:
        self.speed_mps, self.slope_mps2 = 0.0, 0.0

    def restart(self, speed_mps: float) -> None:
        """Go on from a speed that is held."""
        self.speed_mps, self.slope_mps2 = speed_mps, 0.0

    def follow(self, target_mps: float, slope_mps2: float, limits: tuple[float, float, float], dt_s: float) -> None:
        """Go a period towards a target that changes by `slope_mps2`; `limits`: acceleration, deceleration, jerk."""
        up, down, jerk = limits
        miss = target_mps - self.speed_mps
        # Each new plan begins with the speed that the machine will have: what is missing to it must not undo the plan's slope.
        # the slope from which `jerk` brings it to nought in the moment in which the target is reached
        catch = math.copysign(min(abs(miss) / max(dt_s, _CATCH_S), math.sqrt(2.0 * jerk * abs(miss))), miss)
        slope = _within(slope_mps2 + catch, self.slope_mps2 - jerk * dt_s, self.slope_mps2 + jerk * dt_s)
        ahead = self.speed_mps > 0.0 or (self.speed_mps == 0.0 and slope >= 0.0)
        low, high = (
            (-down if self.speed_mps > 0.0 else -up, up) if ahead else (-up, down if self.speed_mps < 0.0 else up)
        )
        self.slope_mps2 = _within(slope, low, high)
        after = self.speed_mps + self.slope_mps2 * dt_s
        if after * self.speed_mps < 0.0 or (target_mps == 0.0 and slope_mps2 == 0.0 and abs(after) < 1e-3):
            after, self.slope_mps2 = 0.0, 0.0
        self.speed_mps = after


def changed(value: float, wanted: float, most: float) -> float:
    """Return a value after it has gone towards another by `most` at most."""
    return value + _within(wanted - value, -most, most)


def _within(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)

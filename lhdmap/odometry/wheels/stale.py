"""Wheels that say nothing: a pose that is repeated while the machine moves, and the leap to the present after it."""

from __future__ import annotations

import math

from lhdmap.messages import FloatArray
from lhdmap.odometry.steps import WheelStep

_STILL = 1e-6  # m, rad: encoders of a machine that creeps tell more
_MOVES_MPS, _TURNS_RPS = (
    0.15,
    math.radians(6.0),
)  # of a machine that surely moves
_LONGEST_S = 0.8  # wheels that stand for longer do stand: the scans may be wrong where walls do not hold them


class StaleWheels:
    """Tells whether a step of the wheels is to be believed.

    Drivers repeat the last pose while the link to the base is busy, then send one that makes up for all of it. A machine that
    stops is not taken for that: the scans slow the motion down as well.
    """

    def __init__(self) -> None:
        self.steps = 0  # that were not believed
        self._stale_s = 0.0

    def believes(self, wheels: WheelStep, velocity: FloatArray, dt_s: float) -> bool:
        """Return whether to use this step of `dt_s`; `velocity` (3,): the motion's before it."""
        still = abs(wheels.forward_m) < _STILL and abs(wheels.turn_rad or 0.0) < _STILL
        moves = abs(velocity[0]) > _MOVES_MPS or abs(velocity[2]) > _TURNS_RPS
        after = self._stale_s > 0.0
        stale = still and moves and self._stale_s < _LONGEST_S
        self._stale_s = self._stale_s + dt_s if stale else 0.0
        leaps = after and not still
        self.steps += stale or leaps
        return not (stale or leaps)

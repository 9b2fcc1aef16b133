"""Wheels against the motion before: taken where they agree, left out where they slip, believed where they dissent for long."""

from __future__ import annotations

from lhdmap.odometry.motion import FORWARD, Motion

_GATE_SIGMAS = 4.0
# Share of what wheels that slip were off by at first, within which they are believed again: walls alone tell the speed less and
# less, and what still slips soon comes within the gate.
_AGAIN = 0.5
# Where walls do not hold the motion: wheels that turn faster than the machine moves slip, for seconds; wheels that say anything
# else for longer than a moment are right, and the match has run away.
_SLIP_S, _DISSENT_S = 3.0, 0.5


class WheelGate:
    """Fuses mean speeds of the wheels into the motion; `overridden` tells whether the last was believed against it."""

    def __init__(self, motion: Motion) -> None:
        self._motion = motion
        self.overridden = False
        self._dissent_s = 0.0
        self._off_mps = 0.0  # of wheels that slip

    def waited(self, dt_s: float) -> None:
        """Let time pass; agreement ends the wait."""
        self._dissent_s += dt_s

    def fuse(self, axis: int, measured: float, sigma: float, *, scaled: bool) -> bool:
        """Fuse the mean speed over the step just predicted; False where it contradicts the motion (slip) and was left out.

        With `scaled` the wheels' scale is part of the state and learned.
        """
        motion, self.overridden = self._motion, False
        dt_s, direction = motion.begin_measurement(axis)
        scale = motion.wheel_scale if scaled else 1.0
        off_mps = abs(measured - scale * motion.forward_mps) if axis == FORWARD else 0.0
        agrees = motion.held or not off_mps > _AGAIN * self._off_mps > 0.0
        if agrees:
            agrees = motion.measure_way(direction, measured * dt_s, (sigma * dt_s) ** 2, scaled, _GATE_SIGMAS)
        if agrees:
            motion.note_measured(axis)
        if axis != FORWARD:
            return agrees
        if agrees:
            self._dissent_s = self._off_mps = 0.0
            return True
        self._off_mps = self._off_mps or off_mps
        slips = measured * motion.forward_mps > 0.0 and abs(measured) > abs(motion.forward_mps)
        if motion.held or self._dissent_s < (_SLIP_S if slips else _DISSENT_S):
            return False
        motion.believe_speed(direction, measured, sigma)
        self._dissent_s = self._off_mps = 0.0
        self.overridden = True
        return True

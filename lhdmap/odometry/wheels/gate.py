"""Wheels against the motion before: taken where they agree, left out where they slip, believed where they insist."""

from __future__ import annotations

from lhdmap.odometry.motion import FORWARD, PlanarMotion

_GATE_SIGMAS = 4.0  # measured speeds farther off than one in ten thousand by chance are slip, or the motion is wrong
# Share of what wheels that slip were off by at first, within which they are believed again: walls alone tell the speed less and
# less, and what still slips soon comes within the gate.
_AGAIN = 0.5
# Where walls do not hold the motion: wheels that turn faster than the machine moves slip, for seconds; wheels that say anything
# else for longer than a moment are right, and the match has run away.
_SLIP_S, _CONTRADICTION_S = 3.0, 0.5


class WheelGate:
    """Fuses mean speeds of the wheels into the motion; `overridden` tells whether the last was believed against it."""

    def __init__(self, motion: PlanarMotion) -> None:
        self._motion = motion
        self.overridden = False
        self._contradicting_s = 0.0
        self._slip_mps = 0.0  # what wheels were off by when they began to contradict the motion; 0: they agree

    def waited(self, dt_s: float) -> None:
        """Let time pass; agreement ends the wait."""
        self._contradicting_s += dt_s

    def fuse(self, axis: int, measured: float, sigma: float, *, scaled: bool) -> bool:
        """Fuse the mean speed over the step just predicted; False where it contradicts the motion (slip) and was left out.

        With `scaled` the wheels' scale is part of the state and learned.
        """
        motion, self.overridden = self._motion, False
        dt_s, direction = motion.begin_measurement(axis)
        off_mps = self._off_mps(measured, scaled=scaled) if axis == FORWARD else 0.0
        agrees = self._ready(off_mps) and motion.measure(
            direction, measured * dt_s, (sigma * dt_s) ** 2, scaled, _GATE_SIGMAS
        )
        if agrees:
            motion.note_measured(axis)
        if axis != FORWARD:
            return agrees
        if not agrees:
            self._slip_mps = self._slip_mps or off_mps
            self.overridden = self._outlasts(measured)
            if not self.overridden:
                return False
            motion.believe_speed(direction, measured, sigma)
        self._contradicting_s = self._slip_mps = 0.0
        return True

    def _off_mps(self, measured_mps: float, *, scaled: bool) -> float:
        scale = self._motion.wheel_scale if scaled else 1.0
        return abs(measured_mps - scale * self._motion.forward_mps)

    def _ready(self, off_mps: float) -> bool:
        """Return whether wheels that slipped are near enough to be asked again."""
        return self._motion.held or not off_mps > _AGAIN * self._slip_mps > 0.0

    def _outlasts(self, measured_mps: float) -> bool:
        """Return whether the wheels have contradicted a motion that walls do not hold for so long that they are right."""
        forward_mps = self._motion.forward_mps
        slips = measured_mps * forward_mps > 0.0 and abs(measured_mps) > abs(forward_mps)
        return not self._motion.held and self._contradicting_s >= (_SLIP_S if slips else _CONTRADICTION_S)

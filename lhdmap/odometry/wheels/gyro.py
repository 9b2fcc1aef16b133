"""The gyroscope beside the scans: it tells the turn where the walls do not, once they have shown that it is right.

Where the walls hold the heading they tell it better from scan to scan than needs help, and a gyroscope that fails then does no
harm: it is compared only. Over many minutes it is the better one: that is the smoother's (`lhdmap.smoothing.heading`).
"""

from __future__ import annotations

import math

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.motion import TURNING, PlanarMotion
from lhdmap.odometry.wheels.tally import WordOfWalls

_STRETCH_S = 1.0  # compared at once: long against the time between scans, short against a bend
_TURNS_RAD = math.radians(3.0)  # a stretch that turns less tells of no scale
_AGREES = (
    0.9,
    1.1,
)  # its turn over that of the walls: cheap gyroscopes are off by 3 %, wrong units and axes by far more
_TRUST_RAD, _MEMORY_RAD = (
    math.radians(20.0),
    math.radians(120.0),
)  # turned rightly until it is believed; that count as lately
_SHARE_AGAINST = 0.25  # of what speaks for it: one stretch in five may be the walls' fault
_STILL_RAD = math.radians(0.5)  # what a stretch may be off that hardly turns
_NOISE_RAD = math.radians(0.1)  # of a comparison: scan times, and what scans are off
# Bias at the start and its walk (per second): a cheap MEMS gyroscope that warms up, 0.1°/s in an hour.
_BIAS_STD_RPS, _BIAS_WALK_RPS = math.radians(1.0), math.radians(0.002)
_STEP_RAD, _RATE_RPS = math.radians(0.05), math.radians(0.05)  # what a turn by it may be off, and for each second of it
_LONG_S = 0.5  # time between two scans after which it is asked even where the walls held the heading
_GATE_SIGMAS = 4.0  # as that of the wheels
_TELL_RAD, _TELL_SHARE = (
    math.radians(90.0),
    0.2,
)  # contradicted at least, and of what was compared, until a user is told


class GyroTurn:
    """`fuse` with each step's turn, `learn` with each scan that was matched."""

    def __init__(self, motion: PlanarMotion) -> None:
        self._motion = motion
        self._bias, self._variance = 0.0, _BIAS_STD_RPS**2
        self._tally = WordOfWalls(_MEMORY_RAD)
        self._held = True
        self._gyro_rad = self._walls_rad = self._stretch_s = 0.0
        self._before: FloatArray | None = None
        self.used = 0
        self.turn_rad: float | None = None  # of the last step, its bias taken off; None where it is not believed

    @property
    def believed(self) -> bool:
        """Whether it has turned as the walls did, lately and far enough."""
        return self._tally.lately_for > max(_TRUST_RAD, self._tally.lately_against / _SHARE_AGAINST)

    def fuse(self, turn_rad: float | None, dt_s: float) -> None:
        """Take the turn since the scan before; it is used where the walls did not hold the heading there, or long ago."""
        self.turn_rad = None
        if turn_rad is None:
            self._restart()
            return
        self._gyro_rad += turn_rad
        self._stretch_s += dt_s
        if not self.believed:
            return
        self.turn_rad = turned_rad = turn_rad - self._bias * dt_s
        if self._held and dt_s < _LONG_S:
            return
        _, direction = self._motion.begin_measurement(TURNING)
        sigma = math.hypot(_STEP_RAD, (_RATE_RPS + math.sqrt(self._variance)) * dt_s)
        self.used += self._motion.measure(direction, turned_rad, sigma**2, False, _GATE_SIGMAS)

    def learn(self, pose: FloatArray, *, held: bool) -> None:
        """Compare with the pose (3,) after a scan; `held`: the walls hold its heading."""
        self._held = held
        if not held:
            self._restart()
            return
        if self._before is not None:
            self._walls_rad += float(se2.wrap(pose[2] - self._before[2]))
            if self._stretch_s >= _STRETCH_S:
                self._compare()
        else:
            self._gyro_rad = self._walls_rad = self._stretch_s = 0.0
        self._before = pose.copy()

    def _compare(self) -> None:
        """Take a stretch: what is constant in it is bias, what follows the turn speaks for or against."""
        off_rad = self._gyro_rad - self._walls_rad - self._bias * self._stretch_s
        if abs(self._walls_rad) > _TURNS_RAD or abs(off_rad) > _STILL_RAD:
            self._judge(off_rad)
        else:
            S = self._variance * self._stretch_s**2 + _NOISE_RAD**2
            gain = self._variance * self._stretch_s / S
            self._bias += gain * off_rad
            self._variance *= 1.0 - gain * self._stretch_s
        self._variance += _BIAS_WALK_RPS**2 * self._stretch_s
        self._gyro_rad = self._walls_rad = self._stretch_s = 0.0

    def _judge(self, off_rad: float) -> None:
        size = max(abs(self._walls_rad), abs(off_rad))
        ratio = 1.0 + off_rad / self._walls_rad if abs(self._walls_rad) > _TURNS_RAD else math.nan
        agrees = _AGREES[0] < ratio < _AGREES[1] or abs(off_rad) <= _STILL_RAD
        self._tally.take(size, ratio, agrees=agrees)

    def _restart(self) -> None:
        self._before = None
        self._gyro_rad = self._walls_rad = self._stretch_s = 0.0

    def warning(self) -> str | None:
        """Return what a user should know of it."""
        tally = self._tally
        if tally.against < max(_TELL_RAD, _TELL_SHARE * tally.compared):
            return None
        ratio = tally.ratio()
        told = f", and turns {ratio:.2g} times as far{_reason(ratio)}" if math.isfinite(ratio) else ""
        return (
            f"gyroscope: over {math.degrees(tally.against):.0f} of {math.degrees(tally.compared):.0f}° of turning "
            f"it contradicts the scans{told}"
        )


def _reason(ratio: float) -> str:
    """Return what a ratio of turns is known to come from."""
    if -_AGREES[1] < ratio < -_AGREES[0]:
        return ": is its sign wrong, or is it mounted upside down?"
    if 0.85 < ratio / 57.3 < 1.15:
        return ": is it in degrees?"
    if abs(ratio) < 0.1:
        return ": does it stand still, or is another of its axes upright?"
    return ""

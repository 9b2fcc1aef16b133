"""Where the machine is, how it slips, and how far the joint's sensor is off: an extended Kalman filter, 7 states.

State: x, y, heading of the rear axle, joint angle, its rate, slip angle of the axles, offset of the joint's sensor.
Measured: pose of the front axle and joint angle. The slip has no sensor: it shows in where the machine goes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion, Setpoint
from lhdmap.messages import FloatArray
from lhdmap.tracking.kernel import Lengths, State, front_axle, moved, rear_speed
from lhdmap.tracking.settings import TrackingSettings

_STEP_S = 0.02
_SLIP_LAG_S = 10.0  # without news the slip is forgotten
_REFUSED = 5  # poses in a row that are not believed: then the filter is wrong
_WALK = (0.01, 0.01, math.radians(0.1), math.radians(0.15), math.radians(2.0), 0.0, math.radians(0.01))
"""Process noise of each state but the slip, per root of a second."""


class Filter:
    """`take` each motion; `ahead` says where the machine is when a command that is given now counts."""

    def __init__(self, model: DriveModel, settings: TrackingSettings) -> None:
        self._settings = settings
        self.lengths: Lengths = (model.front_m, model.rear_m, model.steering_lag_s)
        self._dead_ns = round(model.dead_time_s * 1e9)
        self.stamp_ns, self.rear_mps, self.front_mps = 0, 0.0, 0.0
        self.known, self.state = False, np.zeros(7)
        self.covariance = np.zeros((7, 7))
        self._refused = 0
        one = settings
        self._noise = np.diag(
            [one.pose_std_m**2] * 2 + [math.radians(v) ** 2 for v in (one.pose_std_deg, one.joint_std_deg)]
        )

    def take(self, motion: Motion, sent: Sequence[Setpoint]) -> None:
        """Take a motion that is newer than the last one; `sent`: commands in the order of time."""
        if not all(math.isfinite(value) for value in motion) or (self.known and motion.stamp_ns <= self.stamp_ns):
            return
        self.front_mps = motion.speed_mps
        if not self.known or motion.stamp_ns - self.stamp_ns > 2_000_000_000 or self._refused >= _REFUSED:
            self._restart(motion)
            return
        rear = rear_speed(motion.speed_mps, self.state[3], self.state[4], self.lengths)
        self._predict(motion.stamp_ns, rear, sent)
        self.rear_mps = rear
        self._correct(motion)

    def ahead(self, at_ns: int, sent: Sequence[Setpoint]) -> tuple[State, float]:
        """Return the state of the five first values at a time, of commands that have been given, and the way of the rear axle."""
        state = _five(self.state)
        way, slip = 0.0, float(self.state[5])
        for rate, speed, step_s in _in_force(sent, self.stamp_ns, at_ns, self._dead_ns, self.front_mps):
            rear = rear_speed(speed, state[3], state[4], self.lengths)
            state = moved(state, rear, rate, step_s, self.lengths, (slip, slip))
            way += rear * step_s
        return state, way

    def _restart(self, motion: Motion) -> None:
        kept = (0.0, float(self.state[6]))
        front_m, rear_m, _ = self.lengths
        bend = motion.articulation_rad - kept[1]
        back = motion.heading_rad - bend
        x = motion.x_m - front_m * math.cos(motion.heading_rad) - rear_m * math.cos(back)
        y = motion.y_m - front_m * math.sin(motion.heading_rad) - rear_m * math.sin(back)
        self.state = np.array([x, y, back, bend, motion.articulation_rate_rps, *kept])
        one = self._settings
        offset = math.radians(one.joint_offset_deg)
        spread = [
            one.pose_std_m,
            one.pose_std_m,
            math.radians(1.0),
            math.radians(one.joint_std_deg),
            0.05,
            0.005,
            offset,
        ]
        self.covariance = np.diag(np.square(spread))
        self.covariance[3, 3] += offset**2
        self.covariance[3, 6] = self.covariance[6, 3] = -(offset**2)
        self.known, self.stamp_ns, self._refused = True, motion.stamp_ns, 0
        self.rear_mps = rear_speed(motion.speed_mps, bend, motion.articulation_rate_rps, self.lengths)

    def _predict(self, until_ns: int, rear_mps: float, sent: Sequence[Setpoint]) -> None:
        one = self._settings
        share = min(1.0, (abs(rear_mps) / one.slip_full_mps) ** 4)
        walk = np.square(_WALK)
        walk[5] = one.slip_noise**2 * share
        for rate, _, step_s in _in_force(sent, self.stamp_ns, until_ns, self._dead_ns, 0.0):
            slip = float(self.state[5])
            after = moved(_five(self.state), rear_mps, rate, step_s, self.lengths, (slip, slip))
            f = _jacobian(self.state, rear_mps, step_s, self.lengths)
            kept = math.exp(-step_s / _SLIP_LAG_S)
            f[5, 5] = kept
            self.state = np.array([*after, slip * kept, self.state[6]])
            self.covariance = f @ self.covariance @ f.T
            self.covariance[range(7), range(7)] += walk * step_s
        self.stamp_ns = until_ns

    def _correct(self, motion: Motion) -> None:
        x0, y0, ahead = front_axle(_five(self.state), self.lengths)
        front_m, rear_m, _ = self.lengths
        back = float(self.state[2])
        h = np.zeros((4, 7))
        h[0, 0] = h[1, 1] = h[2, 2] = h[2, 3] = h[3, 3] = h[3, 6] = 1.0
        h[0, 3], h[1, 3] = -front_m * math.sin(ahead), front_m * math.cos(ahead)
        h[0, 2], h[1, 2] = h[0, 3] - rear_m * math.sin(back), h[1, 3] + rear_m * math.cos(back)
        turned = (motion.heading_rad - ahead + math.pi) % (2.0 * math.pi) - math.pi
        bent = motion.articulation_rad - self.state[3] - self.state[6]
        news = np.array([motion.x_m - x0, motion.y_m - y0, turned, bent])
        spread = h @ self.covariance @ h.T + self._noise
        if float((np.square(news) / np.diag(spread)).max()) > self._settings.gate**2:
            self._refused += 1
            return
        self._refused = 0
        gain = np.linalg.solve(spread, h @ self.covariance).T
        self.state = self.state + gain @ news
        rest = np.eye(7) - gain @ h
        self.covariance = rest @ self.covariance @ rest.T + gain @ self._noise @ gain.T


def _five(state: FloatArray) -> State:
    x, y, heading, bend, rate = state[:5].tolist()
    return x, y, heading, bend, rate


def _jacobian(state: FloatArray, rear_mps: float, step_s: float, lengths: Lengths) -> FloatArray:
    """Return the derivative (7, 7) of a step, to first order in its time."""
    _, _, heading, bend, rate, slip, _ = state.tolist()
    front_m, rear_m, lag_s = lengths
    d = front_m + rear_m * math.cos(bend)
    course, way = heading + slip, rear_mps * step_s
    f = np.eye(7)
    f[0, 2] = f[0, 5] = -way * math.sin(course)
    f[1, 2] = f[1, 5] = way * math.cos(course)
    f[2, 3] = (
        way * (math.cos(bend) * d + rear_m * math.sin(bend) ** 2) - front_m * rear_m * math.sin(bend) * rate * step_s
    ) / d**2
    gone = -math.expm1(-step_s / lag_s)
    f[2, 4] = -front_m * lag_s * gone / d
    f[3, 4] = lag_s * gone
    f[4, 4] = 1.0 - gone
    return f


def _in_force(
    sent: Sequence[Setpoint], from_ns: int, until_ns: int, dead_ns: int, speed_mps: float
) -> list[tuple[float, float, float]]:
    """Return rate, speed and duration (s) of steps of 20 ms at most; a command counts a dead time after it was given."""
    out = []
    k, at = 0, from_ns
    while at < until_ns:
        step = min(until_ns - at, round(_STEP_S * 1e9))
        while k + 1 < len(sent) and sent[k + 1].at_ns + dead_ns <= at:
            k += 1
        counts = bool(sent) and sent[k].at_ns + dead_ns <= at
        out.append((sent[k].steering_rate_rps if counts else 0.0, speed_mps, step * 1e-9))
        at += step
    return out

"""The path as joint angle over way: what was planned in time is braked on in distance, so that the machine stays on it.

A path does not depend on the speed: the heading over the way follows from the joint over the way (Eq. (1) divided by the speed).
Holding the joint, or steering on in time, leaves it (guidance findings, Q6).
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion
from lhdmap.executor.queue import CommandQueue
from lhdmap.executor.rollout import BEND, RATE, SPEED, WAY, lags_of, rolled
from lhdmap.messages import FloatArray

_STEP_S = 0.02
_KEPT = 1024  # given commands: more than 5 s of them
_LOOK_S = 0.1  # how soon the joint is to be where the path has it


class Path(NamedTuple):
    """Planned joint angle (N,), rad, over the way (N,), m, on the odometer of the one who plans."""

    way_m: FloatArray
    bend_rad: FloatArray

    def bend_at(self, way_m: float) -> float:
        """Return the joint's angle after a way; held before the first and after the last."""
        return float(np.interp(way_m, self.way_m, self.bend_rad))


class Sent(NamedTuple):
    """A command that was given: when, the speed that it is to bring about, rate of the joint, brake."""

    at_ns: int
    speed_mps: float
    rate_rps: float
    brake: bool


class PathKeeper:
    """Knows how far the machine has come, what it still does with commands on their way, and the path that was planned."""

    def __init__(self, model: DriveModel) -> None:
        self.model = model
        self.way_m = 0.0
        self.path: Path | None = None
        self.motion: Motion | None = None
        self._sent: deque[Sent] = deque(maxlen=_KEPT)

    def sees(self, motion: Motion | None) -> None:
        """Take a motion, where it is finite and newer than the last one; the way goes on by it."""
        last = self.motion
        if motion is None or not all(math.isfinite(value) for value in motion):
            return
        if last is not None and motion.stamp_ns <= last.stamp_ns:
            return
        if last is not None:
            self.way_m += 0.5 * abs(motion.speed_mps + last.speed_mps) * (motion.stamp_ns - last.stamp_ns) * 1e-9
        self.motion = motion

    def gave(self, sent: Sent) -> None:
        """Note a command."""
        self._sent.append(sent)

    def plan(self, queue: CommandQueue, now_ns: int) -> None:
        """Keep the path of what is queued, from where the machine is, with what is on its way to it.

        One that ends before the machine can stop replaces none: nobody could brake on it.
        """
        motion = self.motion
        if motion is None:
            return
        ahead = queue.rows(now_ns, motion.stamp_ns)
        if len(ahead) == 0:
            return
        dead_s = self.model.dead_time_s
        rows = np.column_stack([ahead[:, 0] + dead_s, ahead[:, 1:], np.zeros(len(ahead))])
        states = rolled(
            self._state(motion),
            np.concatenate([self._given(motion), rows]),
            lags_of(self.model),
            float(rows[-1, 0]),
            _STEP_S,
        )
        enough_m = self.way_m + self.model.stopping_m(motion.speed_mps)
        if self.path is None or states[-1, WAY] >= enough_m:
            self.path = Path(states[:, WAY].copy(), states[:, BEND].copy())

    def ahead(self, until_ns: int) -> FloatArray | None:
        """Return the state (5,) at a time, of all commands that have been given; None where no motion is known."""
        motion = self.motion
        if motion is None:
            return None
        until_s = max((until_ns - motion.stamp_ns) * 1e-9, 0.0)
        last: FloatArray = rolled(self._state(motion), self._given(motion), lags_of(self.model), until_s, 0.01)[-1]
        return last

    def steering(self, now_ns: int) -> float:
        """Return the rate of the joint (rad/s) that keeps a braking machine on the path.

        With its lag the joint is at `bend + lag * rate` when it is let go, and the command moves just that; it is led to
        where the path has it a moment later, from where it will be when the command counts.
        """
        if self.path is None:
            return 0.0
        state = self.ahead(now_ns + round(self.model.dead_time_s * 1e9))
        if state is None or abs(state[SPEED]) < 1e-3:
            return 0.0
        lag = self.model.steering_lag_s
        coming = state[BEND] + lag * state[RATE]
        way = state[WAY] + self._braked_m(abs(state[SPEED]), _LOOK_S + lag)
        rate = (self.path.bend_at(way) - coming) / _LOOK_S
        most = self.model.max_rate_rps
        return min(max(rate, -most), most)

    def _braked_m(self, speed_mps: float, time_s: float) -> float:
        """Return the way in a time on a full brake."""
        time_s = min(time_s, speed_mps / self.model.brake_mps2)
        return speed_mps * time_s - 0.5 * self.model.brake_mps2 * time_s**2

    def _state(self, motion: Motion) -> FloatArray:
        return np.array(
            [
                self.way_m,
                motion.articulation_rad,
                motion.articulation_rate_rps,
                motion.speed_mps,
                self._braked_share(motion),
            ]
        )

    def _braked_share(self, motion: Motion) -> float:
        """Return how far the brake is on at a motion: by how long it has been given."""
        since_ns, dead_ns = None, round(self.model.dead_time_s * 1e9)
        for one in reversed(self._sent):
            if one.at_ns + dead_ns > motion.stamp_ns:
                continue
            if not one.brake:
                break
            since_ns = one.at_ns + dead_ns
            if motion.stamp_ns - since_ns >= self.model.brake_ramp_s * 1e9:
                break
        return 0.0 if since_ns is None else min((motion.stamp_ns - since_ns) * 1e-9 / self.model.brake_ramp_s, 1.0)

    def _given(self, motion: Motion) -> FloatArray:
        """Return what counts at a motion and after it, shape (K, 4): time since the motion, speed, rate, brake."""
        dead_ns, rows = round(self.model.dead_time_s * 1e9), []
        for one in reversed(self._sent):
            rows.append(((one.at_ns + dead_ns - motion.stamp_ns) * 1e-9, one.speed_mps, one.rate_rps, float(one.brake)))
            if rows[-1][0] <= 0.0:
                break
        return np.array(rows[::-1]).reshape(-1, 4)

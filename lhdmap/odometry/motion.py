"""The motion model as an object: prediction, wheel speeds, correction by matched poses."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.odometry import motion_filter
from lhdmap.odometry.settings import OdometrySettings

FORWARD, LATERAL, TURNING, SCALE = 3, 4, 5, 6  # places in the state of `motion_filter`
_SHORTEST_STEP_S = 1e-3  # a displacement over less gives no speed: scanners are at least ten times slower
_LONGEST_STEP_S = 1.0  # a machine brakes to rest within two seconds: after one the old speed says little
_STARTING_VARIANCE = np.diag([0.2**2, 0.05**2, 0.05**2])  # of a starting velocity from a dry run
_DISTRUSTED_VARIANCE = np.diag([3.0**2, 0.3**2, 2.0**2])  # hardly known: as much as machines do at all
_GAP_VARIANCE = np.diag([4.0, 0.1, 0.5])  # that a gap adds: 2 m/s forward, 0.3 m/s sideways, 0.7 rad/s


class PlanarMotion:
    """State and covariance of `motion_filter`: shared by the odometry and the matcher that corrects it.

    `velocity` (3,): forward, lateral, turning speed at the start, where it is known.
    """

    def __init__(self, settings: OdometrySettings, velocity: FloatArray | None = None) -> None:
        self._accelerations = np.array(
            [settings.forward_acceleration, settings.lateral_acceleration, settings.turning_acceleration]
        )
        self.state, self.P = motion_filter.initial(np.zeros(3))
        self._step_s = 0.0
        self._displacement, self._joint = np.zeros(3), np.zeros((10, 10))
        self._measured: set[int] = set()
        self.held = False  # whether walls hold it in all directions, as the last scan says
        if velocity is not None:
            self.state[3:6] = velocity
            self.P[3:6, 3:6] = _STARTING_VARIANCE

    @property
    def pose(self) -> FloatArray:
        """Pose of `base_link` in `odom`, shape (3,), a copy."""
        return self.state[:3].copy()

    @property
    def velocity(self) -> FloatArray:
        """Forward, lateral, turning speed, shape (3,), a copy."""
        return self.state[3:6].copy()

    @property
    def forward_mps(self) -> float:
        """Forward speed, m/s."""
        return float(self.state[FORWARD])

    @property
    def wheel_scale(self) -> float:
        """What wheels measure over what the machine drives, as learned."""
        return float(self.state[SCALE])

    @property
    def step_forward_m(self) -> float:
        """Forward part of the step just predicted, wheels fused so far included."""
        heading = self.state[2] - 0.5 * self._displacement[2]
        return float(math.cos(heading) * self._displacement[0] + math.sin(heading) * self._displacement[1])

    @property
    def measured(self) -> bool:
        """Whether wheels measured both travel and turn of the step just predicted, and agree with the motion before."""
        return {FORWARD, TURNING} <= self._measured

    @property
    def after_gap(self) -> bool:
        """Whether the step just predicted was longer than the model runs for."""
        return self._step_s > _LONGEST_STEP_S

    @property
    def prior_information(self) -> FloatArray:
        """Inverse of the pose's covariance, shape (3, 3)."""
        return motion_filter.pose_information(self.P)

    def predict(self, dt_s: float) -> None:
        """Move on by `dt_s`. After a long gap the old speed says little: the model runs for a second at most."""
        model_s = min(dt_s, _LONGEST_STEP_S)
        self._displacement, self._joint = motion_filter.predict(self.state, self.P, model_s, self._accelerations)
        self._step_s, self._measured = dt_s, set()
        if dt_s > _LONGEST_STEP_S:
            self._joint[3:6, 3:6] += _GAP_VARIANCE
            self.P[:, :] = self._joint[:7, :7]

    def begin_measurement(self, axis: int) -> tuple[float, FloatArray]:
        """Return the time (s) of the step just predicted and the direction (3,) of an axis in it, for a measured mean speed.

        After a gap the model tells nothing along it.
        """
        dt_s, heading = max(self._step_s, _SHORTEST_STEP_S), self.state[2] - 0.5 * self._displacement[2]
        direction = np.array([math.cos(heading), math.sin(heading), 0.0] if axis == FORWARD else [0.0, 0.0, 1.0])
        if dt_s > _LONGEST_STEP_S:
            self._open(direction, _GAP_VARIANCE[axis - FORWARD, axis - FORWARD] * dt_s**2)
        return dt_s, direction

    def measure(
        self, direction: FloatArray, measured: float, variance: float, scaled: bool, gate_sigmas: float
    ) -> bool:
        """Fuse a displacement measured along a direction; return whether it was within the gate, else nothing changes."""
        nis = motion_filter.update_displacement(
            self.state, self._joint, self._displacement, direction, measured, variance, scaled, gate_sigmas
        )
        self.P[:, :] = self._joint[:7, :7]
        return bool(nis <= gate_sigmas**2)

    def note_measured(self, axis: int) -> None:
        """Take it that the step just predicted was measured along an axis."""
        self._measured.add(axis)

    def believe_speed(self, direction: FloatArray, measured: float, sigma: float) -> None:
        """Believe a measured speed against the model: the displacement of this step was predicted wrongly, too."""
        dt_s = max(self._step_s, _SHORTEST_STEP_S)
        self._open(direction, (measured * dt_s - float(direction @ self._displacement)) ** 2)
        motion_filter.update_displacement(
            self.state,
            self._joint,
            self._displacement,
            direction,
            measured * dt_s,
            (sigma * dt_s) ** 2,
            False,
            math.inf,
        )
        self._joint[FORWARD, FORWARD] += (measured - float(self.state[FORWARD])) ** 2
        motion_filter.update_speed(self.state, self._joint, FORWARD, measured, sigma**2, False, math.inf)
        self.P[:, :] = self._joint[:7, :7]

    def _open(self, direction: FloatArray, variance: float) -> None:
        """Let the displacement along a direction be anything within a variance: the model does not tell it."""
        variance = variance if direction[2] == 0.0 else min(variance, math.pi**2)
        for rows in (slice(0, 3), slice(7, 10)):
            for columns in (slice(0, 3), slice(7, 10)):
                self._joint[rows, columns] += variance * np.outer(direction, direction)

    def correct(self, matched: FloatArray, information: FloatArray) -> None:
        """Take over the matched pose (3,), found under the prior, with the match's own `information` (3, 3)."""
        motion_filter.update_pose(self.state, self.P, matched, information, self.held)

    def distrust_velocity(self, velocity: FloatArray) -> None:
        """Go on with this velocity (3,), hardly known: that of a jump holds errors of the poses before and would run away."""
        self.state[FORWARD : TURNING + 1] = velocity
        self.P[FORWARD : TURNING + 1, :] = 0.0
        self.P[:, FORWARD : TURNING + 1] = 0.0
        self.P[FORWARD : TURNING + 1, FORWARD : TURNING + 1] = _DISTRUSTED_VARIANCE

    def forget(self, share: float) -> None:
        """Shrink the pose's uncertainty by a share: what it is relative to was renewed."""
        motion_filter.forget_pose(self.P, share)

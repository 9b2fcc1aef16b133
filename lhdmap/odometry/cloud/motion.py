"""The motion model in space: a Kalman filter of the pose of `base_link` and its velocity at constant velocity.

Twists are (rotation, translation) in body axes, shape (6,): rad and m, or rad/s and m/s. Errors of a pose are such
twists on its right: T_true = T exp(error).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se3
from lhdmap.geometry.twist import adjoint, exp, log, orthonormal, skew
from lhdmap.messages import FloatArray
from lhdmap.odometry.cloud.settings import CloudOdometrySettings

_GATE_SIGMAS = 4.0  # wheels that are farther off than one in ten thousand by chance slip
_LONGEST_STEP_S = 3.0  # a machine brakes to rest within it: after a longer gap the old velocity says little
_GAP_VARIANCE = np.diag(
    [0.01, 0.01, 0.5, 4.0, 0.1, 0.1]
)  # of the velocity after a gap, as in the plane; hardly any tilt
_JUMP_VARIANCE = np.diag(
    [1e-4] * 3 + [1e-2] * 3
)  # of the pose after a jump: half a degree, 10 cm, what one match gives
# Of pose and velocity at the start: the pose defines `odom`, the machine may drive already (3 m/s, 0.7 rad/s).
_STARTING_VARIANCES = [1e-10] * 3 + [1e-8] * 3 + [0.05, 0.05, 0.5, 9.0, 0.25, 0.05]
_PLANAR = [3, 4, 2]  # forward, lateral, heading as components of a twist


class CloudPrior(NamedTuple):
    """Motion of `base_link` since the cloud before by wheels: `T_previous_base` (4, 4).

    `covariance`: (6, 6) in the order rotation, translation (rad, m), or (3, 3) of forward, lateral (m) and heading
    (rad) for wheels that know nothing of the rest.
    """

    T_previous_base: FloatArray
    covariance: FloatArray


class CloudMotion:
    """Pose of `base_link` in `odom`, velocity in body axes, and their covariance `P` (12, 12), pose first.

    The pose's covariance is relative to the local map: what a cloud can still correct.
    """

    def __init__(self, settings: CloudOdometrySettings) -> None:
        s = settings
        density = (
            [s.tilting_acceleration] * 2 + [s.turning_acceleration, s.forward_acceleration] + [s.side_acceleration] * 2
        )
        self._noise = np.diag(np.square(density))
        self._tilt_variance = math.radians(s.tilt_sigma_deg) ** 2
        self.pose: FloatArray = np.eye(4)
        self.twist: FloatArray = np.zeros(6)
        self.P: FloatArray = np.diag(_STARTING_VARIANCES)

    @property
    def prior_information(self) -> FloatArray:
        """Inverse of the pose's covariance, shape (6, 6)."""
        return np.asarray(np.linalg.inv(self.P[:6, :6] + 1e-14 * np.eye(6)), dtype=np.float64)

    def predict(self, dt_s: float) -> None:
        """Move on by `dt_s`. After a long gap the old velocity says little: the model runs for three seconds at most."""
        dt = min(dt_s, _LONGEST_STEP_S)
        step = exp(self.twist * dt)
        self.pose = orthonormal(self.pose @ step)
        F = np.eye(12)
        F[:6, :6] = adjoint(se3.inverse(step))
        F[:6, 6:] = dt * np.eye(6)
        self.P = F @ self.P @ F.T
        # white acceleration over dt: the exact covariance of (displacement, velocity)
        self.P += np.kron(np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]]), self._noise)
        if dt_s > _LONGEST_STEP_S:
            self.P[6:, 6:] += _GAP_VARIANCE

    def fuse_prior(self, prior: CloudPrior, dt_s: float) -> bool:
        """Fuse the wheels' motion over `dt_s` as a velocity; False where its forward part contradicts it (slip).

        Components that are not finite, or off by more than the gate, are left out.
        """
        measured = _measured(prior, dt_s)
        if measured is None:
            return False
        axes, values, covariance = measured
        innovation = values - self.twist[axes]
        S = self.P[np.ix_(6 + axes, 6 + axes)] + covariance
        kept = np.abs(innovation) <= _GATE_SIGMAS * np.sqrt(np.diag(S))
        if not kept.any():
            return False
        H = np.zeros((int(kept.sum()), 12))
        H[np.arange(len(H)), 6 + axes[kept]] = 1.0
        self._update(H, innovation[kept], covariance[np.ix_(kept, kept)])
        return bool(3 in axes[kept])

    def fuse_tilt(self, T_level_base: FloatArray) -> None:
        """Fuse roll and pitch: the direction of gravity in the body."""
        seen, expected = T_level_base[2, :3], self.pose[2, :3]
        if not np.isfinite(seen).all():
            return
        H = np.zeros((3, 12))
        H[:, :3] = skew(expected)
        self._update(H, seen - expected, self._tilt_variance * np.eye(3))

    def correct(self, matched: FloatArray, information: FloatArray) -> None:
        """Take over the matched pose (4, 4), found under the prior, with the match's own `information` (6, 6)."""
        prior = self.P[:6, :6] + 1e-14 * np.eye(6)
        posterior = np.linalg.inv(np.linalg.inv(prior) + information)
        A = np.linalg.solve(prior, self.P[:6, :]).T  # regression of the whole state on its pose
        self.twist = self.twist + (A @ log(se3.inverse(self.pose) @ matched))[6:]
        self.pose = orthonormal(matched)
        self._set_covariance(self.P + A @ (posterior - prior) @ A.T)

    def relocate(self, pose: FloatArray) -> None:
        """Go on from another pose (4, 4) with the velocity as it was: what jumped was not the machine."""
        self.pose = orthonormal(pose)
        self.P[:6, :] = self.P[:, :6] = 0.0
        self.P[:6, :6] = _JUMP_VARIANCE

    def forget(self, share: float) -> None:
        """Shrink the pose's uncertainty by a share: what it is relative to was renewed."""
        keep = math.sqrt(max(1.0 - share, 0.0))
        self.P[:6, :] *= keep
        self.P[:, :6] *= keep

    def _update(self, H: FloatArray, innovation: FloatArray, noise: FloatArray) -> None:
        gain = np.linalg.solve(H @ self.P @ H.T + noise, H @ self.P).T
        delta = gain @ innovation
        self.pose = orthonormal(self.pose @ exp(delta[:6]))
        self.twist = self.twist + delta[6:]
        self._set_covariance(self.P - gain @ H @ self.P)

    def _set_covariance(self, P: FloatArray) -> None:
        self.P = 0.5 * (P + P.T) + 1e-14 * np.eye(12)


def _measured(
    prior: CloudPrior, dt_s: float
) -> tuple[np.ndarray[tuple[int], np.dtype[np.intp]], FloatArray, FloatArray] | None:
    """Return the axes of the twist that the prior knows, their speeds and covariance; None where it says nothing."""
    T, covariance = prior
    planar = covariance.shape == (3, 3)
    if dt_s <= 0.0 or T.shape != (4, 4) or not (planar or covariance.shape == (6, 6)):
        return None
    if not (np.isfinite(T).all() and np.isfinite(covariance).all() and (np.diag(covariance) >= 0.0).all()):
        return None
    axes = np.array(_PLANAR if planar else range(6), dtype=np.intp)
    return axes, log(T)[axes] / dt_s, (covariance + 1e-10 * np.eye(len(axes))) / dt_s**2

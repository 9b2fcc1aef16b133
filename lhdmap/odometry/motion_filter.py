"""The motion's prediction: a Kalman filter of planar pose, body velocity and tachometer scale.

State, shape (7,): x, y, heading in `odom` (m, rad); forward, lateral, turning speed of the body (m/s, rad/s); scale of the
wheels' speed. The pose's covariance is relative to the local map: what a scan can still correct.

Wheels measure the displacement since the scan before. It is no part of the state, but correlated with it: right after a
prediction it stands behind it, as rows 7 to 9 of a joint covariance (10, 10). At 50 Hz a speed would do as well; at 1 Hz it says
nothing of where the machine has come to.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray

SIZE = 7  # of the state
# Variances at the start. The pose defines `odom`: hardly any, but the covariance stays invertible. Speeds: a machine that drives
# when the log begins does 3 m/s, slips 0.5 m/s sideways, turns 0.7 rad/s. Scale: 2 %, worn tyres.
_STARTING_VARIANCES = np.array([1e-8, 1e-8, 1e-10, 9.0, 0.25, 0.5, 4e-4])
_SCALE_WALK = 1e-7  # 1/s: the wheels' scale drifts by 2 % in an hour, as tyres warm up


@nb.njit(cache=True)
def initial(pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return state (7,) and covariance (7, 7) at the start: pose known by definition, velocity not."""
    state = np.zeros(SIZE)
    state[:3] = pose
    state[6] = 1.0
    return state, np.diag(_STARTING_VARIANCES)


@nb.njit(cache=True)
def predict(state: FloatArray, P: FloatArray, dt_s: float, acceleration: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Move state and covariance on by `dt_s` at constant body velocity, in place; return displacement (3,) and joint covariance.

    `acceleration`, shape (3,): square roots of the spectral densities of forward, lateral (m/s²/√Hz) and turning acceleration.
    """
    middle = state[2] + 0.5 * state[5] * dt_s
    c, s = math.cos(middle), math.sin(middle)
    dx, dy = (c * state[3] - s * state[4]) * dt_s, (s * state[3] + c * state[4]) * dt_s
    F = np.eye(SIZE)
    F[0, 2], F[1, 2] = -dy, dx
    F[0, 3], F[0, 4], F[0, 5] = c * dt_s, -s * dt_s, -0.5 * dy * dt_s
    F[1, 3], F[1, 4], F[1, 5] = s * dt_s, c * dt_s, 0.5 * dx * dt_s
    F[2, 5] = dt_s
    state[0] += dx
    state[1] += dy
    state[2] = (state[2] + state[5] * dt_s + math.pi) % (2.0 * math.pi) - math.pi
    FP = F @ P
    before = P[:3, :3].copy()
    P[:, :] = FP @ F.T
    G = np.zeros((SIZE, 3))
    G[0, 0], G[0, 1], G[1, 0], G[1, 1], G[2, 2] = c, -s, s, c, 1.0
    # A turn that is not predicted bends the path: cov(sideways, turn) = q v dt^4 / 8.
    G[0, 2], G[1, 2] = -0.375 * dy, 0.375 * dx
    for axis in range(3):
        q = acceleration[axis] ** 2
        # white acceleration over dt: the exact covariance of (displacement, velocity)
        for i in range(3):
            for j in range(3):
                P[i, j] += G[i, axis] * G[j, axis] * q * dt_s**3 / 3.0
            P[i, 3 + axis] += G[i, axis] * q * dt_s**2 / 2.0
            P[3 + axis, i] += G[i, axis] * q * dt_s**2 / 2.0
        P[3 + axis, 3 + axis] += q * dt_s
    P[6, 6] += _SCALE_WALK * dt_s
    joint = np.empty((SIZE + 3, SIZE + 3))
    joint[:SIZE, :SIZE] = P
    joint[:SIZE, SIZE:] = P[:, :3] - FP[:, :3]
    joint[SIZE:, :SIZE] = joint[:SIZE, SIZE:].T
    joint[SIZE:, SIZE:] = joint[:3, SIZE:] - FP[:3, :3].T + before
    return np.array([dx, dy, state[5] * dt_s]), joint


@nb.njit(cache=True)
def update_speed(
    state: FloatArray, P: FloatArray, axis: int, measured: float, variance: float, scaled: bool, gate: float
) -> float:
    """Fuse one measured body speed (axis 3 forward, 4 lateral, 5 turning), in place; return its squared normalised innovation.

    `P`: of the state, or the joint covariance. With `scaled` the measurement is `state[6]` times the speed. Beyond `gate`
    (sigmas) the measurement is left out.
    """
    h = np.zeros(P.shape[0])
    h[axis] = state[6] if scaled else 1.0
    if scaled:
        h[6] = state[axis]
    Ph = P @ h
    innovation = measured - (state[6] if scaled else 1.0) * state[axis]
    S = h @ Ph + variance
    nis = innovation * innovation / S
    if nis <= gate * gate:
        gain = Ph / S
        state += gain[:SIZE] * innovation
        P -= np.outer(gain, Ph)
    return nis


@nb.njit(cache=True)
def update_displacement(
    state: FloatArray, joint: FloatArray, displacement: FloatArray, direction: FloatArray, measured: float, variance: float,
    scaled: bool, gate: float,
) -> float:  # fmt: skip
    """Fuse the measured part of the displacement (3,) along `direction` (3,), in place; return its squared normalised innovation.

    With `scaled` the measurement is `state[6]` times that part. Beyond `gate` (sigmas) it is left out.
    """
    length, scale = float(direction @ displacement), state[6] if scaled else 1.0
    h = np.zeros(SIZE + 3)
    h[SIZE:] = scale * direction
    if scaled:
        h[6] = length
    Jh = joint @ h
    innovation = measured - scale * length
    S = float(h @ Jh) + variance
    nis = innovation * innovation / S
    if nis <= gate * gate:
        gain = Jh / S
        state += gain[:SIZE] * innovation
        state[2] = (state[2] + math.pi) % (2.0 * math.pi) - math.pi
        displacement += gain[SIZE:] * innovation
        joint -= np.outer(gain, Jh)
    return nis


@nb.njit(cache=True)
def update_pose(
    state: FloatArray, P: FloatArray, matched: FloatArray, information: FloatArray, scale_learned: bool = True
) -> None:
    """Fuse the matched pose in place: `matched` is the maximum a posteriori pose (prior and scan), `information` the scan's own.

    The pose block moves to `matched`; the rest of the state follows through its covariance with the pose. The wheels' scale is
    only considered where it is not to be learned (Schmidt's filter): smooth walls pull on every scan alike.
    """
    scale, variance = state[6], P[6, 6]
    prior = P[:3, :3].copy()
    posterior = np.linalg.inv(np.linalg.inv(prior) + information)
    correction = matched - state[:3]
    correction[2] = (correction[2] + math.pi) % (2.0 * math.pi) - math.pi
    A = np.ascontiguousarray(P[:, :3]) @ np.linalg.inv(prior).T.copy()  # regression of the state on its pose
    state += A @ correction
    state[2] = (state[2] + math.pi) % (2.0 * math.pi) - math.pi
    P += A @ np.ascontiguousarray(posterior - prior) @ A.T
    P[:, :] = 0.5 * (P + P.T)
    if not scale_learned:
        state[6], P[6, 6] = scale, variance


@nb.njit(cache=True)
def pose_information(P: FloatArray) -> FloatArray:
    """Return the inverse of the pose's covariance, shape (3, 3)."""
    information: FloatArray = np.linalg.inv(np.ascontiguousarray(P[:3, :3]) + 1e-12 * np.eye(3)).astype(np.float64)
    return information


@nb.njit(cache=True)
def forget_pose(P: FloatArray, share: float) -> None:
    """Shrink the pose's uncertainty by `share`: the map that it is relative to is renewed at the pose itself."""
    keep = math.sqrt(max(1.0 - share, 0.0))
    for i in range(3):
        P[i, :] *= keep
        P[:, i] *= keep

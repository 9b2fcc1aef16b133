"""Eq. (1)-(2) of the paper integrated over sampled speed and articulation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

# These kernels take microseconds: to release the interpreter's lock would cost more than they do.
STEP_NS = 10_000_000  # of the integration: 7 cm at 24 km/h
Stamps = npt.NDArray[np.int64]
Samples = tuple[Stamps, FloatArray]


@nb.njit(cache=True)
def interpolate(stamps_ns: Stamps, values: FloatArray, at_ns: int) -> float:
    """Return the value at a time by linear interpolation; before the first and after the last sample these are held."""
    after = np.searchsorted(stamps_ns, at_ns)
    if after == 0:
        return values[0]
    if after == stamps_ns.shape[0]:
        return values[-1]
    share = (at_ns - stamps_ns[after - 1]) / (stamps_ns[after] - stamps_ns[after - 1])
    return values[after - 1] + share * (values[after] - values[after - 1])


@nb.njit(cache=True)
def value_at(stamps_ns: Stamps, values: FloatArray, at_ns: int, limits_ns: tuple[int, int]) -> float:
    """Return the value at a time, NaN where the samples do not cover it; `limits_ns`: gap and hold as in `covered`."""
    return interpolate(stamps_ns, values, at_ns) if covered(stamps_ns, (at_ns, at_ns), *limits_ns) else math.nan


@nb.njit(cache=True)
def values_at(stamps_ns: Stamps, values: FloatArray, at_ns: Stamps, limits_ns: tuple[int, int]) -> FloatArray:
    """Return the values at many times, shape (M,), each as `value_at`."""
    out = np.empty(at_ns.shape[0])
    for m in range(at_ns.shape[0]):
        out[m] = value_at(stamps_ns, values, at_ns[m], limits_ns)
    return out


class DriveErrors(NamedTuple):
    """What is believed of the sensors, standard deviations.

    A constant error of the articulation (rad), its noise as it turns the front body (rad), scale (1) and noise (m/s) of the
    tachometer, side slip (m/m).
    """

    articulation_rad: float
    heading_noise_rad: float
    scale: float
    speed_mps: float
    side_slip: float


@nb.njit(cache=True)
def drive(
    speed: Samples,
    articulation: Samples,
    span_ns: tuple[int, int],
    lengths_m: tuple[float, float],
    scale: float,
    errors: DriveErrors,
) -> tuple[FloatArray, FloatArray]:
    """Return the motion of `integrate_motion`, shape (3,), and its covariance, shape (3, 3)."""
    delta, path_m, lever = integrate_motion(speed, articulation, span_ns, lengths_m, scale)
    heading = math.hypot(lever * errors.articulation_rad, errors.heading_noise_rad)
    along = math.hypot(errors.scale * path_m, errors.speed_mps * (span_ns[1] - span_ns[0]) / 1e9)
    return delta, motion_covariance(along, errors.side_slip * path_m, heading, delta)


@nb.njit(cache=True)
def integrate_motion(
    speed: Samples, articulation: Samples, span_ns: tuple[int, int], lengths_m: tuple[float, float], scale: float
) -> tuple[FloatArray, float, float]:
    """Return the motion of `base_link` over a span: d theta = (v sin(gamma) dt + L_r d gamma) / (L_f cos(gamma) + L_r).

    Args:
        speed: stamps (N,) and speeds of the front axle (N,), m/s.
        articulation: stamps (M,) and angles (M,), rad. Its rate is not needed: differences of the angle add up to the
            same without drift.
        span_ns: start and end.
        lengths_m: L_f and L_r.
        scale: factor of the speeds.

    Returns:
        x, y, heading in the frame at the start, shape (3,); length of the path, m; and the error of the heading for
        each radian of a constant error of gamma.
    """
    L_f, L_r = lengths_m
    pose, path, lever = np.zeros(3), 0.0, 0.0
    steps = max(-((span_ns[0] - span_ns[1]) // STEP_NS), 1)
    gamma = interpolate(articulation[0], articulation[1], span_ns[0])
    width_ns = (span_ns[1] - span_ns[0]) / steps
    for step in range(steps):
        middle_ns = span_ns[0] + int((step + 0.5) * width_ns)
        next_gamma = interpolate(articulation[0], articulation[1], span_ns[0] + int((step + 1) * width_ns))
        ds = scale * interpolate(speed[0], speed[1], middle_ns) * width_ns / 1e9
        c, s = math.cos(0.5 * (gamma + next_gamma)), math.sin(0.5 * (gamma + next_gamma))
        below = L_f * c + L_r
        turn = (ds * s + L_r * (next_gamma - gamma)) / below
        pose[0] += ds * math.cos(pose[2] + 0.5 * turn)
        pose[1] += ds * math.sin(pose[2] + 0.5 * turn)
        pose[2] += turn
        path += abs(ds)
        lever += ds * (c + s * s * L_f / below) / below
        gamma = next_gamma
    return pose, path, abs(lever)


@nb.njit(cache=True)
def covered(stamps_ns: Stamps, span_ns: tuple[int, int], gap_ns: int, hold_ns: int) -> bool:
    """Return whether samples go from start to end of a span without a long gap; those at the ends hold for a while."""
    n = stamps_ns.shape[0]
    if n == 0 or span_ns[0] < stamps_ns[0] - hold_ns or span_ns[1] > stamps_ns[n - 1] + hold_ns:
        return False
    i, above = 0, n  # the last sample at or before the start, by bisection
    while above - i > 1:
        middle = (i + above) // 2
        if stamps_ns[middle] <= span_ns[0]:
            i = middle
        else:
            above = middle
    while i < n - 1 and stamps_ns[i] < span_ns[1]:
        if stamps_ns[i + 1] - stamps_ns[i] > gap_ns:
            return False
        i += 1
    return True


@nb.njit(cache=True)
def motion_covariance(along_m: float, across_m: float, heading_rad: float, delta: FloatArray) -> FloatArray:
    """Return the covariance, shape (3, 3), of a motion (3,) from three independent errors, standard deviations.

    The heading error grows evenly along the way, so half of it acts across the chord and turns the end sideways.
    """
    c, s = math.cos(0.5 * delta[2]), math.sin(0.5 * delta[2])
    a, b, h = along_m**2, across_m**2, heading_rad**2
    x, y = -0.5 * delta[1], 0.5 * delta[0]
    out = np.empty((3, 3))
    out[0, 0] = a * c * c + b * s * s + h * x * x + 1e-10
    out[1, 1] = a * s * s + b * c * c + h * y * y + 1e-10
    out[0, 1] = out[1, 0] = (a - b) * c * s + h * x * y
    out[0, 2] = out[2, 0] = h * x
    out[1, 2] = out[2, 1] = h * y
    out[2, 2] = h + 1e-10
    return out

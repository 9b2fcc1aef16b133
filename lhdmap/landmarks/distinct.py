"""Where a tunnel is not distinctive: a length of its walls is found again, nearly as well, at another place of the same tunnel.

Each window of the profile is laid over all other places, in both directions. A place costs half the sum of squared differences
over their variance (those of both bins, the wall's slope times a half bin, 5 mm), truncated at 3 sigma, tempered by a third, as
neighbouring bins are not independent; one is taken off each, which is what the right place costs. The least cost is the gap, in
nats. The turn of the mid line over 2 m is a third channel. All windows along one lag are one running sum: time grows with the
square of the tunnel's length (1 km: about a second), memory with its length.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from lhdmap.landmarks.profile import WallProfile
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.messages import Float32Array, FloatArray

APART_M = 2.0
"""A place nearer than this is no other place."""
_TURN_M, _TURN_STD_RAD = 2.0, 0.005
_SLOPE_M, _BASE_M = 0.05, 0.005
TRUNCATED, TEMPER = 9.0, 1.0 / 3.0
_LEAST_M = 0.5

Stretches = list[tuple[float, float]]


def gaps(profile: WallProfile, settings: LandmarkSettings) -> Float32Array:
    """Return for each bin (P,) how much less likely the most similar other place is for the window around it, nats.

    inf where there is no other place for the window.
    """
    n = len(profile.at_m)
    window = max(round(settings.distinct_m / settings.profile_m), 1)
    best = np.full(n, np.inf)
    if n > window:
        smooth_bins = settings.smooth_m / settings.profile_m
        weights = np.array([1.0, 1.0, 1.0 / smooth_bins])
        apart = round(APART_M / settings.profile_m)
        values, variances = channels(profile, settings.profile_m)
        _slide(values, variances, weights, window, apart, best)
        best[: window // 2] = best[window // 2]
        best[n - window + window // 2 + 1 :] = best[n - window + window // 2]
    return best.astype(np.float32)


def reduced_chi2(one: WallProfile, other: WallProfile, settings: LandmarkSettings) -> float:
    """Return the mean of the truncated squared differences of two profiles of one tunnel over their variance; NaN without any."""
    if min(len(one.at_m), len(other.at_m)) < 2:
        return float("nan")
    (a, a_var), (b, b_var) = (channels(profile, settings.profile_m) for profile in (one, other))
    inside = (one.at_m >= other.at_m.min()) & (one.at_m <= other.at_m.max())
    b, b_var = (
        np.column_stack([np.interp(one.at_m, other.at_m, column) for column in columns.T[:2]]) for columns in (b, b_var)
    )
    x = np.minimum((a[:, :2] - b) ** 2 / (a_var[:, :2] + b_var), TRUNCATED)[inside]
    return float(x[np.isfinite(x)].mean()) if np.isfinite(x).any() else float("nan")


def not_distinctive(at_m: Float32Array, gap: Float32Array, least: float) -> Stretches:
    """Return the stretches [from, to] (m) whose gap (P,) is under `least`; what is shorter than half a metre is left out."""
    low = gap < least
    edges = np.diff(np.concatenate([[False], low, [False]]).astype(np.int8))
    runs = zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1, strict=True)
    found = [(float(at_m[first]), float(at_m[last])) for first, last in runs]
    return [one for one in found if one[1] - one[0] >= _LEAST_M]


def channels(profile: WallProfile, step_m: float, noise: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Return values and variances (P, 3): left and right wall, turn of the mid line; NaN where not known.

    `noise`: factor of what of the walls' variance is not due to their slope.
    """
    values, variances = [], []
    for wall, variance in ((profile.left_m, profile.left_var), (profile.right_m, profile.right_var)):
        distance = wall.astype(np.float64)
        slope = np.abs(np.gradient(distance, step_m))
        values.append(distance)
        variances.append(noise * (variance + 0.5 * _BASE_M**2) + (slope * _SLOPE_M) ** 2)
    half = max(round(0.5 * _TURN_M / step_m), 1)
    heading, turn = profile.heading_rad.astype(np.float64), np.full(len(profile.at_m), np.nan)
    if len(heading) > 2 * half:
        turn[half:-half] = heading[2 * half :] - heading[: -2 * half]
    values.append(turn)
    variances.append(np.full(len(turn), _TURN_STD_RAD**2))
    return np.column_stack(values), np.column_stack(variances)


@nb.njit(cache=True, nogil=True, inline="always")
def _cost(values, variances, weights, a, b, turned):  # type: ignore[no-untyped-def]
    """Return what bin `a` costs at bin `b`, over what it would at its own place; `turned`: seen the other way."""
    total = 0.0
    for channel in range(3):
        other = (1 - channel if channel < 2 else 2) if turned else channel
        theirs = -values[b, other] if turned and channel == 2 else values[b, other]
        d = values[a, channel] - theirs
        x = d * d / (variances[a, channel] + variances[b, other])
        if x == x:
            total += weights[channel] * (min(x, TRUNCATED) - 1.0)
    return 0.5 * TEMPER * total


@nb.njit(cache=True, nogil=True)
def _slide(values, variances, weights, window, apart, best):  # type: ignore[no-untyped-def]
    """Lower the gap of each window's middle bin to the least cost over all other places."""
    n, half = values.shape[0], window // 2
    costs = np.empty(n)
    for lag in range(apart, n - window + 1):
        running = 0.0
        for k in range(n - lag):
            costs[k] = _cost(values, variances, weights, k, k + lag, False)
            running += costs[k]
            if k >= window:
                running -= costs[k - window]
            if k >= window - 1:
                middle = k - window + 1 + half
                best[middle] = min(best[middle], running)
                best[middle + lag] = min(best[middle + lag], running)
    for both in range(window - 1, 2 * n - window):
        first, last = max(both - n + 1, 0), min(both, n - 1)
        running = 0.0
        for k in range(first, last + 1):
            costs[k] = _cost(values, variances, weights, k, both - k, True)
            running += costs[k]
            if k - first >= window:
                running -= costs[k - window]
            if k - first >= window - 1:
                middle = k - window + 1 + half
                if abs(both - 2 * middle) >= apart:
                    best[middle] = min(best[middle], running)

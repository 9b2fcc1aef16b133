"""Local quadratic regression in time: values at any moment from the noisy samples on both sides of it."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray

# No nogil: one moment takes microseconds, to release the interpreter's lock would cost more.
Stamps = npt.NDArray[np.int64]


@nb.njit(cache=True)
def fit_at(
    stamps_ns: Stamps, rows: FloatArray, at_ns: Stamps, half_window_s: float, max_gap_s: float, rate_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return the values at the times `at_ns` and how much of the samples' noise is left in them.

    Args:
        stamps_ns: shape (N,), rising.
        rows: shape (N, K), the samples.
        at_ns: shape (M,), in any order.
        half_window_s: samples within this of a time take part, weighted 1 - u^2 (Epanechnikov).
        max_gap_s: largest distance of the samples on both sides of a time, and of a time outside of all samples.
        rate_s: this many seconds' worth of the derivative is added to the value (0: the value alone).

    Returns:
        values, shape (M, K), and noise factors, shape (M,); NaN where there is nothing to go by. The degree is two
        where the samples lie on both sides, else one; with too few samples the neighbours are interpolated.
    """
    values = np.full((at_ns.shape[0], rows.shape[1]), np.nan)
    factors = np.full(at_ns.shape[0], np.nan)
    half_ns = np.int64(half_window_s * 1e9)
    for m in range(at_ns.shape[0]):
        after = np.searchsorted(stamps_ns, at_ns[m])
        if not _bridged(stamps_ns, after, at_ns[m], max_gap_s):
            continue
        first = np.searchsorted(stamps_ns, at_ns[m] - half_ns)
        last = np.searchsorted(stamps_ns, at_ns[m] + half_ns, side="right")
        weights = _weights(stamps_ns[first:last], at_ns[m], half_window_s, rate_s)
        if weights.shape[0] == 0:
            first, weights = _neighbours(stamps_ns, after, at_ns[m])
        values[m] = 0.0
        square = 0.0
        for i in range(weights.shape[0]):
            for column in range(rows.shape[1]):
                values[m, column] += weights[i] * rows[first + i, column]
            square += weights[i] * weights[i]
        factors[m] = math.sqrt(square)
    return values, factors


@nb.njit(cache=True)
def _bridged(stamps_ns: Stamps, after: int, at_ns: int, max_gap_s: float) -> bool:
    """Return whether the samples next to a time are near enough; `after`: index of the first one not before it."""
    n = stamps_ns.shape[0]
    if n == 0:
        return False
    before = max(after - 1, 0) if after == n or stamps_ns[after] != at_ns else after
    following = min(after, n - 1)
    if before == following:
        return abs(stamps_ns[before] - at_ns) <= max_gap_s * 1e9
    return stamps_ns[following] - stamps_ns[before] <= max_gap_s * 1e9


@nb.njit(cache=True)
def _neighbours(stamps_ns: Stamps, after: int, at_ns: int) -> tuple[int, FloatArray]:
    """Return the first index and the weights of linear interpolation; outside of all samples the nearest one alone."""
    if after == 0 or after == stamps_ns.shape[0]:
        return min(after, stamps_ns.shape[0] - 1), np.ones(1)
    share = (at_ns - stamps_ns[after - 1]) / (stamps_ns[after] - stamps_ns[after - 1])
    return after - 1, np.array([1.0 - share, share])


@nb.njit(cache=True)
def _weights(stamps_ns: Stamps, at_ns: int, half_window_s: float, rate_s: float) -> FloatArray:
    """Return the weights with which the samples enter the fitted value, shape (N,); none where no fit is possible."""
    n = stamps_ns.shape[0]
    none = np.empty(0)
    if n < 3 or half_window_s <= 0.0:
        return none
    u = np.empty(n)
    kernel = np.empty(n)
    for i in range(n):
        u[i] = (stamps_ns[i] - at_ns) / 1e9 / half_window_s
        kernel[i] = max(1.0 - u[i] * u[i], 1e-3)
    quadratic = n >= 5 and u[0] < -0.5 and u[n - 1] > 0.5
    s = np.zeros(5)
    for i in range(n):
        power = kernel[i]
        for k in range(5):
            s[k] += power
            power *= u[i]
    c = _coefficients(s, quadratic, rate_s / half_window_s)
    if not np.isfinite(c[0]):
        return none
    return kernel * (c[0] + c[1] * u + c[2] * u * u)


@nb.njit(cache=True)
def _coefficients(s: FloatArray, quadratic: bool, rate: float) -> FloatArray:
    """Return the solution c of [[s0 s1 s2] [s1 s2 s3] [s2 s3 s4]] c = (1, rate, 0), shape (3,); NaN where singular."""
    if quadratic:
        a, b, c = s[2] * s[4] - s[3] * s[3], s[2] * s[3] - s[1] * s[4], s[1] * s[3] - s[2] * s[2]
        d, e = s[0] * s[4] - s[2] * s[2], s[1] * s[2] - s[0] * s[3]
        det = s[0] * a + s[1] * b + s[2] * c
    else:
        a, b, c, d, e = s[2], -s[1], 0.0, s[0], 0.0
        det = s[0] * s[2] - s[1] * s[1]
    if det <= 1e-12 * s[0] * s[0]:
        return np.full(3, np.nan)
    return np.array([a + rate * b, b + rate * d, c + rate * e]) / det

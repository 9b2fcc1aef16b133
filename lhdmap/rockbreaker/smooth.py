"""A smooth timing that uses the flow all along the path: what the paper names as future work.

1. The fastest σ̇(σ) under a curve and a limit of |σ̈|: one pass forwards, one backwards, which is exact for a constant limit.
2. In time, the mean over a window: σ̈ becomes continuous, |σ⃛| ≤ the change of σ̈ over the window, and |σ̈| does not grow.
3. The mean cuts corners, so σ̇ may exceed the curve: it is lowered where it did, and the three steps are repeated. What is left
   in the end is taken out by slowing down as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray

_STEPS = 4000
_ROUNDS = 12
_WIDER = 4


@dataclass(frozen=True, slots=True)
class Sampled:
    """A timing from rest to rest over even cells of time: σ̇ as a quadratic B-spline, so that σ̈ is continuous within a cell too.

    `rate` are its control points (N,), one a cell, zero before and after; `sigma` its integral at the edges of the cells (N + 1,).
    |σ̈| and |σ⃛| are at most the first and second differences of the control points.
    """

    step_s: float
    sigma: FloatArray
    rate: FloatArray

    @property
    def duration_s(self) -> float:
        """Time from rest to rest."""
        return self.step_s * len(self.rate)

    def __call__(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return σ and σ̇ (N,) at times (N,) in [0, t_f]."""
        at = np.clip(t_s / self.step_s, 0.0, float(len(self.rate)))
        cell = np.minimum(at.astype(np.int64), len(self.rate) - 1)
        padded = np.pad(self.rate, 1)
        before, here, after = padded[cell], padded[cell + 1], padded[cell + 2]
        slope, bend = 0.5 * (after - before), after - 2.0 * here + before
        w = at - cell - 0.5
        rate = here + 0.125 * bend + w * (slope + 0.5 * w * bend)
        passed = (here + 0.125 * bend) * (w + 0.5) + 0.5 * slope * (w**2 - 0.25) + bend * (w**3 + 0.125) / 6.0
        return np.clip(self.sigma[cell] + self.step_s * passed, 0.0, 1.0), np.maximum(rate, 0.0)

    def slower(self, factor: float) -> Sampled:
        """Return the same in `factor` times the time."""
        return Sampled(self.step_s * factor, self.sigma, self.rate / factor)


def smooth_timing(highest: FloatArray, peak_second: float, peak_third: float) -> Sampled:
    """Return a fast timing below σ̇ ≤ F(σ) on an even grid (N,) with |σ̈| and |σ⃛| at most the peaks, σ̈ continuous."""
    window_s = peak_second / peak_third
    timing = _filtered(highest, peak_second, window_s)
    for _ in range(_WIDER):
        excess = _third(timing) / peak_third
        if excess <= 1.0:
            break  # σ̈ does not go from one peak to the other within a window
        window_s *= min(1.01 * excess, 2.0)
        timing = _filtered(highest, peak_second, window_s)
    return _within_peaks(timing, peak_second, peak_third)


def _within_peaks(timing: Sampled, peak_second: float, peak_third: float) -> Sampled:
    """Return the timing slowed down as far as |σ̈| and |σ⃛| need it, which fall with the second and third power of time."""
    second = float(np.abs(np.diff(np.pad(timing.rate, 1))).max() / timing.step_s)
    return timing.slower(max((second / peak_second) ** 0.5, (_third(timing) / peak_third) ** (1.0 / 3.0), 1.0))


def _third(timing: Sampled) -> float:
    """Return the largest |σ⃛|."""
    return float(np.abs(np.diff(np.pad(timing.rate, 1), 2)).max() / timing.step_s**2)


@nb.njit(cache=True, nogil=True)
def _fastest(curve: FloatArray, peak: float) -> FloatArray:
    """Return the highest σ̇ (N,) under the curve with |σ̈| ≤ peak, from rest to rest: σ̇² rises by at most 2 peak dσ."""
    n = len(curve)
    gain = 2.0 * peak / (n - 1)
    squared = curve * curve
    squared[0] = squared[n - 1] = 0.0
    for k in range(1, n):
        squared[k] = min(squared[k], squared[k - 1] + gain)
    for k in range(n - 2, -1, -1):
        squared[k] = min(squared[k], squared[k + 1] + gain)
    return np.sqrt(squared)


@nb.njit(cache=True, nogil=True)
def _in_time(rate: FloatArray, steps: int) -> tuple[FloatArray, float]:
    """Return σ (steps + 1,) on an even grid of time, and its step, of σ̇ (N,) over an even grid of σ; σ̈ constant within a cell."""
    n = len(rate)
    cell = 1.0 / (n - 1)
    times = np.zeros(n)
    for k in range(1, n):
        times[k] = times[k - 1] + 2.0 * cell / max(rate[k] + rate[k - 1], 1e-12)
    step = times[-1] / steps
    sigma = np.empty(steps + 1)
    node = 0
    for k in range(steps + 1):
        t = k * step
        while node < n - 2 and times[node + 1] < t:
            node += 1
        span = times[node + 1] - times[node]
        u = min(max(t - times[node], 0.0), span)
        sigma[k] = node * cell + rate[node] * u + 0.5 * (rate[node + 1] - rate[node]) / span * u * u
    return sigma, step


@nb.njit(cache=True, nogil=True)
def _mean(sigma: FloatArray, width: int) -> FloatArray:
    """Return σ (N + width,) as the mean of the last `width` steps (trapezoid), before the start 0, after the end 1."""
    n = len(sigma)
    total = np.zeros(n + 2 * width)
    for k in range(1, n + 2 * width):
        here = sigma[min(max(k - width, 0), n - 1)]
        before = sigma[min(max(k - 1 - width, 0), n - 1)]
        total[k] = total[k - 1] + 0.5 * (here + before)
    return (total[width:] - total[:-width]) / width


@nb.njit(cache=True, nogil=True)
def _filtered_once(curve: FloatArray, peak: float, window_s: float, steps: int) -> tuple[FloatArray, FloatArray, float]:
    """Return σ, σ̇ and the step of the smoothed fastest timing under the curve."""
    sharp, step = _in_time(_fastest(curve, peak), steps)
    width = max(int(np.ceil(window_s / step)), 1)
    sigma = _mean(sharp, width)
    rate = np.zeros(len(sigma))
    for k in range(1, len(sigma) - 1):
        rate[k] = (sigma[k + 1] - sigma[k - 1]) / (2.0 * step)
    return sigma, rate, step


@nb.njit(cache=True, nogil=True)
def _rounds(
    highest: FloatArray, peak: float, window_s: float, steps: int, rounds: int
) -> tuple[FloatArray, FloatArray, float]:
    """Lower the curve where the smoothed timing exceeds `highest`, round by round."""
    n = len(highest)
    curve = highest.copy()
    sigma, rate, step = _filtered_once(curve, peak, window_s, steps)
    for _ in range(rounds):
        worst = np.ones(n)
        for k in range(len(sigma)):
            at = min(sigma[k] * (n - 1), n - 1.0)
            node = min(int(at), n - 2)
            share = at - node
            allowed = (1.0 - share) * highest[node] + share * highest[node + 1]
            ratio = rate[k] / allowed
            worst[node] = max(worst[node], ratio)
            worst[node + 1] = max(worst[node + 1], ratio)
        if worst.max() < 1.0002:
            break
        for k in range(n):
            curve[k] /= worst[k]
        sigma, rate, step = _filtered_once(curve, peak, window_s, steps)
    return sigma, rate, step


def _filtered(highest: FloatArray, peak_second: float, window_s: float) -> Sampled:
    _, rate, step_s = _rounds(highest, peak_second, window_s, _STEPS, _ROUNDS)
    padded = np.pad(rate, 1)
    sigma = np.concatenate([[0.0], np.cumsum(step_s * (padded[:-2] + 4.0 * rate + padded[2:]) / 6.0)])
    return Sampled(step_s, sigma / sigma[-1], rate / sigma[-1])

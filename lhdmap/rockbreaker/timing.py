"""Timing of a path under its limits: one interface, four laws σ(t).

A law is called with times (N,) and returns σ and σ̇ (N,); `slower(f)` is the same law in f times the time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, Self

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.flow import FlowCurve
from lhdmap.rockbreaker.profile import best_profile, best_ramp
from lhdmap.rockbreaker.smooth import smooth_timing

Timing = Literal["paper", "paper-best", "smooth", "limit"]


class TimeLaw(Protocol):
    """σ over time, from 0 to 1."""

    @property
    def duration_s(self) -> float:
        """Time from start to end."""

    def __call__(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return σ and σ̇ (N,) at times (N,) in [0, duration]."""

    def slower(self, factor: float) -> Self:
        """Return the same in `factor` times the time."""


@dataclass(frozen=True, slots=True)
class NoRamps:
    """The fastest that the limits allow if speed could jump: a bound for this path, not a motion. Nodes (N,) of t, σ and σ̇."""

    t_s: FloatArray
    sigma: FloatArray
    rate: FloatArray

    @property
    def duration_s(self) -> float:
        """Integral of dσ / F(σ)."""
        return float(self.t_s[-1])

    def __call__(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return σ and σ̇, linear in time between nodes; at rest at the very ends."""
        cell = np.clip(np.searchsorted(self.t_s, t_s, side="right") - 1, 0, len(self.t_s) - 2)
        since = t_s - self.t_s[cell]
        slope = (self.rate[cell + 1] - self.rate[cell]) / (self.t_s[cell + 1] - self.t_s[cell])
        sigma = np.minimum(self.sigma[cell] + since * (self.rate[cell] + 0.5 * slope * since), 1.0)
        rate = self.rate[cell] + slope * since
        return sigma, np.where((t_s <= 0.0) | (t_s >= self.duration_s), 0.0, rate)

    def slower(self, factor: float) -> NoRamps:
        """Return the same in `factor` times the time."""
        return NoRamps(self.t_s * factor, self.sigma, self.rate / factor)


def no_ramps(curve: FlowCurve, t_r_min_s: float) -> NoRamps:  # noqa: ARG001  # all timings are called alike
    """Return the no-ramp optimum σ̇ = F(σ)."""
    steps_s = 2.0 * np.diff(curve.sigma) / (curve.highest[1:] + curve.highest[:-1])
    return NoRamps(np.concatenate([[0.0], np.cumsum(steps_s)]), curve.sigma, curve.highest)


def paper(curve: FlowCurve, t_r_min_s: float) -> TimeLaw:
    """Return the paper's profile with t_r = t_r,min, Section 3.5."""
    return best_ramp(curve.highest, t_r_min_s)


def paper_best(curve: FlowCurve, t_r_min_s: float) -> TimeLaw:
    """Return the global optimum of the paper's family of profiles (erratum 12)."""
    return best_profile(curve.highest, t_r_min_s)


def smooth(curve: FlowCurve, t_r_min_s: float) -> TimeLaw:
    """Return a timing with continuous σ̈ that uses the flow all along; |σ̈| and |σ⃛| at most the peaks of the paper's profile."""
    return smooth_timing(curve.highest, *best_ramp(curve.highest, t_r_min_s).peaks)


TIMINGS: dict[Timing, Callable[[FlowCurve, float], TimeLaw]] = {
    "paper": paper,
    "paper-best": paper_best,
    "smooth": smooth,
    "limit": no_ramps,
}

"""Where the orientation φ(σ) may be along a path: the region of Fig. 4, and why it is empty where it is."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.kinematics import planar_theta
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.rockbreaker.orientation import VERTICAL, phi_intervals
from lhdmap.rockbreaker.paths import Path

_TOUCH = 1e-6  # rad: an end of the path may stand on the edge of its interval


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a request cannot be fulfilled: the joint or cylinder (or `reach`, `obstacle`), its limit, and where on the path."""

    joint: str
    limit: str
    sigma: float

    @property
    def text(self) -> str:
        """The reason in words."""
        return f"{self.joint}: {self.limit}, at sigma = {self.sigma:.3f} of the path"


@dataclass(frozen=True, slots=True)
class Corridor:
    """Lowest and highest φ (N,) at σ (N,), in the turn of `orientation.unwrapped`; connected from the path's start to its end."""

    sigma: FloatArray
    low: FloatArray
    high: FloatArray

    def at(self, sigma: float) -> tuple[float, float]:
        """Return the lowest and highest φ at one σ."""
        return float(np.interp(sigma, self.sigma, self.low)), float(np.interp(sigma, self.sigma, self.high))


def corridor(path: Path, phi_from: float, phi_to: float, sigma: FloatArray) -> Corridor | Refusal:
    """Return the region of φ that is connected from `phi_from` to `phi_to` along the path, or where and why there is none."""
    intervals = phi_intervals(path.machine, path.planar(sigma))
    empty = np.isnan(intervals[:, 0, 0])
    if empty.any():
        return out_of_reach(path, float(sigma[np.argmax(empty)]))
    if np.isnan(intervals[:, 1, 0]).all():
        return Corridor(sigma, intervals[:, 0, 0], intervals[:, 0, 1])
    return _connected(sigma, intervals, phi_from, phi_to)


def _connected(sigma: FloatArray, intervals: FloatArray, phi_from: float, phi_to: float) -> Corridor | Refusal:
    """Follow the intervals (N, K, 2) that overlap from node to node: forwards what is reachable, then back from the end."""
    holds_start = (intervals[0, :, 0] <= phi_from + _TOUCH) & (phi_from - _TOUCH <= intervals[0, :, 1])
    reached = [holds_start]
    for before, now in itertools.pairwise(intervals):
        overlap = (before[:, None, 0] <= now[None, :, 1]) & (now[None, :, 0] <= before[:, None, 1])
        reached.append((reached[-1][:, None] & overlap).any(axis=0))
        if not reached[-1].any():
            return _gap(float(sigma[len(reached) - 1]))
    holds_end = (intervals[-1, :, 0] <= phi_to + _TOUCH) & (phi_to - _TOUCH <= intervals[-1, :, 1]) & reached[-1]
    if not holds_end.any():
        return _gap(1.0)
    chosen = [int(np.argmax(holds_end))]
    for k in range(len(sigma) - 2, -1, -1):
        now, before = intervals[k + 1, chosen[-1]], intervals[k]
        overlap = np.minimum(before[:, 1], now[1]) - np.maximum(before[:, 0], now[0])
        chosen.append(int(np.argmax(np.where(reached[k], overlap, -np.inf))))
    bounds = intervals[np.arange(len(sigma)), chosen[::-1]]
    return Corridor(sigma, bounds[:, 0], bounds[:, 1])


def _gap(sigma: float) -> Refusal:
    return Refusal("phi", "no orientation leads from the first to the last without leaving the joints' limits", sigma)


def out_of_reach(path: Path, sigma: float) -> Refusal:
    """Return why no φ is feasible at one σ: the joint that is violated least by the best φ."""
    tip = path.tip(np.array([sigma]))[0]
    swing = math.atan2(tip[1], tip[0])
    planar = path.planar(np.array([sigma]))[0]
    phi = VERTICAL + np.radians(np.arange(-180.0, 180.0, 0.5))
    arm = planar_theta(path.machine, np.column_stack([np.tile(planar, (len(phi), 1)), phi]))
    theta = np.column_stack([np.full(len(phi), swing), arm])
    excess = _excess(path.machine, theta).max(axis=1)
    if np.isnan(excess).all():
        return Refusal("reach", f"the tip is out of the arm's reach at radius {planar[0]:.2f} m", sigma)
    return violated(path.machine, theta[np.nanargmin(excess)], sigma)


def violated(machine: Rockbreaker, theta: FloatArray, sigma: float) -> Refusal:
    """Return the joint of θ (4,) that is farthest beyond its limit."""
    if np.isnan(theta).any():
        return Refusal("reach", "the tip is out of the arm's reach with this orientation", sigma)
    joint = int(np.argmax(_excess(machine, theta)))
    low, high = np.degrees(machine.theta_limits[:, joint])
    value = math.degrees(float(theta[joint]))
    side = f"at most {high:.1f}" if value > high else f"at least {low:.1f}"
    return Refusal(f"theta{joint + 1}", f"{value:.1f} deg, {side} deg is possible", sigma)


def _excess(machine: Rockbreaker, theta: FloatArray) -> FloatArray:
    """Return how far the joints (…, 4) are beyond their limits, rad; negative within."""
    low, high = machine.theta_limits
    return np.maximum(low - theta, theta - high)


def contains(bounds: FloatArray, phi: float) -> bool:
    """Return whether one of the intervals (K, 2) holds φ, in the same turn."""
    return bool(np.any((bounds[:, 0] <= phi + _TOUCH) & (phi - _TOUCH <= bounds[:, 1])))

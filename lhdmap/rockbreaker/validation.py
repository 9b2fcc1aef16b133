"""Makes a path feasible: the quarter-point shift of Section 3.4 with the margin of erratum 13, finer where that is not enough."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker import turning
from lhdmap.rockbreaker.corridor import Corridor, Refusal, corridor, violated
from lhdmap.rockbreaker.flow import flow_curve
from lhdmap.rockbreaker.kinematics import within
from lhdmap.rockbreaker.paths import Path
from lhdmap.rockbreaker.settings import RockbreakerSettings

QUARTERS = (0.25, 0.5, 0.75)
_WIDE_DEG = (3.0, 1.0)  # margins of further points: with wide ones fewer points are needed
_NODES = 401
_DENSE = 2001
_MOST_KNOTS = 40
_NEAREST = 0.005  # of knots to each other: narrow blends make the path slow


def validated(path: Path, settings: RockbreakerSettings) -> Path | Refusal:
    """Return the path with a turning of the breaker that is feasible all along, or why there is none.

    First Eq. (11), as `path` has it, then the quarter points. Where these are not enough: further points, added one by one where
    the line is farthest outside, with several margins; the one that is fastest at its slowest place counts.
    """
    dense = np.linspace(0.0, 1.0, _DENSE)
    theta = path.theta(dense)
    if _feasible(path, theta):
        return path
    swing = _swing_refusal(path, theta, dense)
    if swing is not None:
        return swing
    region = corridor(path, path.turning.phi[0], path.turning.phi[-1], np.linspace(0.0, 1.0, _NODES))
    if isinstance(region, Refusal):
        return region
    quartered = path.turned(_lines(_quarters(path, region, settings), settings.blend))
    if _feasible(quartered, quartered.theta(dense)):
        return quartered
    margins = [math.radians(margin_deg) for margin_deg in (*_WIDE_DEG, settings.margin_deg)]
    shifted = [_shifted(path, region, settings, margin) for margin in margins]
    feasible = [one for one in shifted if isinstance(one, Path)]
    return min(feasible, key=_slowest, default=shifted[-1])


def _slowest(path: Path) -> float:
    """Return how slow the path must be at its slowest place, s: it is there that a turning of the breaker costs most."""
    return float(1.0 / flow_curve(path, np.linspace(0.0, 1.0, _DENSE)).highest.min())


def _quarters(path: Path, region: Corridor, settings: RockbreakerSettings) -> dict[float, float]:
    """Return the knots of the paper's method: the ends, and the quarter points that had to be shifted."""
    phi_from, phi_to = (float(phi) for phi in path.turning.phi[[0, -1]])
    knots = {0.0: phi_from, 1.0: phi_to}
    for sigma in QUARTERS:
        line = phi_from + sigma * (phi_to - phi_from)
        if not region.at(sigma)[0] <= line <= region.at(sigma)[1]:
            knots[sigma] = _inside(region, sigma, line, math.radians(settings.margin_deg))
    return knots


def _swing_refusal(path: Path, theta: FloatArray, dense: FloatArray) -> Refusal | None:
    """Return where the swing leaves its limits most, if it does."""
    low, high = path.machine.theta_limits
    if (theta[:, 0] >= low[0] - 1e-9).all() and (theta[:, 0] <= high[0] + 1e-9).all():
        return None
    worst = int(np.argmax(np.abs(theta[:, 0])))
    return violated(path.machine, np.array([theta[worst, 0], *low[1:]]), float(dense[worst]))


def _feasible(path: Path, theta: FloatArray) -> bool:
    return bool(within(path.machine, theta).all())


def _shifted(path: Path, region: Corridor, settings: RockbreakerSettings, further: float) -> Path | Refusal:
    """Shift quarter points, then add points one by one, `further` radians inside the region."""
    dense = np.linspace(0.0, 1.0, _DENSE)
    low, high = (np.interp(dense, region.sigma, edge) for edge in (region.low, region.high))
    knots = _quarters(path, region, settings)
    for _ in range(_MOST_KNOTS):
        path = path.turned(_lines(knots, settings.blend))
        theta = path.theta(dense)
        outside = ~within(path.machine, theta)
        if not outside.any():
            return path
        phi, _ = path.turning(dense)
        excess = np.where(outside, np.maximum(low - phi, phi - high) + 1e-9, -np.inf)
        worst = int(np.argmax(excess))
        sigma = _free_place(float(dense[worst]), knots)
        knots[sigma] = _inside(region, sigma, float(phi[worst]), further)
    return violated(path.machine, theta[worst], float(dense[worst]))


def _inside(region: Corridor, sigma: float, phi: float, margin: float) -> float:
    """Return φ moved into the region with the margin, or with a quarter of its width where it is narrow."""
    low, high = region.at(sigma)
    margin = min(margin, 0.25 * (high - low))
    return min(max(phi, low + margin), high - margin)


def _free_place(sigma: float, knots: dict[float, float]) -> float:
    """Return a σ for a new knot: the wanted one, or the middle to the next knot where one stands there already."""
    near = min(knots, key=lambda knot: abs(knot - sigma))
    if abs(near - sigma) > _NEAREST:
        return sigma
    others = sorted(knots)
    place = others.index(near)
    return 0.5 * (
        near + (others[place + 1] if place == 0 or (sigma > near and place + 1 < len(others)) else others[place - 1])
    )


def _lines(knots: dict[float, float], blend: float) -> turning.Turning:
    sigma = np.array(sorted(knots))
    return turning.through(sigma, np.array([knots[one] for one in sorted(knots)]), blend)

"""Makes a path feasible: the quarter-point shift of Section 3.4 with the margin of erratum 13, finer where that is not enough."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker import turning
from lhdmap.rockbreaker.corridor import Corridor, Refusal, corridor, violated
from lhdmap.rockbreaker.kinematics import within
from lhdmap.rockbreaker.paths import Path
from lhdmap.rockbreaker.settings import RockbreakerSettings

QUARTERS = (0.25, 0.5, 0.75)
_WIDE_DEG = (3.0, 1.0)  # margins of further points: with wide ones fewer points are needed
_NODES = 401
_DENSE = 2001
_MOST_KNOTS = 40


def validated(path: Path, settings: RockbreakerSettings) -> Path | Refusal:
    """Return the path with a turning of the breaker that is feasible all along, or why there is none.

    First Eq. (11), as `path` has it, then the quarter points, then further points where the shifted line still leaves the region:
    a point is added where it is farthest outside, until nothing is.
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
    for further_deg in (*_WIDE_DEG, settings.margin_deg):
        found = _shifted(path, region, settings, math.radians(further_deg))
        if isinstance(found, Path):
            break
    return found


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
    """Shift quarter points, then add points one by one, those by `further` radians inside the region."""
    phi_from, phi_to = path.turning.phi[[0, -1]]
    margin = math.radians(settings.margin_deg)
    dense = np.linspace(0.0, 1.0, _DENSE)
    low, high = (np.interp(dense, region.sigma, edge) for edge in (region.low, region.high))
    knots = {0.0: float(phi_from), 1.0: float(phi_to)}
    for sigma in QUARTERS:
        line = phi_from + sigma * (phi_to - phi_from)
        if not region.at(sigma)[0] <= line <= region.at(sigma)[1]:
            knots[sigma] = _inside(region, sigma, float(line), margin)
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
    if abs(near - sigma) > 1e-3:
        return sigma
    others = sorted(knots)
    place = others.index(near)
    return 0.5 * (
        near + (others[place + 1] if place == 0 or (sigma > near and place + 1 < len(others)) else others[place - 1])
    )


def _lines(knots: dict[float, float], blend: float) -> turning.Turning:
    sigma = np.array(sorted(knots))
    return turning.through(sigma, np.array([knots[one] for one in sorted(knots)]), blend)

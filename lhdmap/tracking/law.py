"""Errors of the reduced state against a reference, and the rates of the joint that take them away."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.tracking.circles import circle_beside, three_points
from lhdmap.tracking.equations import Lengths2, equilibrium
from lhdmap.tracking.kernel import State
from lhdmap.tracking.path import Path, beside
from lhdmap.tracking.reference import Curve

_BACK_M, _AHEAD_M = 4.0, 4.0


class Errors(NamedTuple):
    """x - x_ref (4,) of (z1, θ̃1, β, ω); where on the curve the rear axle is (m)."""

    x: FloatArray
    along_m: float


def errors_of_curve(
    curve: Curve, state: State, slip: float, near_m: float, rear_mps: float, lengths: Lengths2
) -> Errors:
    """Return the errors against a reference curve; a machine that slips goes crabwise, so that its course is along the curve.

    Turned by -slip, its axles would be aside by half a wheelbase times it, one to each side: z0 + z1 stays 0.
    """
    x, y, heading, bend, rate = state
    along, aside, course, _ = beside(curve.rows, x, y, near_m, _BACK_M, _AHEAD_M)
    row = curve.at(along)
    turned = (heading - course + math.pi) % (2.0 * math.pi) - math.pi
    off = [aside - 0.5 * sum(lengths) * slip, turned + slip, bend - row[4], rate - rear_mps * row[5]]
    return Errors(np.array(off), along)


def errors_of_circle(
    path: Path, state: State, slip: float, near_m: float, look_m: float, lengths: Lengths2
) -> FloatArray:
    """Return the errors (4,) against Eq. (10) on the circle at the rear axle (Section 2.4.3)."""
    x, y, heading, bend, rate = state
    points = path.points
    three, _ = three_points(points, x, y, look_m, round(near_m / 0.1))
    found = circle_beside(three, x, y)
    rest = equilibrium(found.curvature_pm, lengths)
    turned = (heading - found.heading_rad + math.pi) % (2.0 * math.pi) - math.pi
    return np.array([found.offset_m - rest[1] - 0.5 * sum(lengths) * slip, turned + slip, bend - rest[4], rate])

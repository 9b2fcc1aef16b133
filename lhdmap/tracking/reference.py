"""The reference curve: a configuration curve of the machine along which z0 + z1 = 0, as far as it can be."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.errors import InputError
from lhdmap.messages import FloatArray
from lhdmap.tracking.equations import Lengths2, equilibrium
from lhdmap.tracking.path import STEP_M, Path, beside
from lhdmap.tracking.reference_kernel import improve, merit

_ROUNDS = 25
_ENOUGH = 1e-6
_LOOSER, _MISS_M, _LOST_M = (1.0, 2.0, 8.0), 0.02, 0.3


class Curve(NamedTuple):
    """Configurations each 0.1 m of the rear axle's way: x, y, heading, curvature (all of the rear axle), β, dβ/ds; (N, 6).

    The first four are a path as `beside` has it. The machine goes from `from_m` to `to_m` of it: down, where it reverses.
    `miss_m`: largest |z0 + z1| on it; 0 where it is no curve beside a path.
    """

    rows: FloatArray
    from_m: float
    to_m: float
    miss_m: float = 0.0

    @property
    def gear(self) -> int:
        """1 forward, -1 in reverse."""
        return 1 if self.to_m >= self.from_m else -1

    def at(self, along_m: float) -> FloatArray:
        """Return the row (6,) at a length."""
        on = min(max(along_m / STEP_M, 0.0), len(self.rows) - 1.0)
        k = min(int(on), len(self.rows) - 2)
        found: FloatArray = self.rows[k] + (on - k) * (self.rows[k + 1] - self.rows[k])
        return found


def reference_of(path: Path, gear: int, most_per_m: FloatArray, lengths: Lengths2) -> Curve:
    """Return the curve along a path, driven in a gear; `most_per_m`: bounds of |dβ/ds| at each point of the path, rad/m.

    Raises:
        InputError: there is no such curve: the path bends more than the machine can.
    """
    points = path.points
    count = len(points) - 1 - math.ceil((sum(lengths) + 1.0) / STEP_M)  # the front axle is ahead of the rear one
    if count < 10:
        raise InputError("the path is shorter than the machine")
    q, near = _first_guess(points, count, lengths)
    for looser in _LOOSER:  # where the joint has to be quicker than the speed allows, the machine goes slower
        most = np.maximum(looser * most_per_m[:count], 1e-3)
        u = np.clip(np.diff(q[:, 3]) / STEP_M, -most, most)
        q1, u1, found = _solved(points, (q, u, near), most, lengths)
        if found[1] < 1e-3 and found[2] < _MISS_M:
            break
    q, u = q1, u1
    if found[1] > 1e-3 or found[2] > _LOST_M or not np.isfinite(q).all():
        raise InputError("no curve of the machine follows the path: it bends too much, or too suddenly")
    rows = rows_of(q, u, lengths)
    back, front = near[:, 1], near[:, 0]
    if gear > 0:
        return Curve(rows, _where(front, path.begin_m), _where(front, path.end_m), float(found[2]))
    return Curve(rows, _where(back, path.end_m), _where(back, path.begin_m), float(found[2]))


def rows_of(q: FloatArray, u: FloatArray, lengths: Lengths2) -> FloatArray:
    """Return the rows of a `Curve` of states (N + 1, 4) and inputs (N,)."""
    u = np.append(u, u[-1])
    curvature = (np.sin(q[:, 3]) - lengths[0] * u) / (lengths[0] + lengths[1] * np.cos(q[:, 3]))
    return np.ascontiguousarray(np.column_stack([q[:, :3], curvature, q[:, 3], u]))


def _first_guess(points: FloatArray, count: int, lengths: Lengths2) -> tuple[FloatArray, FloatArray]:
    """Return states (count + 1, 4) on the path, the joint as on a circle, and where both axles are along it (count + 1, 2)."""
    s = np.arange(count + 1) * STEP_M
    middle = np.interp(s + 0.5 * sum(lengths), np.arange(len(points)) * STEP_M, points[:, 3])
    bend = np.array([equilibrium(one, lengths)[4] for one in middle])
    q = np.column_stack([points[: count + 1, :3], bend])
    near = np.column_stack([s + sum(lengths), s])
    for k in range(count + 1):
        x0 = q[k, 0] + lengths[1] * math.cos(q[k, 2]) + lengths[0] * math.cos(q[k, 2] + bend[k])
        y0 = q[k, 1] + lengths[1] * math.sin(q[k, 2]) + lengths[0] * math.sin(q[k, 2] + bend[k])
        near[k, 0] = beside(points, x0, y0, near[k, 0], 2.0, 2.0)[0]
    return q, near


def _solved(
    points: FloatArray, start: tuple[FloatArray, FloatArray, FloatArray], most: FloatArray, lengths: Lengths2
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return states, inputs, and (cost, largest defect, largest |z0 + z1|): Gauss-Newton, damped where a step does not help."""
    q, u, near = start
    damping, found = 1e-4, merit(points, q, u, near, lengths)
    for _ in range(_ROUNDS):
        tried_q, tried_u = improve(points, q, u, near, most, lengths, damping)
        tried_near = near.copy()
        tried = merit(points, tried_q, tried_u, tried_near, lengths)
        if not tried[0] < found[0]:
            damping = max(10.0 * damping, 1e-3)
            if damping > 1e4:
                break
            continue
        enough = found[0] - tried[0] < _ENOUGH * found[0] + 1e-9
        q, u, found = tried_q, tried_u, tried
        near[:] = tried_near
        damping *= 0.1
        if enough:
            break
    return q, u, found


def _where(along: FloatArray, wanted: float) -> float:
    """Return how far along the curve an axle is at a length of the path."""
    return float(np.interp(wanted, along, np.arange(len(along)) * STEP_M))

"""A Gauss-Newton step on a whole configuration curve, solved stage by stage (Riccati), dynamics as constraints with defects.

State of a stage: x, y, heading of the rear axle, joint angle; input: change of the joint per metre of the rear axle's way.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.tracking.path import STEP_M, beside

SUM, APART, INPUT = 1.0, 4e-4, 2e-3
"""Weights of (z0 + z1)², (z0 - z1)², (dβ/ds)²: haulage findings, section 1."""
_REACH_M = 1.5
_START = 1e3


@nb.njit(cache=True, nogil=True)
def _stage(q: FloatArray, u: float, front_m: float, rear_m: float, after: FloatArray, jac: FloatArray) -> None:
    """Write the next state and the derivatives that are neither 0 nor 1: rows x, y, θ, columns θ, β, u."""
    bend = q[3] + 0.5 * STEP_M * u
    c, s = math.cos(bend), math.sin(bend)
    d = front_m + rear_m * c
    turn = (s - front_m * u) / d
    by_bend = (c * d + rear_m * s * (s - front_m * u)) / (d * d)
    by_u = 0.5 * STEP_M * by_bend - front_m / d
    half = q[2] + 0.5 * STEP_M * turn
    ch, sh = math.cos(half), math.sin(half)
    after[0], after[1] = q[0] + STEP_M * ch, q[1] + STEP_M * sh
    after[2], after[3] = q[2] + STEP_M * turn, q[3] + STEP_M * u
    for row, slope in ((0, -STEP_M * sh), (1, STEP_M * ch)):
        jac[row, 0] = slope
        jac[row, 1] = slope * 0.5 * STEP_M * by_bend
        jac[row, 2] = slope * 0.5 * STEP_M * by_u
    jac[2, 0], jac[2, 1], jac[2, 2] = 1.0, STEP_M * by_bend, STEP_M * by_u


@nb.njit(cache=True, nogil=True)
def offsets(
    points: FloatArray, q: FloatArray, near: FloatArray, front_m: float, rear_m: float, rows: FloatArray
) -> tuple[float, float]:
    """Return z0, z1 of a configuration; `near` (2,) is where they were and is told where they are; `rows` (2, 4): derivatives."""
    x1, y1, t1, ahead = q[0], q[1], q[2], q[2] + q[3]
    x0 = x1 + rear_m * math.cos(t1) + front_m * math.cos(ahead)
    y0 = y1 + rear_m * math.sin(t1) + front_m * math.sin(ahead)
    s0, z0, h0, _ = beside(points, x0, y0, near[0], _REACH_M, _REACH_M)
    s1, z1, h1, _ = beside(points, x1, y1, near[1], _REACH_M, _REACH_M)
    near[0], near[1] = s0, s1
    nx, ny = -math.sin(h0), math.cos(h0)
    by_front = front_m * (-math.sin(ahead) * nx + math.cos(ahead) * ny)
    rows[0, 0], rows[0, 1], rows[0, 3] = nx, ny, by_front
    rows[0, 2] = rear_m * (-math.sin(t1) * nx + math.cos(t1) * ny) + by_front
    rows[1, 0], rows[1, 1], rows[1, 2], rows[1, 3] = -math.sin(h1), math.cos(h1), 0.0, 0.0
    return z0, z1


@nb.njit(cache=True, nogil=True)
def merit(
    points: FloatArray, q: FloatArray, u: FloatArray, near: FloatArray, lengths: tuple[float, float]
) -> FloatArray:
    """Return cost, largest defect, largest |z0 + z1| of a curve; `near` (N, 2) is brought up to date."""
    after, jac, rows = np.zeros(4), np.zeros((3, 3)), np.zeros((2, 4))
    out = np.zeros(3)
    for k in range(len(q)):
        z0, z1 = offsets(points, q[k], near[k], lengths[0], lengths[1], rows)
        out[0] += SUM * (z0 + z1) ** 2 + APART * (z0 - z1) ** 2
        out[2] = max(out[2], abs(z0 + z1))
        if k < len(u):
            out[0] += INPUT * u[k] ** 2
            _stage(q[k], u[k], lengths[0], lengths[1], after, jac)
            for i in range(4):
                out[1] = max(out[1], abs(after[i] - q[k + 1, i]))
                out[0] += 1e3 * (after[i] - q[k + 1, i]) ** 2
    return out


@nb.njit(cache=True, nogil=True)
def improve(
    points: FloatArray, q: FloatArray, u: FloatArray, near: FloatArray, most: FloatArray, lengths: tuple[float, float],
    damping: float,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Return states (N + 1, 4) and inputs (N,) after a step; |u| <= `most` (N,), the first state is free but for its way."""
    count = len(u)
    gain, step = np.zeros((count, 4)), np.zeros(count)
    jac, rows, after = np.zeros((3, 3)), np.zeros((2, 4)), np.zeros(4)
    hess, grad = np.zeros((4, 4)), np.zeros(4)
    ha, at, qux = np.zeros((4, 4)), np.zeros((4, 4)), np.zeros(4)
    _add_cost(points, q[count], near[count], lengths, rows, hess, grad)
    for k in range(count - 1, -1, -1):
        _stage(q[k], u[k], lengths[0], lengths[1], after, jac)
        for i in range(4):  # the gradient at the state that the stage leads to
            for j in range(4):
                grad[i] += hess[i, j] * (after[j] - q[k + 1, j])
        _times(hess, jac, ha)
        qu, quu = _by_input(u[k], grad, hess, ha, jac, damping, qux)
        want = u[k] - qu / quu
        bound = most[k]
        step[k] = min(max(want, -bound), bound) - u[k]
        if abs(want) <= bound:
            for j in range(4):
                gain[k, j] = -qux[j] / quu
        _times_left(jac, ha, at)
        grad[3] += jac[0, 1] * grad[0] + jac[1, 1] * grad[1] + jac[2, 1] * grad[2]
        grad[2] += jac[0, 0] * grad[0] + jac[1, 0] * grad[1]
        for i in range(4):
            grad[i] += qux[i] * step[k] + gain[k, i] * (qu + quu * step[k])
            for j in range(4):
                hess[i, j] = at[i, j] + gain[k, i] * qux[j] + qux[i] * gain[k, j] + quu * gain[k, i] * gain[k, j]
        _add_cost(points, q[k], near[k], lengths, rows, hess, grad)
    return _rolled(q, u, gain, step, most, lengths, _first(hess, grad, q[0, 2]))


@nb.njit(cache=True, nogil=True)
def _by_input(
    u: float, grad: FloatArray, hess: FloatArray, ha: FloatArray, jac: FloatArray, damping: float, qux: FloatArray
) -> tuple[float, float]:
    """Return first and second derivative by the input, and write the mixed one (4,)."""
    b = (jac[0, 2], jac[1, 2], jac[2, 2], STEP_M)
    qu, quu = INPUT * u, INPUT + damping
    qux[:] = 0.0
    for i in range(4):
        qu += b[i] * grad[i]
        for j in range(4):
            qux[j] += b[i] * ha[i, j]
            quu += b[i] * hess[i, j] * b[j]
    return qu, quu


@nb.njit(cache=True, nogil=True)
def _first(hess: FloatArray, grad: FloatArray, heading: float) -> FloatArray:
    """Return the change (4,) of the first state, hardly any of it along the path: elimination, the matrix is definite."""
    along = (math.cos(heading), math.sin(heading), 0.0, 0.0)
    m, x = hess.copy(), -grad
    for i in range(4):
        m[i, i] += 1e-6
        for j in range(4):
            m[i, j] += _START * along[i] * along[j]
    for k in range(4):
        for i in range(k + 1, 4):
            share = m[i, k] / m[k, k]
            x[i] -= share * x[k]
            for j in range(k, 4):
                m[i, j] -= share * m[k, j]
    for k in range(3, -1, -1):
        for j in range(k + 1, 4):
            x[k] -= m[k, j] * x[j]
        x[k] /= m[k, k]
    return x


@nb.njit(cache=True, nogil=True)
def _rolled(
    q: FloatArray, u: FloatArray, gain: FloatArray, step: FloatArray, most: FloatArray, lengths: tuple[float, float],
    change: FloatArray,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Return the curve after the linear forward pass."""
    jac, after = np.zeros((3, 3)), np.zeros(4)
    new_q, new_u = q.copy(), u.copy()
    for k in range(len(u)):
        _stage(q[k], u[k], lengths[0], lengths[1], after, jac)
        for i in range(4):
            new_q[k, i] = q[k, i] + change[i]
        wanted = u[k] + step[k]
        for i in range(4):
            wanted += gain[k, i] * change[i]
        new_u[k] = min(max(wanted, -most[k]), most[k])
        du = new_u[k] - u[k]
        x = change[0] + jac[0, 0] * change[2] + jac[0, 1] * change[3] + jac[0, 2] * du
        y = change[1] + jac[1, 0] * change[2] + jac[1, 1] * change[3] + jac[1, 2] * du
        t = change[2] + jac[2, 1] * change[3] + jac[2, 2] * du
        bend = change[3] + STEP_M * du
        for i in range(4):
            change[i] = after[i] - q[k + 1, i]
        change[0], change[1], change[2], change[3] = change[0] + x, change[1] + y, change[2] + t, change[3] + bend
    for i in range(4):
        new_q[-1, i] = q[-1, i] + change[i]
    return new_q, new_u


@nb.njit(cache=True, nogil=True)
def _add_cost(
    points: FloatArray, q: FloatArray, near: FloatArray, lengths: tuple[float, float], rows: FloatArray,
    hess: FloatArray, grad: FloatArray,
) -> None:  # fmt: skip
    z0, z1 = offsets(points, q, near, lengths[0], lengths[1], rows)
    for i in range(4):
        both_i, apart_i = rows[0, i] + rows[1, i], rows[0, i] - rows[1, i]
        grad[i] += SUM * (z0 + z1) * both_i + APART * (z0 - z1) * apart_i
        for j in range(4):
            hess[i, j] += SUM * both_i * (rows[0, j] + rows[1, j]) + APART * apart_i * (rows[0, j] - rows[1, j])


@nb.njit(cache=True, nogil=True)
def _times(m: FloatArray, jac: FloatArray, out: FloatArray) -> None:
    """Write M A, A the stage's matrix."""
    for i in range(4):
        out[i, 0], out[i, 1] = m[i, 0], m[i, 1]
        out[i, 2] = m[i, 0] * jac[0, 0] + m[i, 1] * jac[1, 0] + m[i, 2]
        out[i, 3] = m[i, 0] * jac[0, 1] + m[i, 1] * jac[1, 1] + m[i, 2] * jac[2, 1] + m[i, 3]


@nb.njit(cache=True, nogil=True)
def _times_left(jac: FloatArray, m: FloatArray, out: FloatArray) -> None:
    """Write A' M."""
    for j in range(4):
        out[0, j], out[1, j] = m[0, j], m[1, j]
        out[2, j] = jac[0, 0] * m[0, j] + jac[1, 0] * m[1, j] + m[2, j]
        out[3, j] = jac[0, 1] * m[0, j] + jac[1, 1] * m[1, j] + jac[2, 1] * m[2, j] + m[3, j]

"""ICP in the plane: a cloud placed on another one by the distances of its points to the other's wall lines, or to its points.

The target is prepared once: a line at each point (PCA of its nearest neighbours) and a grid whose cells know the nearest point, so
that a look-up is one read. Points count by how near they are (Tukey's weight, its width falling from `REACH_M` to the limit).
The fitness is judged over the points that the target could have seen: those in bearings in which it has a hit, within its range.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.geometry import se2
from lhdmap.landmarks.target import REACH_M, IcpModel, Target, bearing, counterpart, distance2, prepare
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.scan_matching.equations import solve3

_ROUNDS, _POINT_ROUNDS, _WIDE_ROUNDS, _TRIED = 30, 60, 4, 3  # points slide along a wall slowly
_NARROWING = 0.85  # of the gate, each round
_LAST_GATE = 0.35  # where it ends, in limits; points are too far apart for a narrow one
_STEADY = 2e-4  # m, and rad times 5: a step below it ends the rounds
_NOISE_M = 0.012


class IcpFit(NamedTuple):
    """A cloud placed: `pose` (3,) in the target's frame, `fitness` (m²), `share` in common, `information` (3, 3), target axes.

    `fitness` is the mean of the squared distances, truncated at the limit; where too little is in common it is the limit's
    square and `valid` is false.
    """

    pose: FloatArray
    fitness: float
    share: float
    valid: bool
    information: FloatArray


@nb.njit(cache=True, nogil=True)
def _equations(target, points, step, pose, gate_m, to_line, H, b):  # type: ignore[no-untyped-def]
    """Fill H (3, 3) and b (3,) of the weighted distances of each `step`-th point at `pose`, in the target's axes."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    h00 = h01 = h02 = h11 = h12 = h22 = b0 = b1 = b2 = 0.0
    inverse2 = 1.0 / (gate_m * gate_m)
    for i in range(0, points.shape[0], step):
        rx, ry = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        x, y = pose[0] + rx, pose[1] + ry
        k = counterpart(target, x, y)
        if k < 0:
            continue
        if to_line:
            nx, ny = target.normals[k, 0], target.normals[k, 1]
            d = nx * (x - target.anchors[k, 0]) + ny * (y - target.anchors[k, 1])
            u2 = d * d * inverse2
            if u2 >= 1.0:
                continue
            w = (1.0 - u2) ** 2
            jt = -nx * ry + ny * rx
            h00, h01, h02 = h00 + w * nx * nx, h01 + w * nx * ny, h02 + w * nx * jt
            h11, h12, h22 = h11 + w * ny * ny, h12 + w * ny * jt, h22 + w * jt * jt
            b0, b1, b2 = b0 - w * nx * d, b1 - w * ny * d, b2 - w * jt * d
        else:
            ex, ey = x - target.points_m[k, 0], y - target.points_m[k, 1]
            u2 = (ex * ex + ey * ey) * inverse2
            if u2 >= 1.0:
                continue
            w = (1.0 - u2) ** 2
            h00, h02, h11, h12 = h00 + w, h02 - w * ry, h11 + w, h12 + w * rx
            h22 += w * (rx * rx + ry * ry)
            b0, b1, b2 = b0 - w * ex, b1 - w * ey, b2 - w * (rx * ey - ry * ex)
    H[0, 0], H[0, 1], H[0, 2] = h00, h01, h02
    H[1, 0], H[1, 1], H[1, 2] = h01, h11, h12
    H[2, 0], H[2, 1], H[2, 2] = h02, h12, h22
    b[0], b[1], b[2] = b0, b1, b2


@nb.njit(cache=True, nogil=True, inline="always")
def _last_gate(model):  # type: ignore[no-untyped-def]
    return _LAST_GATE * model.limit_m if model.to_line else REACH_M


@nb.njit(cache=True, nogil=True)
def _moved(target, points, pose, rounds, step, model, narrowing):  # type: ignore[no-untyped-def]
    """Move `pose` (3,) in place by rounds of Gauss-Newton over each `step`-th point; the gate narrows while they go on."""
    H, b = np.zeros((3, 3)), np.zeros(3)
    damping = np.eye(3) * 1e-6
    for k in range(rounds):
        gate = REACH_M
        if narrowing:
            gate = max(REACH_M * _NARROWING**k, _last_gate(model))
        _equations(target, points, step, pose, gate, model.to_line, H, b)
        shift = solve3(H + damping, b)
        pose[0] += shift[0]
        pose[1] += shift[1]
        pose[2] = se2.wrap(pose[2] + shift[2])
        if abs(shift[0]) + abs(shift[1]) + 5.0 * abs(shift[2]) < _STEADY and (
            not narrowing or gate == _last_gate(model)
        ):
            break


@nb.njit(cache=True, nogil=True)
def judge(target, points, pose, model):  # type: ignore[no-untyped-def]
    """Return (fitness, share in common, valid) of points (N, 2) at `pose`.

    In common is what lies within the target's range, in bearings in which it sees. A point there without a counterpart costs the
    limit. Both halves of the cloud, left and right of its machine, must have half of the share.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    limit2, total = model.limit_m**2, 0.0
    common, all_ = np.zeros(2), np.zeros(2)
    for i in range(points.shape[0]):
        side = 0 if points[i, 1] > 0.0 else 1
        all_[side] += 1.0
        x = pose[0] + c * points[i, 0] - s * points[i, 1]
        y = pose[1] + s * points[i, 0] + c * points[i, 1]
        about = x - model.centre_m
        if about * about + y * y > model.range_m**2 or not target.seen[bearing(about, y)]:
            continue
        common[side] += 1.0
        k = counterpart(target, x, y)
        total += min(distance2(target, k, x, y, model.to_line), limit2) if k >= 0 else limit2
    both = common[0] + common[1]
    share = both / max(points.shape[0], 1)
    valid = both > 0.0 and share >= model.min_share
    for side in range(2):
        valid = valid and common[side] >= 0.5 * model.min_share * all_[side]
    return (total / both if valid else limit2), share, valid


@nb.njit(cache=True, nogil=True)
def align(target: Target, points_m: FloatArray, start: FloatArray, model: IcpModel) -> IcpFit:
    """Return the `IcpFit` of points (N, 2), N > 0, on a target from the pose `start` (3,): pose_target_source, m and rad.

    It finds what is up to a metre and some degrees away in rough walls.
    """
    pose = start.copy()
    _moved(target, points_m, pose, _ROUNDS if model.to_line else _POINT_ROUNDS, 1, model, True)
    fitness, share, valid = judge(target, points_m, pose, model)
    H, b = np.zeros((3, 3)), np.zeros(3)
    _equations(target, points_m, 1, pose, _last_gate(model), model.to_line, H, b)
    return IcpFit(pose, fitness, share, valid, H / max(fitness, _NOISE_M**2))


@nb.njit(cache=True, nogil=True)
def best_of(target: Target, points_m: FloatArray, starts: FloatArray, model: IcpModel) -> IcpFit:
    """Return the `IcpFit` with the least fitness from any of the starts (S, 3), S > 0.

    From each start a few wide rounds over each second point; the likeliest three are then matched to the end.
    """
    n = starts.shape[0]
    poses, values = starts.copy(), np.empty(n)
    for k in range(n):
        _moved(target, points_m, poses[k], _WIDE_ROUNDS, 2, model, False)
        values[k] = _roughly(target, points_m, poses[k], model)
    order = np.argsort(values)
    best = align(target, points_m, poses[order[0]], model)
    for k in order[1:_TRIED]:
        one = align(target, points_m, poses[k], model)
        if one.fitness < best.fitness:
            best = one
    return best


@nb.njit(cache=True, nogil=True)
def _roughly(target, points, pose, model):  # type: ignore[no-untyped-def]
    """Return the mean of truncated squared distances of each second point: what has no counterpart costs as the rest does."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    limit2, total, n = (2.0 * model.limit_m) ** 2, 0.0, 0
    for i in range(0, points.shape[0], 2):
        x = pose[0] + c * points[i, 0] - s * points[i, 1]
        y = pose[1] + s * points[i, 0] + c * points[i, 1]
        k = counterpart(target, x, y)
        n += 1
        total += min(distance2(target, k, x, y, model.to_line), limit2) if k >= 0 else limit2
    return total / max(n, 1)


def fit(target_m: Float32Array, source_m: Float32Array, start: FloatArray, model: IcpModel) -> IcpFit:
    """Return the `IcpFit` of one cloud (N, 2) on another (M, 2); for a pair alone, both as they are stored."""
    target = prepare(np.asarray(target_m, dtype=np.float64), model)
    return align(target, np.asarray(source_m, dtype=np.float64), np.asarray(start, dtype=np.float64), model)

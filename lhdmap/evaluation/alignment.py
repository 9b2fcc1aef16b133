"""Ways to bring an estimate into the frame of the truth before absolute errors are taken; none of them scales.

`origin` is the default: the first pair's position and heading. Roll and pitch are left alone, because both sides
measure them against gravity, and a tenth of a degree at the start would tilt a whole drive. Least squares are not
determined everywhere: `se3` needs a path with a bend (on a straight one the roll about it is free), `se2` one with an
extent. Elsewhere they fall back to `origin` and say so.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.errors import UsageError
from lhdmap.evaluation.poses import Poses, headings, yaw_rotation
from lhdmap.messages import FloatArray

ALIGNMENTS = ("none", "origin", "se2", "se3")
COLLINEAR_SHARE = 1e-3
"""A path whose second principal deviation is below this share of the first counts as straight."""
STANDING_M = 0.01
"""A path whose first principal deviation is below this does not move."""


class Alignment(NamedTuple):
    """The motion `R` (3, 3), `t_m` (3,) that maps the estimate on the truth; the name of what was used; a warning."""

    R: FloatArray
    t_m: FloatArray
    used: str
    warning: str


def align(estimate: Poses, truth: Poses, method: str) -> Alignment:
    """Return the alignment of N paired poses.

    Raises:
        UsageError: the method is unknown.
    """
    if method not in ALIGNMENTS:
        raise UsageError(f"alignment '{method}' is unknown; known: {', '.join(ALIGNMENTS)}")
    if method == "none":
        return Alignment(np.eye(3), np.zeros(3), "none", "")
    if method == "origin":
        return _origin(estimate, truth)
    why_not = _undetermined(estimate, method) or _undetermined(truth, method)
    if why_not:
        text = f"{why_not}: alignment '{method}' is not determined on it, 'origin' was used instead"
        return _origin(estimate, truth)._replace(warning=text)
    R = _best_rotation(estimate.positions_m, truth.positions_m, planar=method == "se2")
    return Alignment(R, truth.positions_m.mean(axis=0) - R @ estimate.positions_m.mean(axis=0), method, "")


def aligned(poses: Poses, alignment: Alignment) -> Poses:
    """Return the poses moved by the alignment."""
    return Poses(poses.positions_m @ alignment.R.T + alignment.t_m, alignment.R @ poses.rotations)


def _origin(estimate: Poses, truth: Poses) -> Alignment:
    turn = float(headings(Poses(truth.positions_m[:1], truth.rotations[:1]))[0])
    turn -= float(headings(Poses(estimate.positions_m[:1], estimate.rotations[:1]))[0])
    R = yaw_rotation(turn)
    return Alignment(R, truth.positions_m[0] - R @ estimate.positions_m[0], "origin", "")


def _best_rotation(from_m: FloatArray, to_m: FloatArray, *, planar: bool) -> FloatArray:
    """Return the least-squares rotation (Umeyama 1991, Eqs. (40)-(41), scale 1); about z only where planar."""
    a, b = from_m - from_m.mean(axis=0), to_m - to_m.mean(axis=0)
    if planar:
        sine, cosine = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a[:, :2] * b[:, :2]).sum()
        return yaw_rotation(math.atan2(sine, cosine))
    U, _, Vt = np.linalg.svd(b.T @ a)
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    return U @ mirror @ Vt


def _undetermined(poses: Poses, method: str) -> str:
    """Return in words why a least-squares rotation is not determined by the path, or ''."""
    points = poses.positions_m[:, :2] if method == "se2" else poses.positions_m
    deviations = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) / math.sqrt(len(points))
    if deviations[0] < STANDING_M:
        return "the path has no extent"
    straight = len(points) < 3 or deviations[1] <= COLLINEAR_SHARE * deviations[0]
    return "the path is straight" if straight and method == "se3" else ""

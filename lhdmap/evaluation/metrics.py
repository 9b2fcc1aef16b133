"""Errors of a trajectory against the truth, pose by pose and segment by segment; arrays in, arrays and numbers out.

APE and RPE follow evo's conventions (`docs/evaluation.md` says where the pairs of the RPE come from); segments follow
KITTI's (Geiger et al., CVPR 2012), with lengths that a drive of 90 m has, too. All relative errors are taken between
poses of the same trajectory, so that no alignment enters them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.errors import UsageError
from lhdmap.evaluation.association import IndexArray
from lhdmap.evaluation.poses import Poses, angles, between, distances_along, headings, taken
from lhdmap.messages import FloatArray

SEGMENT_START_STEP_M = 0.5
"""Segments start each half metre of the true path: a machine that stands does not weigh more."""

_DRIFT_M = 100.0


class Statistics(NamedTuple):
    """Summary of an array of errors, in the unit of the errors."""

    rmse: float
    mean: float
    median: float
    std: float
    min: float
    max: float


class RelativeErrors(NamedTuple):
    """RPE of each pair: `translation_m` (M,) and `rotation_deg` (M,), over `delta` of `unit` (`m` or `frames`)."""

    translation_m: FloatArray
    rotation_deg: FloatArray
    delta: float
    unit: str


class Segment(NamedTuple):
    """Mean errors over all segments of one length; both None where the drive has no such segment (`n` = 0)."""

    length_m: float
    n: int
    translation_pct: float | None
    rotation_deg_per_m: float | None


class Components(NamedTuple):
    """Mean absolute position error in the heading frame of the truth, metres."""

    along_m: float
    across_m: float
    height_m: float


def statistics(errors: FloatArray) -> Statistics | None:
    """Return the summary of errors (M,), None where there are none."""
    if not len(errors):
        return None
    squares = float(np.sqrt(np.mean(np.square(errors))))
    rest = (float(f(errors)) for f in (np.mean, np.median, np.std, np.min, np.max))
    return Statistics(squares, *rest)


def absolute_errors(aligned_estimate: Poses, truth: Poses) -> FloatArray:
    """Return the distance between the paired positions (N,), metres (APE, translation part)."""
    return np.linalg.norm(aligned_estimate.positions_m - truth.positions_m, axis=1)


def error_components(aligned_estimate: Poses, truth: Poses) -> FloatArray:
    """Return the position errors (N, 3) along and across the true heading (left positive) and in height, metres."""
    offset = aligned_estimate.positions_m - truth.positions_m
    c, s = np.cos(headings(truth)), np.sin(headings(truth))
    return np.column_stack([c * offset[:, 0] + s * offset[:, 1], c * offset[:, 1] - s * offset[:, 0], offset[:, 2]])


def relative_errors(
    estimate: Poses, truth: Poses, delta: float, unit: str, along_m: FloatArray | None = None
) -> RelativeErrors:
    """Return the RPE over consecutive pairs that are `delta` frames, or `delta` metres of the true path, apart.

    `along_m` (N,): the length of the true path up to each pose, where it is not that through all positions.

    Raises:
        UsageError: the unit is unknown, or delta is not positive (for frames: not whole).
    """
    if unit not in ("m", "frames"):
        raise UsageError(f"unit '{unit}' of the relative error is unknown; known: m, frames")
    if not delta > 0 or (unit == "frames" and delta != int(delta)):
        raise UsageError(f"delta {delta:g} {unit}: a positive {'whole ' if unit == 'frames' else ''}number was wanted")
    if unit == "frames":
        rows = np.arange(0, len(truth.positions_m), int(delta))
    else:
        rows = _rows_apart(distances_along(truth.positions_m) if along_m is None else along_m, delta)
    translation, rotation = pair_errors(estimate, truth, rows[:-1], rows[1:])
    return RelativeErrors(translation, np.degrees(rotation), delta, unit)


def pair_errors(estimate: Poses, truth: Poses, start: IndexArray, stop: IndexArray) -> tuple[FloatArray, FloatArray]:
    """Return metres and radians by which the estimated motions from `start` to `stop` (rows) are off."""
    moved_truth = between(taken(truth, start), taken(truth, stop))
    moved_estimate = between(taken(estimate, start), taken(estimate, stop))
    error = between(moved_truth, moved_estimate)
    return np.linalg.norm(error.positions_m, axis=1), angles(error.rotations)


def segments(
    estimate: Poses, truth: Poses, lengths_m: tuple[float, ...], along_m: FloatArray | None = None
) -> tuple[Segment, ...]:
    """Return the mean segment errors for each length: translation in per cent, rotation in degrees per metre driven.

    `along_m` as in `relative_errors`.
    """
    along = distances_along(truth.positions_m) if along_m is None else along_m
    starts = np.concatenate([[0], _rows_apart(along, SEGMENT_START_STEP_M)[1:]]).astype(np.int64)
    return tuple(_segment(estimate, truth, along, starts, length) for length in lengths_m)


def _segment(estimate: Poses, truth: Poses, along: FloatArray, starts: IndexArray, length_m: float) -> Segment:
    if not length_m > 0:
        raise UsageError(f"segment length {length_m:g} m: a positive number was wanted")
    stops = np.searchsorted(along, along[starts] + length_m * (1.0 - 1e-12))
    inside = stops < len(along)
    start, stop = starts[inside], stops[inside]
    if not len(start):
        return Segment(length_m, 0, None, None)
    driven = along[stop] - along[start]
    translation, rotation = pair_errors(estimate, truth, start, stop)
    return Segment(
        length_m,
        len(start),
        float(100.0 * np.mean(translation / driven)),
        float(np.mean(np.degrees(rotation) / driven)),
    )


def _rows_apart(along: FloatArray, step_m: float) -> IndexArray:
    """Return rows from 0 on, each the first that is at least `step_m` of path after the one before."""
    rows = [0]
    while True:
        row = int(np.searchsorted(along, along[rows[-1]] + step_m * (1.0 - 1e-12)))
        if row >= len(along):
            return np.array(rows, dtype=np.int64)
        rows.append(row)


def heading_drift_deg(estimate: Poses, truth: Poses, along_m: FloatArray) -> float | None:
    """Return the mean of how much the heading's error changes over 100 m of way `along_m` (N,), degrees; None on no way.

    Shorter drives have one stretch, from end to end, and the figure is what 100 m of it would have.
    """
    length_m = min(_DRIFT_M, float(along_m[-1]))
    if length_m <= 0.0:
        return None
    error = np.unwrap(headings(estimate) - headings(truth))
    starts = np.concatenate([[0], _rows_apart(along_m, SEGMENT_START_STEP_M)[1:]]).astype(np.int64)
    stops = np.searchsorted(along_m, along_m[starts] + length_m * (1.0 - 1e-12))
    start, stop = starts[stops < len(along_m)], stops[stops < len(along_m)]
    change = np.degrees(np.abs(error[stop] - error[start]))
    return float(np.mean(change / (along_m[stop] - along_m[start])) * _DRIFT_M)


def end_error_m(estimate: Poses, truth: Poses) -> float:
    """Return how far the estimated last pose is from the true one when the first ones agree in position and heading."""
    ends = np.array([0, -1])
    offsets = []
    for poses in (estimate, truth):
        first, last = poses.positions_m[ends]
        heading = float(headings(taken(poses, ends[:1]))[0])
        c, s = np.cos(heading), np.sin(heading)
        d = last - first
        offsets.append(np.array([c * d[0] + s * d[1], c * d[1] - s * d[0], d[2]]))
    return float(np.linalg.norm(offsets[0] - offsets[1]))


def reach(
    pair_stamps_ns: IndexArray, truth_stamps_ns: IndexArray, truth_positions_m: FloatArray, hole_ns: int
) -> float:
    """Return the share of the true path that the pairs cover, 0 to 1.

    A stretch of the true path counts where there is a pair within `hole_ns` of both of its ends: an estimate that stops
    early or has a hole loses what it does not cover.
    """
    steps_m = np.diff(distances_along(truth_positions_m, truth_stamps_ns))
    total = float(steps_m.sum())
    if total <= 0.0:
        return 1.0
    ordered = np.sort(pair_stamps_ns)
    after = np.searchsorted(ordered, truth_stamps_ns)
    gap_before = truth_stamps_ns - ordered[np.maximum(after - 1, 0)]
    gap_after = ordered[np.minimum(after, len(ordered) - 1)] - truth_stamps_ns
    near = np.minimum(np.abs(gap_before), np.abs(gap_after)) <= hole_ns
    return float(steps_m[near[:-1] & near[1:]].sum()) / total

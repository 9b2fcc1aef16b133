"""Stamps of two clocks: simulation time beside wall time. How far apart they are shows in when the machine moves how fast."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lhdmap.evaluation.poses import distances_along
from lhdmap.messages import FloatArray
from lhdmap.trajectory import Trajectory

_STEP_S = 0.02
_FEWEST_S = 2.0
_LEAST_LIKENESS = 0.9
_TURN_M = 2.0  # a radian of turn counts as so many metres of way

IntArray = npt.NDArray[np.int64]


def clock_offset_ns(estimate: Trajectory, truth: Trajectory) -> int | None:
    """Return what brings the estimate's stamps to the truth's clock, where they share no time; None where nothing tells it.

    Begin, end, or the shift at which the motions of the two are most alike: of these the one that makes them most alike.
    """
    share = min(estimate.stamps_ns.max(), truth.stamps_ns.max()) > max(estimate.stamps_ns.min(), truth.stamps_ns.min())
    if share or min(len(estimate.stamps_ns), len(truth.stamps_ns)) < 3:
        return None
    mine, theirs = _motion(estimate), _motion(truth)
    if min(len(mine), len(theirs)) * _STEP_S < _FEWEST_S:
        return None
    start_ns = int(truth.stamps_ns.min() - estimate.stamps_ns.min())
    candidates = {0, len(theirs) - len(mine), _most_alike(mine, theirs)}
    best = max(candidates, key=lambda shift: _likeness(mine, theirs, shift))
    return start_ns + round(best * _STEP_S * 1e9) if _likeness(mine, theirs, best) >= _LEAST_LIKENESS else None


def shifted(trajectory: Trajectory, by_ns: int) -> Trajectory:
    """Return the trajectory with its stamps moved."""
    return trajectory._replace(stamps_ns=trajectory.stamps_ns + by_ns)


def _motion(trajectory: Trajectory) -> FloatArray:
    """Return the way driven at even times from the first stamp on, shape (M,), turns counted in."""
    seconds = (trajectory.stamps_ns - trajectory.stamps_ns[0]) * 1e-9
    q = trajectory.quaternions_xyzw
    halves = (
        np.abs(np.einsum("ni,ni->n", q[1:], q[:-1])) / np.linalg.norm(q[1:], axis=1) / np.linalg.norm(q[:-1], axis=1)
    )
    turns = np.concatenate([[0.0], np.cumsum(2.0 * np.arccos(np.clip(halves, 0.0, 1.0)))])
    way = distances_along(trajectory.positions_m, trajectory.stamps_ns) + _TURN_M * turns
    return np.interp(np.arange(0.0, seconds[-1], _STEP_S), seconds, way)


def _most_alike(mine: FloatArray, theirs: FloatArray) -> int:
    """Return the shift, in steps, at which the speeds of both are most alike."""
    a, b = np.diff(mine), np.diff(theirs)
    size = len(a) + len(b)
    product = np.fft.irfft(np.fft.rfft(b - b.mean(), size) * np.conj(np.fft.rfft(a - a.mean(), size)), size)
    shift = int(product.argmax())
    return shift if shift < len(b) else shift - size


def _likeness(mine: FloatArray, theirs: FloatArray, shift: int) -> float:
    """Return how alike the ways are at a shift, 1 for the same: what they differ by over what was driven, and what they share."""
    start, end = max(shift, 0), min(shift + len(mine), len(theirs))
    if end - start < 2:
        return 0.0
    a, b = mine[start - shift : end - shift], theirs[start:end]
    driven = float(b[-1] - b[0])
    apart = float(np.abs((a - a[0]) - (b - b[0])).max())
    shared = (end - start) / min(len(mine), len(theirs))
    return shared * (1.0 - apart / driven) if driven > 0.0 else 0.0

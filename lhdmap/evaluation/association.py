"""Which pose of the estimate belongs to which true pose: by stamps, whichever of the two has the higher rate.

Each stamp of the sparser trajectory looks for the nearest of the denser one, within a tolerance (as evo does).
Where the nearest is not exact, the denser trajectory is interpolated at the sparser's stamp: at 24 km/h a stamp that is
5 ms off would otherwise look like an error of 33 mm. Stamps may run backwards (CARMEN logs of Intel do, 631 times): the
search goes through a sorted index, the order given is kept (`ordering` has chosen it), and nothing is interpolated then.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.evaluation.poses import Poses, poses_from_quaternions
from lhdmap.messages import FloatArray
from lhdmap.settings import figure
from lhdmap.trajectory import Trajectory

IndexArray = npt.NDArray[np.int64]
EXACT_NS = 1_000
"""Stamps closer than this are the same stamp: float seconds of other tools keep no more than a microsecond."""
_MOST_STRETCHES = 20  # more steps back than clocks are set in a drive: stamps of old loggers


class Pairs(NamedTuple):
    """Associated poses: `stamps_ns` (N,), of the sparser trajectory, and the two stacks of N poses each."""

    stamps_ns: IndexArray
    estimate: Poses
    truth: Poses


def associate(estimate: Trajectory, truth: Trajectory, tolerance_ns: int = 20_000_000) -> Pairs:
    """Pair the poses of two trajectories.

    Raises:
        InputError: fewer than two pairs; the text says how far apart the nearest stamps are.
    """
    estimate_is_denser = len(estimate.stamps_ns) >= len(truth.stamps_ns)
    dense, sparse = (estimate, truth) if estimate_is_denser else (truth, estimate)
    rows = _nearest(dense.stamps_ns, sparse.stamps_ns)
    away_ns = np.abs(dense.stamps_ns[rows] - sparse.stamps_ns)
    kept = np.flatnonzero(away_ns <= tolerance_ns)
    if len(kept) < 2:
        raise InputError(_too_few(estimate, truth, len(kept), int(away_ns.min()), tolerance_ns))
    from_dense = _at(dense, sparse.stamps_ns[kept], rows[kept])
    from_sparse = poses_from_quaternions(sparse.positions_m[kept], sparse.quaternions_xyzw[kept])
    sides = (from_dense, from_sparse) if estimate_is_denser else (from_sparse, from_dense)
    return Pairs(sparse.stamps_ns[kept], *sides)


def _nearest(stamps_ns: IndexArray, wanted_ns: IndexArray) -> IndexArray:
    """Return `nearest_rows`; stretch by stretch where both step back as often: a clock was set, and times came twice."""
    dense, sparse = _stretches(stamps_ns), _stretches(wanted_ns)
    if len(dense) != len(sparse) or len(dense) > _MOST_STRETCHES:
        return nearest_rows(stamps_ns, wanted_ns)
    parts = [a.start + nearest_rows(stamps_ns[a], wanted_ns[b]) for a, b in zip(dense, sparse, strict=True)]
    return np.concatenate(parts)


def _stretches(stamps_ns: IndexArray) -> list[slice]:
    """Return the stretches of stamps that do not step back."""
    edges = [0, *(np.flatnonzero(np.diff(stamps_ns) < 0) + 1).tolist(), len(stamps_ns)]
    return [slice(start, end) for start, end in itertools.pairwise(edges)]


def nearest_rows(stamps_ns: IndexArray, wanted_ns: IndexArray) -> IndexArray:
    """Return for each wanted stamp (M,) the row of the nearest in `stamps_ns` (N,), which may be in any order."""
    order = np.argsort(stamps_ns, kind="stable")
    ordered = stamps_ns[order]
    after = np.clip(np.searchsorted(ordered, wanted_ns), 1, max(len(ordered) - 1, 1))
    if len(ordered) == 1:
        return np.zeros(len(wanted_ns), dtype=np.int64)
    before = after - 1
    closer = np.abs(ordered[after] - wanted_ns) < np.abs(ordered[before] - wanted_ns)
    return order[np.where(closer, after, before)]


def _at(dense: Trajectory, stamps_ns: IndexArray, nearest: IndexArray) -> Poses:
    """Return the poses of `dense` at the stamps: exact ones as they are, others interpolated if time runs forward."""
    positions, quaternions = dense.positions_m[nearest].copy(), dense.quaternions_xyzw[nearest].copy()
    inexact = np.abs(dense.stamps_ns[nearest] - stamps_ns) > EXACT_NS
    inexact &= (stamps_ns >= dense.stamps_ns[0]) & (stamps_ns <= dense.stamps_ns[-1])
    if inexact.any() and (np.diff(dense.stamps_ns) > 0).all():
        positions[inexact], quaternions[inexact] = interpolated(dense, stamps_ns[inexact])
    return poses_from_quaternions(positions, quaternions)


def interpolated(trajectory: Trajectory, stamps_ns: IndexArray) -> tuple[FloatArray, FloatArray]:
    """Return positions (M, 3) and quaternions (M, 4) at stamps within the trajectory, whose own stamps must increase.

    Linear in position; in rotation the normalised mean of the two neighbours, which for the few degrees between them is
    the same as the great arc to 1e-5 rad.
    """
    after = np.clip(np.searchsorted(trajectory.stamps_ns, stamps_ns), 1, len(trajectory.stamps_ns) - 1)
    before = after - 1
    span_ns = trajectory.stamps_ns[after] - trajectory.stamps_ns[before]
    share = ((stamps_ns - trajectory.stamps_ns[before]) / span_ns)[:, None]
    positions = (1 - share) * trajectory.positions_m[before] + share * trajectory.positions_m[after]
    q_before, q_after = trajectory.quaternions_xyzw[before], trajectory.quaternions_xyzw[after]
    same_side = np.sign(np.einsum("ni,ni->n", q_before, q_after))[:, None]
    mixed = (1 - share) * q_before + share * np.where(same_side == 0, 1.0, same_side) * q_after
    return positions, mixed / np.linalg.norm(mixed, axis=1, keepdims=True)


def _too_few(estimate: Trajectory, truth: Trajectory, found: int, nearest_ns: int, tolerance_ns: int) -> str:
    spans = [
        f"{name} {trajectory.stamps_ns.min() / 1e9:.3f} to {trajectory.stamps_ns.max() / 1e9:.3f} s"
        for name, trajectory in (("estimate", estimate), ("truth", truth))
    ]
    alone = [name for name, one in (("estimate", estimate), ("truth", truth)) if len(one.stamps_ns) < 2]
    if alone:
        return f"{' and '.join(alone)} of one pose ({', '.join(spans)}): at least 2 were wanted"
    apart = max(estimate.stamps_ns.min(), truth.stamps_ns.min()) > min(estimate.stamps_ns.max(), truth.stamps_ns.max())
    hint = "they share no time: are both of one clock?" if apart else "raise --tolerance if both have the same clock"
    return (
        f"{found} matching stamps: at least 2 within {figure(tolerance_ns / 1e9)} s were wanted, the nearest are "
        f"{figure(nearest_ns / 1e9)} s apart ({', '.join(spans)}); {hint}"
    )

"""Poses in the order in which they were driven.

The lines of a TUM file may stand in any order, and two files may have been put one behind the other: then they are sorted by
their stamps. But stamps may be what is wrong: those of CARMEN's Intel log step back by up to 0.9 s, 631 times, while the order
of the file is that of the drive, and so do those of a log whose clock was set back. Which of the two it is shows in the path:
the right order is the shorter one.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.evaluation.poses import JUMP_BACK_NS
from lhdmap.trajectory import Trajectory

_LONGER = 1.02
_MOST_SETTINGS = 5
_RUNS_ON, _RUNS_ON_M = 5.0, 0.05  # of the usual step: what lies before and behind a clock that was set
_MOST_TWICE = 0.05


class Ordered(NamedTuple):
    """A trajectory in the order of its drive, and in words what was done (empty: it was in order)."""

    trajectory: Trajectory
    remark: str = ""


def in_order_of_drive(trajectory: Trajectory) -> Ordered:
    """Return the poses by rising stamps, or in the order given where that makes the shorter path; the same pose counts once."""
    once = _once(trajectory)
    back_ns = -np.diff(once.stamps_ns)
    count = int(np.count_nonzero(back_ns > 0))
    if not count:
        return Ordered(once)
    what = f"stamps run backwards {count} times, by up to {float(back_ns.max()) / 1e9:.3g} s"
    by_time = _rows(once, _sorting(once))
    if _length_m(by_time) <= _LONGER * _length_m(once):
        return Ordered(by_time, f"{what}: its poses were sorted by time")
    return Ordered(once, f"{what}, but the path is the shorter one in the order given, which was kept")


def file_in_order(trajectory: Trajectory, path: Path) -> Ordered:
    """Return the poses of a file whose lines may stand in any order; those in a map folder stand in the order of the scans.

    The remark says what was changed.

    Raises:
        InputError: there are two trajectories in it, so that no order makes a path.
    """
    if (path.parent / "map.json").is_file():
        return Ordered(trajectory)
    once = _once(trajectory)
    if _clock_was_set(once):
        return in_order_of_drive(once)
    twice = len(once.stamps_ns) - len(np.unique(once.stamps_ns))
    if twice > max(1, _MOST_TWICE * len(once.stamps_ns)):
        raise InputError(
            f"{path}: {twice} of its {len(once.stamps_ns)} poses have a stamp that stands there already, with another pose: two "
            "trajectories in one file? One was wanted"
        )
    found = in_order_of_drive(once)
    back = np.flatnonzero(np.diff(found.trajectory.stamps_ns) < -JUMP_BACK_NS)
    if len(back) and not _blocks_apart(once):
        jump_s = float(-np.diff(once.stamps_ns)[back[0]]) / 1e9
        raise InputError(
            f"{path}: its stamps step back by {jump_s:.3g} s at pose {back[0] + 2}, and sorted by time they make no path: two "
            "trajectories in one file? One was wanted"
        )
    if len(back):
        found = Ordered(
            _rows(once, _sorting(once)), f"stamps run backwards {len(back)} times: its poses were sorted by time"
        )
    if (np.diff(found.trajectory.stamps_ns) < 0).any():
        found = found._replace(remark="")
    if not twice:
        return found
    kept = found.remark + "; " if found.remark else ""
    return Ordered(
        _first_of_each(found.trajectory), f"{kept}{twice} poses have the stamp of another one: they were left out"
    )


def _clock_was_set(trajectory: Trajectory) -> bool:
    """Return whether stamps step back a few times, and the path runs on where they do: no second file begins there."""
    back = np.diff(trajectory.stamps_ns) < 0
    steps_m = np.linalg.norm(np.diff(trajectory.positions_m, axis=0), axis=1)
    runs_on = (steps_m[back] <= _RUNS_ON * float(np.median(steps_m)) + _RUNS_ON_M).all() if back.any() else False
    return bool(0 < np.count_nonzero(back) <= _MOST_SETTINGS and runs_on)


def _once(trajectory: Trajectory) -> Trajectory:
    """Return the trajectory without repetitions of the same stamp and pose, in its order."""
    order = _sorting(trajectory)
    table = _table(trajectory)[order]
    same = (np.diff(trajectory.stamps_ns[order]) == 0) & (np.diff(table, axis=0) == 0.0).all(axis=1)
    if not same.any():
        return trajectory
    return _rows(trajectory, np.sort(order[np.concatenate([[True], ~same])]))


def _first_of_each(trajectory: Trajectory) -> Trajectory:
    """Return the trajectory with one pose of each stamp, in its order."""
    order = _sorting(trajectory)
    first = np.concatenate([[True], np.diff(trajectory.stamps_ns[order]) > 0])
    return _rows(trajectory, np.sort(order[first]))


def _sorting(trajectory: Trajectory) -> npt.NDArray[np.int64]:
    return np.lexsort((*_table(trajectory).T[::-1], trajectory.stamps_ns))


def _table(trajectory: Trajectory) -> npt.NDArray[np.float64]:
    return np.column_stack([trajectory.positions_m, trajectory.quaternions_xyzw])


def _rows(trajectory: Trajectory, rows: npt.NDArray[np.int64]) -> Trajectory:
    return Trajectory(trajectory.stamps_ns[rows], trajectory.positions_m[rows], trajectory.quaternions_xyzw[rows])


def _length_m(trajectory: Trajectory) -> float:
    return float(np.linalg.norm(np.diff(trajectory.positions_m, axis=0), axis=1).sum())


def _blocks_apart(trajectory: Trajectory) -> bool:
    """Return whether the stretches of rising stamps have each their own span of time: they only change places."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(trajectory.stamps_ns) < 0) + 1])
    ends = np.append(starts[1:] - 1, len(trajectory.stamps_ns) - 1)
    order = np.argsort(trajectory.stamps_ns[starts])
    return bool((trajectory.stamps_ns[starts][order][1:] > trajectory.stamps_ns[ends][order][:-1]).all())

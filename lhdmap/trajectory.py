"""Trajectories: poses of `base_link` over time, and their TUM files (`t x y z qx qy qz qw`)."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import LhdmapWarning
from lhdmap.geometry import se3
from lhdmap.messages import FloatArray
from lhdmap.tables.pose_table import read_pose_table
from lhdmap.tables.stamps import stamp_ns

_TUM_LINE = "%d.%09d %.6f %.6f %.6f %.9f %.9f %.9f %.9f\n"
_LINES = 10_000  # formatted at a time: as Python numbers they take ten times the memory


class Trajectory(NamedTuple):
    """Poses over time: `stamps_ns` (N,) int64, `positions_m` (N, 3), `quaternions_xyzw` (N, 4)."""

    stamps_ns: npt.NDArray[np.int64]
    positions_m: FloatArray
    quaternions_xyzw: FloatArray

    @property
    def T_map_base(self) -> FloatArray:  # noqa: N802  # frames in the name
        """The poses as matrices, shape (N, 4, 4): they take points from `base_link` to `map`."""
        return se3.from_quaternions(self.quaternions_xyzw, self.positions_m)


def write_tum(path: Path, trajectory: Trajectory) -> None:
    """Write a TUM file: seconds with 9 decimals (exact nanoseconds), metres with 6."""
    with path.open("w", encoding="ascii") as file:
        for first in range(0, len(trajectory.stamps_ns), _LINES):
            file.writelines(_lines(trajectory, slice(first, first + _LINES)))


def _lines(trajectory: Trajectory, rows: slice) -> Iterator[str]:
    seconds, nanoseconds = np.divmod(trajectory.stamps_ns[rows], 1_000_000_000)
    stamps = zip(seconds.tolist(), nanoseconds.tolist(), strict=True)
    # plain floats print faster
    poses = np.column_stack([trajectory.positions_m[rows], trajectory.quaternions_xyzw[rows]]).tolist()
    return (_TUM_LINE % (*stamp, *pose) for stamp, pose in zip(stamps, poses, strict=True))


def read_tum(path: Path) -> Trajectory:
    """Read a TUM file, or another table of poses over time (`lhdmap.tables.pose_table`), in the order of the file.

    Comments and blank lines are passed over; lines with NaN or without a rotation, too, with a warning.

    Raises:
        InputError: the file is missing, empty, or not what was wanted.
    """
    table = read_pose_table(path)
    for remark in table.remarks:
        warnings.warn(f"{path}: {remark}", LhdmapWarning, stacklevel=2)
    return Trajectory(table.stamps_ns, table.poses[:, :3], table.poses[:, 3:])


def seconds_to_ns(text: str) -> int:
    """Return a decimal number of seconds as integer nanoseconds, without rounding through a float.

    Raises:
        ValueError: it is no number, or more seconds than 64 bits of nanoseconds hold.
    """
    try:
        return stamp_ns(text)
    except OverflowError as error:
        raise ValueError(str(error)) from None

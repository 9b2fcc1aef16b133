"""Trajectories: poses of `base_link` over time, and their TUM files (`t x y z qx qy qz qw`)."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.geometry import se3
from lhdmap.messages import FloatArray

_TUM_LINE = "%d.%09d %.6f %.6f %.6f %.9f %.9f %.9f %.9f\n"


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
    seconds, nanoseconds = np.divmod(trajectory.stamps_ns, 1_000_000_000)
    stamps = zip(seconds.tolist(), nanoseconds.tolist(), strict=True)
    poses = np.column_stack([trajectory.positions_m, trajectory.quaternions_xyzw]).tolist()  # plain floats print faster
    lines = [_TUM_LINE % (*stamp, *pose) for stamp, pose in zip(stamps, poses, strict=True)]
    path.write_text("".join(lines), encoding="ascii")


def read_tum(path: Path) -> Trajectory:
    """Read a TUM file (comments and blank lines are passed over).

    Raises:
        InputError: the file is missing, empty, or a line has not eight numbers.
    """
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    stamps, values = [], []
    for number, line in enumerate(lines, 1):
        fields = line.replace(",", " ").split()
        if not fields or fields[0].startswith("#"):
            continue
        try:
            stamps.append(seconds_to_ns(fields[0]))
            values.append([float(field) for field in fields[1:8]])
        except ValueError:
            raise InputError(f"{path}, line {number}: eight numbers (t x y z qx qy qz qw) were wanted") from None
        if len(values[-1]) != 7 or not np.isfinite(values[-1]).all():
            raise InputError(f"{path}, line {number}: eight finite numbers (t x y z qx qy qz qw) were wanted")
    if not stamps:
        raise InputError(f"{path}: no pose in it")
    table = np.array(values)
    return Trajectory(np.array(stamps, dtype=np.int64), table[:, :3], table[:, 3:])


def seconds_to_ns(text: str) -> int:
    """Return a decimal number of seconds as integer nanoseconds without rounding through a float where it is plain decimal."""
    whole, _, fraction = text.partition(".")
    if fraction.isdigit() and whole.lstrip("+-").isdigit():
        sign = -1 if whole.startswith("-") else 1
        return int(whole) * 1_000_000_000 + sign * int(fraction[:9].ljust(9, "0"))
    return round(float(text) * 1e9)

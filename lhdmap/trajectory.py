"""Trajectories: poses of `base_link` over time, and their TUM files (`t x y z qx qy qz qw`)."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.messages import FloatArray


class Trajectory(NamedTuple):
    """Poses over time: `stamps_ns` (N,) int64, `positions_m` (N, 3), `quaternions_xyzw` (N, 4)."""

    stamps_ns: npt.NDArray[np.int64]
    positions_m: FloatArray
    quaternions_xyzw: FloatArray


def write_tum(path: Path, trajectory: Trajectory) -> None:
    """Write a TUM file: seconds with 9 decimals (exact nanoseconds), metres with 6."""
    with path.open("w", encoding="ascii") as file:
        rows = zip(trajectory.stamps_ns, trajectory.positions_m, trajectory.quaternions_xyzw, strict=True)
        for stamp_ns, p, q in rows:
            seconds, nanoseconds = divmod(int(stamp_ns), 1_000_000_000)
            file.write(
                f"{seconds}.{nanoseconds:09d} {p[0]:.6f} {p[1]:.6f} {p[2]:.6f} {q[0]:.9f} {q[1]:.9f} {q[2]:.9f} {q[3]:.9f}\n"
            )


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

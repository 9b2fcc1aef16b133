"""The numbers of a pose table: stamps to the nanosecond, finite places, rotations; what is none is left out and told."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.messages import FloatArray
from lhdmap.tables.pose_header import POSE, Header
from lhdmap.tables.stamps import NS_PER_S, contradiction, guessed_unit_ns, of_epoch, stamp_ns, unit_name

_LARGEST = 1e9  # metres: what is larger is no place
_SMALLEST_NORM = 1e-6
_NORM_ERROR = 0.05
_ROUNDED = 1e-6


class PoseTable(NamedTuple):
    """Poses in the order of the file: `stamps_ns` (N,), `poses` (N, 7) x y z qx qy qz qw; `remarks`: what was noticed."""

    stamps_ns: npt.NDArray[np.int64]
    poses: FloatArray
    remarks: tuple[str, ...]


class Rows(NamedTuple):
    """Rows of data as they stand in the file: their line numbers and cells, and what these were separated by."""

    path: Path
    numbers: list[int]
    cells: list[list[str]]
    separator: str

    def place(self, row: int) -> str:
        """Return file and line of a row, for texts."""
        return f"{self.path}, line {self.numbers[row]}"

    def taken(self, kept: npt.NDArray[np.int64]) -> Rows:
        """Return some of the rows."""
        return self._replace(numbers=[self.numbers[k] for k in kept], cells=[self.cells[k] for k in kept])


def values_of(rows: Rows, header: Header) -> PoseTable:
    """Return the poses of a table whose columns are known.

    Raises:
        InputError: something is no number, or too large for one, or no line has a pose.
    """
    poses = np.array([_pose(rows, row, header) for row in range(len(rows.cells))])
    unknown = np.isnan(poses).any(axis=1) | np.array([_is_nan(cells, header) for cells in rows.cells])
    turned = np.linalg.norm(np.nan_to_num(poses[:, 3:]), axis=1) > _SMALLEST_NORM
    kept = np.flatnonzero(~unknown & turned)
    remarks = [
        *_left_out(rows, unknown, "hold NaN"),
        *_left_out(rows, ~unknown & ~turned, "hold the quaternion 0 0 0 0, which is no rotation"),
    ]
    if not len(kept):
        raise InputError(f"{rows.path}: no pose in it: {'; '.join(remarks)}")
    stamps, told = _stamps(rows.taken(kept), header)
    poses = poses[kept] * (*header.scale_m, 1.0, 1.0, 1.0, 1.0)
    remarks += [*told, *_not_unit(poses[:, 3:])]
    poses[:, 3:] = _normalised(poses[:, 3:])
    return PoseTable(stamps, poses, tuple(remarks))


def _pose(rows: Rows, row: int, header: Header) -> list[float]:
    cells = rows.cells[row]
    try:
        values = [float(cells[at]) for at in header.pose]
    except ValueError:
        at, name = next((at, name) for at, name in zip(header.pose, POSE, strict=True) if not _is_float(cells[at]))
        raise InputError(f"{rows.place(row)}: {name} is '{cells[at][:40]}'; a number was wanted") from None
    for at, name, value in zip(header.pose, POSE, values, strict=True):
        if abs(value) > _LARGEST:
            raise InputError(f"{rows.place(row)}: {name} is {cells[at][:40]}; at most {_LARGEST:g} was wanted")
    return values


def _is_float(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _is_nan(cells: list[str], header: Header) -> bool:
    return any(cells[one.at].lstrip("+-").lower() == "nan" for one in header.time)


def _left_out(rows: Rows, which: npt.NDArray[np.bool_], why: str) -> list[str]:
    count = int(np.count_nonzero(which))
    if not count:
        return []
    first = rows.numbers[int(np.argmax(which))]
    return [f"{count} of {len(which)} lines {why} (line {first} is the first): they were left out"]


def _stamps(rows: Rows, header: Header) -> tuple[npt.NDArray[np.int64], list[str]]:
    """Return the stamps in nanoseconds, and in words in which unit they were taken to be where no header says it."""
    values = [_rough(rows, row, header.time[0].at) for row in range(len(rows.cells))]
    told: list[str] = []
    units = [one.unit_ns for one in header.time]
    if len(units) > 1:
        pass  # seconds and nanoseconds: nothing is left to ask
    elif units[0]:
        text = contradiction(np.array(values), units[0])
        if text:
            raise InputError(f"{rows.path}: {text}")
    else:
        units = [guessed_unit_ns(np.array(values))]
        if not units[0]:
            raise InputError(
                f"{rows.path}: it cannot be told in which unit its stamps are (the first is {rows.cells[0][header.time[0].at]}); "
                "name it in the first line: '# t[ns] x y z qx qy qz qw'"
            )
        told = (
            []
            if units[0] in (NS_PER_S, of_epoch(np.array(values)))
            else [f"its stamps were taken to be {unit_name(units[0])}"]
        )
    stamps = [_stamp(rows, row, header, units) for row in range(len(rows.cells))]
    return np.array(stamps, dtype=np.int64), told


def _rough(rows: Rows, row: int, at: int) -> float:
    try:
        return float(rows.cells[row][at])
    except ValueError:
        raise InputError(f"{rows.place(row)}: the time is '{rows.cells[row][at][:40]}'; a number was wanted") from None


def _stamp(rows: Rows, row: int, header: Header, units: list[int]) -> int:
    try:
        return sum(stamp_ns(rows.cells[row][one.at], unit) for one, unit in zip(header.time, units, strict=True))
    except ValueError as error:
        raise InputError(f"{rows.place(row)}: the time: {error}; a number was wanted") from None
    except OverflowError as error:
        raise InputError(f"{rows.place(row)}: the time {error}") from None


def _not_unit(quaternions: FloatArray) -> list[str]:
    norm = float(np.median(np.linalg.norm(quaternions, axis=1)))
    if abs(norm - 1.0) < _NORM_ERROR:
        return []
    return [f"its quaternions are not of unit length but around {norm:.3g}: are the columns t x y z qx qy qz qw?"]


def _normalised(quaternions: FloatArray) -> FloatArray:
    """Return unit quaternions; those that are but for the digits of a file stay as they were written."""
    norms = np.linalg.norm(quaternions, axis=1, keepdims=True)
    return np.where(np.abs(norms - 1.0) > _ROUNDED, quaternions / norms, quaternions)

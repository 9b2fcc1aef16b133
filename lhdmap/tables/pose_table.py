"""Poses over time as tables of text: TUM files, EuRoC's CSV, and what other tools write, with or without names of the columns."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lhdmap.errors import InputError
from lhdmap.tables.pose_header import PLAIN, Header, header_of, names_w_first
from lhdmap.tables.pose_values import PoseTable, Rows, values_of
from lhdmap.tables.text import Layout, is_number, layout_of, read_text

WANTED = "lines of eight numbers (t x y z qx qy qz qw), or a first line that names the columns, were wanted"
_UNIT_NORM = 0.02
_SAMPLE = 20
_MATRIX, _MATRIX_4X4 = 12, 16
_COMMENTS = ("#", "%", "//")


def read_pose_table(path: Path) -> PoseTable:
    """Read poses; lines that hold NaN or no rotation are left out with a remark.

    Raises:
        InputError: the file is missing or empty, its columns are not clear, or a line has something else than finite numbers.
    """
    lines = [(number, line.strip()) for number, line in enumerate(read_text(path).splitlines(), 1)]
    header, rows = _parted(path, [(number, line) for number, line in lines if line])
    if header is None:
        header = _without_names(rows)
    elif header.names == len(rows.cells[0]) - 1 and _has_index(rows, header):
        header = header.shifted()
    _check_widths(rows, header)
    return values_of(rows, header)


def _parted(path: Path, lines: list[tuple[int, str]]) -> tuple[Header | None, Rows]:
    """Return the header (None: there is none) and the rows of data."""
    data = [(number, line) for number, line in lines if not line.startswith(_COMMENTS)]
    first = next((k for k, (_, line) in enumerate(data) if _holds_numbers(line)), None)
    if first is None:
        raise InputError(f"{path}: no pose in it; {WANTED}")
    names = data[:first] or [(n, line) for n, line in lines if line.startswith(_COMMENTS) and n < data[0][0]]
    header = _header(path, names, is_comment=not first)
    repeated = {line for _, line in data[:first]}
    data = [(number, line) for number, line in data[first:] if line not in repeated]
    layout = layout_of(path, [line for _, line in data[:_SAMPLE]], 8)
    rows = Rows(path, [number for number, _ in data], [layout.cells(line) for _, line in data], layout.separator)
    return header, _with_points(rows, layout)


def _holds_numbers(line: str) -> bool:
    return any(is_number(cell) for cell in re.split(r"[\s;,\"]+", line))


def _header(path: Path, lines: Sequence[tuple[int, str]], *, is_comment: bool) -> Header | None:
    """Return the columns that the last of these lines with names has; of a comment, only where it has all of them."""
    for number, line in reversed(lines):
        try:
            found = header_of(line)
        except ValueError as error:
            raise InputError(f"{path}, line {number}: {error}") from None
        if found is not None and not found.missing:
            return found
        if not is_comment or names_w_first(line):
            missing = f"no column for {found.missing}" if found else f"'{line[:60]}' names no columns that are known"
            raise InputError(f"{path}, line {number}: {missing}; names like t x y z qx qy qz qw were wanted")
    return None


def _with_points(rows: Rows, layout: Layout) -> Rows:
    if not layout.decimal_comma:
        return rows
    for row, cells in enumerate(rows.cells):
        if any("." in cell and is_number(cell) for cell in cells):
            raise InputError(f"{rows.place(row)}: decimal commas and points are mixed; one of them was wanted")
    return rows._replace(cells=[[cell.replace(",", ".") for cell in cells] for cells in rows.cells])


def _without_names(rows: Rows) -> Header:
    """Return the columns of a table that does not name them: eight as in TUM files, or an index before these.

    Raises:
        InputError: there are other columns.
    """
    width = len(rows.cells[0])
    if width == PLAIN.names or (width == PLAIN.names + 1 and _has_index(rows, PLAIN)):
        return PLAIN if width == PLAIN.names else PLAIN.shifted()
    what = f"{width} numbers a line"
    if _only_commas(rows) and width > PLAIN.names:
        what += ", all whole: decimal commas, separated by commas? Points, or semicolons between the columns, help"
    elif width == _MATRIX:
        what += " and no time: KITTI's 3 x 4 matrices? Add the stamps, and turn the matrices into quaternions"
    elif width == _MATRIX_4X4:
        what += " and no time: 4 x 4 matrices? Add the stamps, and turn the matrices into quaternions"
    raise InputError(f"{rows.place(0)}: {what}; {WANTED}")


def _has_index(rows: Rows, header: Header) -> bool:
    """Return whether whole numbers stand before the columns of `header`: those one further on hold the unit quaternions."""
    if not all(cells and cells[0].isdigit() for cells in rows.cells[:_SAMPLE]):
        return False
    return _are_rotations(rows, header.shifted()) and not _are_rotations(rows, header)


def _are_rotations(rows: Rows, header: Header) -> bool:
    try:
        values = np.array([[float(cells[at]) for at in header.pose[3:]] for cells in rows.cells[:_SAMPLE]])
    except (ValueError, IndexError):
        return False
    norms = np.linalg.norm(values[np.isfinite(values).all(axis=1)], axis=1)
    return bool(len(norms)) and bool((np.abs(norms - 1.0) < _UNIT_NORM).all())


def _only_commas(rows: Rows) -> bool:
    """Return whether there is no point in numbers that are separated by commas."""
    return rows.separator == "," and all(
        cell.lstrip("+-").isdigit() for cells in rows.cells[:_SAMPLE] for cell in cells
    )


def _check_widths(rows: Rows, header: Header) -> None:
    """Refuse lines that are shorter than the columns need, or, without names, than the first one."""
    width = len(rows.cells[0])
    if header.names < width and _only_commas(rows):
        raise InputError(
            f"{rows.place(0)}: {width} whole numbers under {header.names} names: decimal commas, separated by commas? "
            "Points, or semicolons between the columns, were wanted"
        )
    needed = 1 + max(*header.pose, *(one.at for one in header.time))
    for row, cells in enumerate(rows.cells):
        if len(cells) < needed or (header.names == width and len(cells) != width):
            raise InputError(f"{rows.place(row)}: {len(cells)} numbers; {max(needed, width)} were wanted; {WANTED}")

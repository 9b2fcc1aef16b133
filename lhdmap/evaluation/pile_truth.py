"""Ground truth of piles in the style of Table 6 (autonomous loading paper): a CSV file with one attempt a line.

Columns are found by their names in the first line that is no comment (`#`): `attempt,gt_width_m,gt_inclination_deg`, and `log` or
`pred_width_m,pred_inclination_deg` (or both), optionally `gt_status`, `pred_status`, `pred_width_std_m` and
`pred_inclination_std_deg`. Other columns are passed over. An empty cell is a value that is not known. Cells are separated by
commas, semicolons or tabs; a decimal comma is one wherever it does not separate.
"""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import NamedTuple

from lhdmap.errors import InputError
from lhdmap.pile.result import STATUSES
from lhdmap.tables.text import read_text

REQUIRED = ("attempt", "gt_width_m", "gt_inclination_deg")
PREDICTED = ("pred_width_m", "pred_inclination_deg")
_NOTHING = ("", "nan", "na", "n/a", "null", "-")
_LARGEST = {"_m": 1e3, "_deg": 360.0}


class Measured(NamedTuple):
    """Width (m), inclination (deg, Table 6's sign), their standard deviations and the status; None where not known."""

    width_m: float | None = None
    inclination_deg: float | None = None
    status: str | None = None
    width_std_m: float | None = None
    inclination_std_deg: float | None = None


class Attempt(NamedTuple):
    """One line of the file: its name, its log (as written, relative to the file), the truth, and what was predicted."""

    name: str
    log: str
    truth: Measured
    predicted: Measured

    @property
    def is_predicted(self) -> bool:
        """Whether anything was predicted."""
        return any(value is not None for value in self.predicted)


class PileTruth(NamedTuple):
    """All attempts of a file, and whether any of them has to be run, and any holds a prediction of the status.

    An attempt with a log and no prediction has to be run. One with neither was not identified, as others of the file were.
    """

    path: Path
    attempts: tuple[Attempt, ...]
    has_statuses: bool

    @property
    def needs_run(self) -> bool:
        """Whether there is a log to run."""
        return any(self.is_run(attempt) for attempt in self.attempts)

    def is_run(self, attempt: Attempt) -> bool:
        """Return whether the log of an attempt has to be run."""
        return bool(attempt.log) and not attempt.is_predicted

    def log_path(self, attempt: Attempt) -> Path:
        """Return where the log of an attempt is: its path is relative to the file."""
        return self.path.parent / attempt.log


def read_pile_truth(path: Path) -> PileTruth:
    """Read a truth file.

    Raises:
        InputError: the file is missing or empty, a column is missing, or a cell holds no valid value.
    """
    lines = _lines(path)
    if not lines:
        raise InputError(f"{path}: it is empty; a table with the columns {','.join(REQUIRED)} was wanted")
    header = [name.strip().lower() for name in lines[0][1]]
    _check_header(f"{path}, line {lines[0][0]}", header)
    if len(lines) == 1:
        raise InputError(
            f"{path}: only the line with the column names is there; one line an attempt was wanted below it"
        )
    attempts = tuple(_attempt(f"{path}, line {number}", header, cells) for number, cells in lines[1:])
    if not any(attempt.is_predicted for attempt in attempts):
        _check_logs(path, attempts)
    return PileTruth(path, attempts, any(attempt.predicted.status is not None for attempt in attempts))


def _check_header(place: str, header: list[str]) -> None:
    missing = [name for name in REQUIRED if name not in header]
    if not missing and "log" not in header and not {*PREDICTED, "pred_status"} & set(header):
        missing = [f"log (or {', '.join(PREDICTED)})"]
    twice = [name for name in header if name and header.count(name) > 1]
    if missing:
        raise InputError(
            f"{place}: no column {', '.join(missing)}; found: {', '.join(header)}; columns {','.join(REQUIRED)}, and log or "
            f"{','.join(PREDICTED)}, separated by commas, semicolons or tabs, were wanted"
        )
    if twice:
        raise InputError(f"{place}: the column {twice[0]} stands twice")


def _lines(path: Path) -> list[tuple[int, list[str]]]:
    """Return number and cells of each line that is neither blank nor a comment."""
    text = read_text(path, strict=True)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=_separator(text), skipinitialspace=True)
    try:
        rows = [(reader.line_num, cells) for cells in reader]
    except csv.Error as error:
        raise InputError(f"{path}, line {reader.line_num}: no valid CSV: {error}") from None
    return [
        (number, cells) for number, cells in rows if "".join(cells).strip() and not cells[0].lstrip().startswith("#")
    ]


def _separator(text: str) -> str:
    """Return what separates the names in the first line that is no comment."""
    lines = (line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#"))
    header = next(lines, "")
    return next((one for one in (";", "\t") if one in header), ",")


def _attempt(place: str, header: list[str], cells: list[str]) -> Attempt:
    if any(cell.strip() for cell in cells[len(header) :]):
        raise InputError(
            f"{place}: {len(cells)} cells, but {len(header)} columns; a decimal comma, perhaps? A point was wanted, or "
            "semicolons between the columns"
        )
    row = {name: cell.strip() for name, cell in zip(header, cells, strict=False)}
    return Attempt(
        row.get("attempt", ""), row.get("log", ""), _measured(place, row, "gt_"), _measured(place, row, "pred_")
    )


def _measured(place: str, row: dict[str, str], prefix: str) -> Measured:
    names = ("width_m", "inclination_deg", "width_std_m", "inclination_std_deg")
    width, inclination, width_std, inclination_std = (_number(place, row, prefix + name) for name in names)
    written = row.get(prefix + "status", "")
    status = None if written.lower() in _NOTHING else "_".join(written.lower().replace("-", " ").split())
    if status is not None and status not in STATUSES:
        raise InputError(f"{place}: {prefix}status is '{written}'; one of {', '.join(STATUSES)} was wanted")
    return Measured(width, inclination, status, width_std, inclination_std)


def _number(place: str, row: dict[str, str], name: str) -> float | None:
    """Return the value of a cell; the minus sign may be the typographic one, as copied from the paper."""
    text = row.get(name, "")
    if text.lower() in _NOTHING:
        return None
    limit = _LARGEST["_deg" if name.endswith("_deg") else "_m"]
    try:
        value = float(text.replace("\N{MINUS SIGN}", "-").replace(",", "." if "." not in text else ","))
    except ValueError:
        raise InputError(f"{place}: {name} is '{text}'; a number was wanted") from None
    if not math.isfinite(value) or abs(value) > limit or (name.endswith("_m") and value < 0.0):
        raise InputError(
            f"{place}: {name} is {text}; {'0' if name.endswith('_m') else f'-{limit:g}'} to {limit:g} was wanted"
        )
    return value


def _check_logs(path: Path, attempts: tuple[Attempt, ...]) -> None:
    for attempt in attempts:
        if not attempt.log:
            raise InputError(
                f"{path}: attempt {attempt.name or '?'} has neither a log nor predictions; fill in the column log "
                f"(relative to the file), or {', '.join(PREDICTED)}"
            )

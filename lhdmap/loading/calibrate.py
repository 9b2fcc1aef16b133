"""m and n of Eq. (9) from weighed buckets: a line of fill over pressure, with confidence intervals."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lhdmap.errors import InputError
from lhdmap.messages import FloatArray

PRESSURE, FILL, MASS = "pressure_bar", "fill", "mass_t"
LEAST_POINTS = 5
LEAST_SPREAD = 0.3
"""Fills that are weighed must be so far apart, from the emptiest to the fullest."""
_T_95 = (12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228)
"""Student's t, two-sided 95 %, of 1 to 10 degrees of freedom (any table); beyond: an expansion in 1 / degrees."""


class WeightModel(NamedTuple):
    """`fill = m P - n` with 95 % intervals (half widths), the deviation of a single weighing, and the number of points."""

    m: float
    n: float
    m_95: float
    n_95: float
    fill_std: float
    points: int

    def to_json(self) -> dict[str, Any]:
        """Return what `--json` prints."""
        return {
            "fill_per_bar": self.m,
            "fill_offset": self.n,
            "fill_per_bar_95": [self.m - self.m_95, self.m + self.m_95],
            "fill_offset_95": [self.n - self.n_95, self.n + self.n_95],
            "fill_std": self.fill_std,
            "points": self.points,
        }


def fit_weights(pressure_bar: FloatArray, fill: FloatArray) -> WeightModel:
    """Return the least-squares line through weighed buckets, shapes (N,).

    Raises:
        InputError: too few points, pressures or fills too alike for a line, or a line whose slope may be zero.
    """
    count = len(pressure_bar)
    if count < LEAST_POINTS:
        raise InputError(f"{count} weighed buckets: {LEAST_POINTS} were wanted at least, from empty to full")
    spread = float(np.ptp(fill))
    if spread < LEAST_SPREAD or len(np.unique(np.round(fill, 2))) < 3:
        raise InputError(
            f"fills from {fill.min():.2f} to {fill.max():.2f}: three different ones, {LEAST_SPREAD:g} apart, were wanted"
        )
    centred = pressure_bar - pressure_bar.mean()
    squares = float(centred @ centred)
    if squares <= 0.0:
        raise InputError(f"all pressures are {pressure_bar[0]:g} bar: no line can be laid through them")
    m = float(centred @ fill) / squares
    n = m * float(pressure_bar.mean()) - float(fill.mean())
    std = math.sqrt(float(((fill - (m * pressure_bar - n)) ** 2).sum()) / (count - 2))
    t = student_95(count - 2)
    m_95 = t * std / math.sqrt(squares)
    n_95 = t * std * math.sqrt(1.0 / count + float(pressure_bar.mean()) ** 2 / squares)
    if m - m_95 <= 0.0:
        raise InputError(f"m = {m:.4f} ± {m_95:.4f} per bar may be zero: pressure and fill do not go together")
    return WeightModel(m, n, m_95, n_95, std, count)


def student_95(degrees: int) -> float:
    """Return Student's t for a two-sided interval of 95 %."""
    if degrees <= len(_T_95):
        return _T_95[degrees - 1]
    z = 1.959964
    g1, g2 = (z**3 + z) / 4.0, (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0
    g3 = (3.0 * z**7 + 19.0 * z**5 + 17.0 * z**3 - 15.0 * z) / 384.0
    return z + g1 / degrees + g2 / degrees**2 + g3 / degrees**3


def read_weighings(path: Path, full_t: float) -> tuple[FloatArray, FloatArray]:
    """Return pressures (N,), bar, and fills (N,) of a CSV table with `pressure_bar` and `fill` or `mass_t`.

    Raises:
        InputError: it cannot be read, lacks a column, or has a cell that is no finite number.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not a readable CSV table ({error})") from error
    names = {str(name).strip(): name for name in (rows[0] if rows else {})}
    what = FILL if FILL in names else MASS
    if PRESSURE not in names or what not in names:
        raise InputError(f"{path}: columns {', '.join(names) or 'none'}; {PRESSURE} and {FILL} or {MASS} were wanted")
    pressures = [_number(path, line, row[names[PRESSURE]]) for line, row in enumerate(rows, start=2)]
    values = [_number(path, line, row[names[what]]) for line, row in enumerate(rows, start=2)]
    return np.array(pressures), np.array(values) / (1.0 if what == FILL else full_t)


def _number(path: Path, line: int, text: str | None) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{path}, line {line}: '{text}' is not a number")
    return value

"""The curves of a long log at a bounded length: no screen shows a million points, and they would take a gibibyte on their way.

Of each group of scans in a row the worst stays, so that no short dip, jump or flag is lost.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from lhdmap.mapfolder import Diagnostics
from lhdmap.messages import FloatArray
from lhdmap.report.data import AngleSeries, ReportData, SpeedSeries
from lhdmap.report.topology_levels import coarser
from lhdmap.trajectory import Trajectory

MOST_ROWS = 100_000  # more than an hour of scans at 25 Hz
MOST_CELLS, MOST_CLOSURES = (
    2000,
    5000,
)  # to a side of a sheet; the topology itself grows with the mine, not with the log
Indices = npt.NDArray[np.int64]
_Series = TypeVar("_Series", SpeedSeries, AngleSeries)


def bounded(data: ReportData, most: int = MOST_ROWS) -> ReportData:
    """Return the data with curves and paths of no more than `most` rows; shorter ones stay as they are."""
    return replace(
        data,
        trajectory=_path(data.trajectory, most),
        odometry=None if data.odometry is None else _path(data.odometry, most),
        diagnostics=None if data.diagnostics is None else _worst(data.diagnostics, most),
        odometry_speed=_extremes(data.odometry_speed, most),
        tachometer_speed=_extremes(data.tachometer_speed, most),
        articulation=_extremes(data.articulation, most),
        sheets=[coarser(sheet, MOST_CELLS) for sheet in data.sheets],
        closures=data.closures[:MOST_CLOSURES],
    )


def _starts(rows: int, most: int) -> Indices:
    """Return the first row of each of `most` groups of nearly the same size."""
    return np.linspace(0, rows, most + 1).astype(np.int64)[:-1]


def _path(way: Trajectory, most: int) -> Trajectory:
    """Return evenly spaced poses, the first and the last among them."""
    rows = len(way.stamps_ns)
    if rows <= most:
        return way
    kept = np.linspace(0, rows - 1, most).astype(np.int64)
    return Trajectory(way.stamps_ns[kept], way.positions_m[kept], way.quaternions_xyzw[kept])


def _extremes(series: _Series | None, most: int) -> _Series | None:
    """Return the smallest and the largest value of each group, in the order in which they came."""
    if series is None or len(series.stamps_ns) <= most:
        return series
    stamps_ns, values = series
    starts = _starts(len(values), most // 2)
    low, high = (_first_where(values, starts, edge) for edge in (np.minimum, np.maximum))
    kept = np.sort(np.concatenate([low, high]))
    return type(series)(stamps_ns[kept], values[kept])


def _worst(found: Diagnostics, most: int) -> Diagnostics:
    """Return of each group the scan that fixes the motion worst, a flagged one first; the largest slip and residual."""
    rows = len(found.stamp_ns)
    if rows <= most:
        return found
    starts = _starts(rows, most)
    flagged = np.asarray(found.degenerate)
    least = np.minimum(np.minimum(found.information_along, found.information_across), found.information_heading)
    kept = _first_where(np.where(flagged, least - 1e18, least), starts, np.minimum)
    slip, residual = (_largest(np.asarray(values), starts) for values in (found.slip, found.residual))
    known = {name: column for name, column in found._asdict().items() if column is not None}
    columns = {name: np.asarray(column)[kept] for name, column in known.items()}
    words = {name: columns[name].tolist() for name in ("substitute", "wheels")}
    return Diagnostics(**columns | words | {"slip": slip, "residual": residual})


def _first_where(values: FloatArray, starts: Indices, edge: np.ufunc) -> Indices:
    """Return the row of each group that has its smallest (`np.minimum`) or largest value; NaN is none."""
    none = np.inf if edge is np.minimum else -np.inf
    filled = np.where(np.isnan(values), none, values)
    best = edge.reduceat(filled, starts)
    lengths = np.diff(np.append(starts, len(values)))
    rows = np.flatnonzero(filled == np.repeat(best, lengths))
    found: Indices = rows[np.searchsorted(rows, starts)]
    return found


def _largest(values: FloatArray, starts: Indices) -> FloatArray:
    """Return the value of each group that is farthest from zero."""
    found: FloatArray = values[_first_where(np.abs(values), starts, np.maximum)]
    return found

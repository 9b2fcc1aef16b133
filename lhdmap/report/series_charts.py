"""Charts over the time of the drive: speed and slip, and how well the scans fix the motion along, across and in heading."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lhdmap.mapfolder import Diagnostics
from lhdmap.messages import FloatArray
from lhdmap.report import charts
from lhdmap.report.data import ReportData, SpeedSeries

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_MM, _MOST_DEG = 1000.0, 10.0  # where the scales end at the latest


def speed_chart(data: ReportData) -> Figure:
    """Draw the speeds by odometry and tachometer, and below them the slip where it is known."""
    slip = data.slip()
    figure = charts.new_figure(2.6 if slip is None else 4.2)
    figure.subplots_adjust(hspace=0.25)
    panels = figure.subplots(1 if slip is None else 2, 1, sharex=True, squeeze=False)[:, 0]
    series = ((data.tachometer_speed, "tachometer", charts.WHEELS), (data.odometry_speed, "odometry", charts.FINAL))
    for speed, label, colour in series:
        if speed is not None and len(speed.stamps_ns):
            panels[0].plot(*_over_time(speed, data), color=colour, label=label)
    panels[0].axhline(0.0, color=charts.INK, linewidth=0.6, alpha=0.5)
    panels[0].set_ylabel("speed, m/s")
    if slip is not None:
        x, y = charts.envelope(_seconds(slip.stamps_ns, data), 100.0 * slip.share)
        panels[1].plot(x, y, color=charts.WHEELS, label="slip of the wheels")
        low, high = np.nanpercentile(y, [0.5, 99.5])
        panels[1].set(ylabel="slip, %", ylim=(min(1.2 * low, -5.0), max(1.2 * high, 5.0)))
        charts.legend_above(panels[1])
    panels[-1].set_xlabel("time since the first scan, s")
    panels[-1].set_xlim(0.0, max(float(_seconds(data.trajectory.stamps_ns[-1:], data)[0]), 1.0))
    charts.legend_above(panels[0])
    return figure


def deviation_chart(data: ReportData, diagnostics: Diagnostics) -> Figure:
    """Draw how well each scan fixes the motion in the machine's frame, as standard deviations; unobserved stretches shaded."""
    figure = charts.new_figure(5.0)
    figure.subplots_adjust(hspace=0.22)
    panels = figure.subplots(3, 1, sharex=True)
    seen, given = ~np.asarray(diagnostics.degenerate, dtype=bool), _given(diagnostics)
    rows = (
        ("along, mm", 1e3 * deviations(diagnostics.information_along), charts.FINAL, _MOST_MM),
        ("across, mm", 1e3 * deviations(diagnostics.information_across), charts.ODOMETRY, _MOST_MM),
        ("heading, °", np.degrees(deviations(diagnostics.information_heading)), charts.TRUTH, _MOST_DEG),
    )
    time_s = _seconds(diagnostics.stamp_ns, data)
    for axes, (label, values, colour, most) in zip(panels, rows, strict=True):
        values = np.where(given, np.nan, values)
        top = _top(values, seen, most)
        charts.shade(axes, time_s, diagnostics.degenerate, "a direction was not observed")
        axes.plot(*charts.envelope(time_s, np.minimum(values, 0.985 * top)), color=colour, linewidth=1.0)
        axes.set(ylabel=label, ylim=(0.0, top))
        axes.yaxis.set_label_coords(-0.065, 0.5)
    panels[-1].set_xlabel("time since the first scan, s")
    panels[-1].set_xlim(0.0, max(float(_seconds(data.trajectory.stamps_ns[-1:], data)[0]), 1.0))
    charts.legend_above(panels[0])
    return figure


def deviations(information: FloatArray) -> FloatArray:
    """Return the standard deviation of each information (M,): one over its root, infinite where there is none."""
    with np.errstate(divide="ignore"):
        return np.where(np.isnan(information), np.nan, 1.0 / np.sqrt(np.maximum(information, 0.0)))


def _given(diagnostics: Diagnostics) -> npt.NDArray[np.bool_]:
    """Return which scans were matched with nothing, as the first one is: information that is alike in all directions is set."""
    along, across = np.asarray(diagnostics.information_along), np.asarray(diagnostics.information_across)
    return (along == across) & (across == np.asarray(diagnostics.information_heading)) & (along > 0.0)


def _top(values: FloatArray, seen: npt.NDArray[np.bool_], most: float) -> float:
    """Return the end of an axis that shows what was observed well; what was not goes to its edge."""
    for rows in (seen, np.ones(len(seen), dtype=bool)):
        shown = values[rows & np.isfinite(values)]
        if len(shown):
            return float(np.clip(1.4 * np.percentile(shown, 99.0), 1e-3 * most, most))
    return most


def _seconds(stamps_ns: npt.NDArray[np.int64], data: ReportData) -> FloatArray:
    return (stamps_ns - data.trajectory.stamps_ns[0]) / 1e9


def _over_time(speed: SpeedSeries, data: ReportData) -> tuple[FloatArray, FloatArray]:
    return charts.envelope(_seconds(speed.stamps_ns, data), speed.speed_mps)

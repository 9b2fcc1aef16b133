"""Charts over the time of the drive: speed and slip, information along, across and in heading."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lhdmap.mapfolder import Diagnostics
from lhdmap.messages import FloatArray
from lhdmap.report import charts
from lhdmap.report.data import ReportData, SpeedSeries

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def speed_chart(data: ReportData) -> Figure:
    """Draw the speeds by odometry and tachometer, and below them the slip where it is known."""
    slip = _known_slip(data.diagnostics)
    figure = charts.new_figure(4.2 if slip else 2.6)
    figure.subplots_adjust(hspace=0.25)
    panels = figure.subplots(2 if slip else 1, 1, sharex=True, squeeze=False)[:, 0]
    series = ((data.tachometer_speed, "tachometer", charts.WHEELS), (data.odometry_speed, "odometry", charts.FINAL))
    for speed, label, colour in series:
        if speed is not None and len(speed.stamps_ns):
            panels[0].plot(*_over_time(speed, data), color=colour, label=label)
    panels[0].axhline(0.0, color=charts.INK, linewidth=0.6, alpha=0.5)
    panels[0].set_ylabel("speed, m/s")
    if slip and data.diagnostics is not None:
        x, y = charts.envelope(_seconds(data.diagnostics.stamp_ns, data), 100.0 * data.diagnostics.slip)
        panels[1].plot(x, y, color=charts.WHEELS, label="slip of the wheels")
        low, high = np.nanpercentile(y, [0.5, 99.5])
        panels[1].set(ylabel="slip, %", ylim=(min(1.2 * low, -5.0), max(1.2 * high, 5.0)))
        charts.legend_above(panels[1])
    panels[-1].set_xlabel("time since the first scan, s")
    panels[-1].set_xlim(0.0, max(float(_seconds(data.trajectory.stamps_ns[-1:], data)[0]), 1.0))
    charts.legend_above(panels[0])
    return figure


def information_chart(data: ReportData, diagnostics: Diagnostics) -> Figure:
    """Draw the information of each scan in the machine's frame, flagged stretches shaded."""
    figure = charts.new_figure(5.0)
    figure.subplots_adjust(hspace=0.22)
    panels = figure.subplots(3, 1, sharex=True)
    rows = (
        ("along, 1/m²", diagnostics.information_along, charts.FINAL),
        ("across, 1/m²", diagnostics.information_across, charts.ODOMETRY),
        ("heading, 1/rad²", diagnostics.information_heading, charts.TRUTH),
    )
    time_s = _seconds(diagnostics.stamp_ns, data)
    for axes, (label, values, colour) in zip(panels, rows, strict=True):
        charts.shade(axes, time_s, diagnostics.degenerate, "a direction was not observed")
        axes.plot(*charts.envelope(time_s, _positive(values)), color=colour, linewidth=1.0)
        _decades(axes, values)
        axes.set_ylabel(label)
    for axes in panels:
        axes.yaxis.set_label_coords(-0.055, 0.5)
    panels[-1].set_xlabel("time since the first scan, s")
    panels[-1].set_xlim(0.0, max(float(_seconds(data.trajectory.stamps_ns[-1:], data)[0]), 1.0))
    charts.legend_above(panels[0])
    return figure


def _seconds(stamps_ns: npt.NDArray[np.int64], data: ReportData) -> FloatArray:
    return (stamps_ns - data.trajectory.stamps_ns[0]) / 1e9


def _over_time(speed: SpeedSeries, data: ReportData) -> tuple[FloatArray, FloatArray]:
    return charts.envelope(_seconds(speed.stamps_ns, data), speed.speed_mps)


def _known_slip(diagnostics: Diagnostics | None) -> bool:
    return diagnostics is not None and bool(np.isfinite(np.asarray(diagnostics.slip, dtype=float)).any())


def _decades(axes: Axes, values: FloatArray) -> None:
    """Give the axes a logarithmic scale over whole decades, two at least, with labels at decades only."""
    from matplotlib.ticker import LogLocator, NullLocator

    shown = _positive(values)
    shown = shown[np.isfinite(shown)]
    low, high = (np.log10(shown.min()), np.log10(shown.max())) if len(shown) else (0.0, 2.0)
    bottom = np.floor(low)
    axes.set_yscale("log")
    axes.set_ylim(10.0**bottom, 10.0 ** max(np.ceil(high), bottom + 2))
    axes.yaxis.set_major_locator(LogLocator(numticks=6))
    axes.yaxis.set_minor_locator(NullLocator())


def _positive(values: FloatArray) -> FloatArray:
    """Return the values with those that a logarithm cannot show at a tenth of the smallest that it can."""
    shown = values[np.isfinite(values) & (values > 0)]
    floor = float(shown.min()) / 10.0 if len(shown) else 1.0
    return np.where(np.isfinite(values), np.maximum(values, floor), np.nan)

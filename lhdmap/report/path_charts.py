"""Charts of the path: plan, height profile, errors against the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lhdmap.evaluation.poses import distances_along
from lhdmap.evaluation.trajectory import Profile
from lhdmap.messages import FloatArray
from lhdmap.report import charts
from lhdmap.report.data import ReportData
from lhdmap.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LEAP_M = 5.0


def plan_chart(data: ReportData) -> Figure:
    """Draw final trajectory, odometry and truth in map from above, equal scales."""
    figure = charts.new_figure(charts.plan_height_in(data.trajectory.positions_m))
    axes = figure.add_subplot()
    lines = _lines(data)
    for label, points, colour, style in lines:
        drawn = _broken(points[charts.thinned(len(points))], points)
        axes.plot(drawn[:, 0], drawn[:, 1], style, color=colour, label=label)
    _ends(axes, lines[-1][1])
    plan_axes(axes)
    charts.legend_above(axes, columns=5)
    return figure


def _broken(thinned_m: FloatArray, points_m: FloatArray) -> FloatArray:
    """Return points (M, 3) with a gap where a path of several drives leaps from the end of one to the start of the next."""
    steps = np.hypot(*np.diff(thinned_m[:, :2], axis=0).T)
    whole = np.hypot(*np.diff(points_m[:, :2], axis=0).T)
    leaps = np.flatnonzero(steps > max(_LEAP_M, 20.0 * float(np.median(steps)))) if len(steps) else steps
    if not len(whole) or whole.max() <= _LEAP_M or not len(leaps):
        return thinned_m
    return np.insert(thinned_m, leaps.astype(int) + 1, np.nan, axis=0)


def profile_chart(data: ReportData) -> Figure:
    """Draw height over the distance driven."""
    figure = charts.new_figure(2.4)
    axes = figure.add_subplot()
    for label, points, colour, style in _lines(data):
        rows = charts.thinned(len(points))
        axes.plot(distances_along(points)[rows], points[rows, 2], style, color=colour, label=label)
    axes.set(xlabel="distance driven, m", ylabel="height, m")
    low, high = axes.get_ylim()
    if high - low < 1.0:
        axes.set_ylim((low + high) / 2 - 0.5, (low + high) / 2 + 0.5)
    charts.legend_above(axes)
    return figure


def error_chart(profile: Profile) -> Figure:
    """Draw the error along, across and in height over the true distance."""
    figure = charts.new_figure(2.4)
    axes = figure.add_subplot()
    draw_errors(axes, profile)
    return figure


def draw_errors(axes: Axes, profile: Profile) -> None:
    """Draw the three error components into the axes, in centimetres where they are small."""
    rows = charts.thinned(len(profile.distance_m))
    centimetres = float(np.abs(profile.errors_m).max(initial=0.0)) < 1.0
    scale, unit = (100.0, "cm") if centimetres else (1.0, "m")
    parts = (("along", charts.FINAL), ("across (left +)", charts.ODOMETRY), ("height", charts.TRUTH))
    for column, (label, colour) in enumerate(parts):
        axes.plot(profile.distance_m[rows], scale * profile.errors_m[rows, column], color=colour, label=label)
    axes.set(xlabel="true distance, m", ylabel=f"error, {unit}")
    charts.legend_above(axes)


def plan_axes(axes: Axes) -> None:
    """Give the axes of a plan equal scales and their names."""
    axes.set(xlabel="x, m", ylabel="y, m")
    axes.set_aspect("equal", adjustable="datalim")


def _lines(data: ReportData) -> list[tuple[str, FloatArray, str, str]]:
    lines = []
    if data.evaluation is not None:
        lines.append(("truth", data.evaluation.truth_in_estimate_frame_m(), charts.TRUTH, "-"))
    if data.odometry is not None and not _same(data.odometry, data.trajectory):
        lines.append(("odometry alone", data.odometry.positions_m, charts.ODOMETRY, "--"))
    lines.append(("given poses" if data.poses else "final trajectory", data.trajectory.positions_m, charts.FINAL, "-"))
    return lines


def _same(one: Trajectory, other: Trajectory) -> bool:
    """Return whether two trajectories cannot be told apart on a chart."""
    if one.positions_m.shape != other.positions_m.shape:
        return False
    return bool(np.abs(one.positions_m - other.positions_m).max(initial=0.0) < 1e-3)


def _ends(axes: Axes, points_m: FloatArray) -> None:
    axes.plot(*points_m[0, :2], "o", color=charts.FINAL, markersize=6, label="start")
    axes.plot(*points_m[-1, :2], "s", color=charts.WHEELS, markersize=6, label="end")

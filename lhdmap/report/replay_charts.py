"""Charts of a replay: the way from above, figures over time, states of the processes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.report import charts
from lhdmap.report.path_charts import plan_axes
from lhdmap.report.replay_data import Change, ReplayData
from lhdmap.report.replay_drive_charts import draw_drive, extent_m, name_places

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SECOND_NS = 1e9
_MOST_BARS = 400
_GAP_S = 1.0
_LEGEND_COLUMNS, _LEGEND_ROW_IN = 6, 0.19
NOT_PLANNED = ""
_LANE_IN, _NAMES_IN = 0.42, 1.15
_SHADES = (charts.FINAL, charts.ODOMETRY, charts.TRUTH, charts.FLAGGED, charts.WHEELS, "#8a949e", "#b7d3ea", "#f0c419")


def plan_chart(data: ReplayData) -> Figure:
    """Draw walls, true path, what perception believed, start, end, goal, contacts and where faults began."""
    way = data.rows[:, 1:4]
    ways = np.vstack([way, *(rows[:, 1:4] for rows in data.others.values())])
    whole = np.vstack([ways, *data.lines_m]) if data.drive is None else extent_m(data.drive, ways)
    figure = charts.new_figure(charts.plan_height_in(whole, least=3.0) + _LEGEND_ROW_IN)
    axes = figure.add_subplot()
    for line in data.lines_m:
        axes.plot(line[:, 0], line[:, 1], color=charts.INK, linewidth=0.6, alpha=0.35)
    if data.drive is not None:
        draw_drive(axes, data.drive)
    for (name, others), colour in zip(data.others.items(), _SHADES[3:], strict=False):
        if len(others):
            rows = charts.thinned(len(others))
            axes.plot(others[rows, 1], others[rows, 2], color=colour, linewidth=1.2, label=f"true path of {name}")
    rows = charts.thinned(len(way))
    axes.plot(way[rows, 0], way[rows, 1], color=charts.FINAL, label="true path")
    if len(data.believed_m):
        rows = charts.thinned(len(data.believed_m))
        axes.plot(*data.believed_m[rows, :2].T, "--", color=charts.ODOMETRY, label="path by perception")
    axes.plot(*way[0, :2], "o", color=charts.FINAL, markersize=6, label="start")
    axes.plot(*way[-1, :2], "s", color=charts.WHEELS, markersize=6, label="end")
    if data.goal_m is not None:
        axes.plot(*data.goal_m[:2], "*", color=charts.TRUTH, markersize=11, label="goal")
    _marks(axes, [contact["point_m"] for contact in data.verdict["contacts"]], "X", charts.WHEELS, "contact")
    begun = [fault["began_s"] for fault in data.verdict["faults"] if fault["began_s"] is not None]
    _marks(axes, [_place_at(data, at_s) for at_s in begun], "v", charts.FLAGGED, "fault begins")
    plan_axes(axes)
    heads = -(-len(axes.get_legend_handles_labels()[0]) // _LEGEND_COLUMNS)
    figure.subplots_adjust(top=1.0 - (0.12 + _LEGEND_ROW_IN * heads) / figure.get_figheight())
    charts.legend_above(axes, columns=_LEGEND_COLUMNS)
    if data.drive is not None:
        _look_at(axes, whole)
        name_places(axes, data.drive, way)
    return figure


def _look_at(axes: Axes, corners_m: FloatArray) -> None:
    """Set the limits to corners (2, 2) with equal scales, and to more on the sides that have room."""
    low, high = corners_m
    room = np.array([axes.bbox.width, axes.bbox.height])
    half = 0.5 * room * float(((high - low) / room).max())
    x, y = 0.5 * (low + high)
    axes.set(xlim=(x - half[0], x + half[0]), ylim=(y - half[1], y + half[1]), autoscale_on=False, aspect="equal")


def time_chart(data: ReplayData) -> Figure:
    """Draw speed, joint and steering, and where it is known clearance over time; faults shaded."""
    time_s, clearance_m, drive = data.column("time_s"), data.column("clearance_m"), data.drive
    seen = bool(np.isfinite(clearance_m).any())
    count = 3 if seen else 2
    figure = charts.new_figure(0.6 + 1.9 * count)
    figure.subplots_adjust(hspace=0.32)
    panels = figure.subplots(count, 1, sharex=True)
    wanted_kmh, speed_kmh = 3.6 * data.column("wanted_mps"), 3.6 * data.column("speed_mps")
    if drive is not None and len(drive.plans):
        _curve(panels[0], *_with_gaps(drive.plan("time_s"), 3.6 * drive.plan("planned_mps")), charts.TRUTH, "planned")
        if seen:
            _curve(
                panels[2], *_with_gaps(drive.plan("time_s"), drive.plan("clearance_m")), charts.ODOMETRY, "predicted"
            )
    _curve(panels[0], time_s, wanted_kmh, charts.ODOMETRY, "commanded", linewidth=1.0)
    _curve(panels[0], time_s, speed_kmh, charts.FINAL, "true")
    panels[0].set_ylabel("speed, km/h")
    _curve(
        panels[1],
        time_s,
        np.degrees(data.column("steering_rps")),
        charts.ODOMETRY,
        "steering command, °/s",
        linewidth=0.9,
    )
    _curve(panels[1], time_s, np.degrees(data.column("articulation_rad")), charts.TRUTH, "articulation, left +, °")
    panels[1].set_ylabel("joint, °, °/s")
    if seen:
        _curve(panels[2], time_s, clearance_m, charts.WHEELS, "true: least distance of a body to a wall")
        panels[2].set(ylabel="clearance, m", ylim=(0.0, None))
    for axes in panels:
        _shade_faults(axes, data)
        axes.yaxis.set_label_coords(-0.065, 0.5)
        charts.legend_above(axes)
    panels[-1].set_xlabel("time, s")
    panels[-1].set_xlim(0.0, max(data.verdict["duration_s"], 1.0))
    return figure


def _curve(axes: Axes, x: FloatArray, y: FloatArray, colour: str, label: str, **more: Any) -> None:
    axes.plot(*charts.envelope(x, y), color=colour, label=label, **more)


def _with_gaps(time_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a curve (N,) with a gap where nothing was planned for more than a second, or five steps of a thinned one."""
    steps = np.diff(time_s)
    gap = max(_GAP_S, 5.0 * float(np.median(steps)) if len(steps) else 0.0)
    at = np.flatnonzero(steps > gap) + 1
    return np.insert(time_s, at, time_s[at - 1]), np.insert(values, at, np.nan)


def state_chart(data: ReplayData) -> Figure:
    """Draw the states of each process as bars over time."""
    lanes = [*data.changes.items(), *limit_lane(data)]
    figure = charts.new_figure(0.8 + _LANE_IN * len(lanes))
    figure.subplots_adjust(left=_NAMES_IN / charts.WIDTH_IN)
    axes = figure.add_subplot()
    end_s = max(data.verdict["duration_s"], 1.0)
    for row, (_, changes) in enumerate(lanes):
        _lane(axes, row, [((one.t_ns - data.start_ns) / _SECOND_NS, one) for one in changes], end_s)
    axes.set_yticks(range(len(lanes)), [name for name, _ in lanes])
    axes.set(xlabel="time, s", xlim=(0.0, end_s), ylim=(len(lanes) - 0.5, -0.5))
    axes.grid(visible=False)
    _shade_faults(axes, data)
    charts.legend_above(axes)
    return figure


def limit_lane(data: ReplayData) -> list[tuple[str, list[Change]]]:
    """Return what limited the speed as changes of state; nothing where nobody plans."""
    drive = data.drive
    if drive is None or not len(drive.plans):
        return []
    time_s, which = drive.plan("time_s"), drive.plan("limit").astype(int)
    steps = np.diff(time_s)
    ends = np.append(steps > max(_GAP_S, 5.0 * float(np.median(steps)) if len(steps) else 0.0), True)
    changes: list[Change] = []
    for row, (at_s, name) in enumerate(zip(time_s.tolist(), [drive.limits[k] for k in which], strict=True)):
        if not changes or changes[-1].state != name:
            changes.append(Change(data.start_ns + round(at_s * _SECOND_NS), name, ""))
        if ends[row]:
            changes.append(Change(data.start_ns + round(at_s * _SECOND_NS), NOT_PLANNED, ""))
    return [("speed limited by", changes)]


def _lane(axes: Axes, row: int, changes: list[tuple[float, Change]], end_s: float) -> None:
    """Draw the bars of one process; the name of a state stands in those that are wide enough."""
    names = list(dict.fromkeys(change.state for _, change in changes))
    ends = [at_s for at_s, _ in changes[1:]] + [end_s]
    for (at_s, change), until_s in list(zip(changes, ends, strict=True))[:_MOST_BARS]:
        if change.state == NOT_PLANNED:
            continue
        width_s = max(until_s - at_s, end_s / 800)
        colour = _SHADES[names.index(change.state) % len(_SHADES)]
        axes.barh(row, width_s, left=at_s, height=0.7, color=colour, alpha=0.55)
        if width_s > 0.011 * end_s * len(change.state):
            axes.text(at_s + 0.5 * width_s, row, change.state, ha="center", va="center", fontsize=7.5)


def _shade_faults(axes: Axes, data: ReplayData) -> None:
    end_s, told = data.verdict["duration_s"], False
    for fault in data.verdict["faults"]:
        if fault["began_s"] is not None:
            until_s = end_s if fault["ended_s"] is None else fault["ended_s"]
            label = None if told else "fault"
            axes.axvspan(fault["began_s"], until_s, color=charts.FLAGGED, alpha=0.2, linewidth=0, label=label)
            told = True


def _marks(axes: Axes, points_m: list[FloatArray], marker: str, colour: str, label: str) -> None:
    if points_m:
        x, y = np.array(points_m)[:, :2].T
        axes.plot(x, y, marker, color=colour, markersize=7, label=label)


def _place_at(data: ReplayData, at_s: float) -> FloatArray:
    time_s = data.column("time_s")
    return np.array([np.interp(at_s, time_s, data.rows[:, k]) for k in (1, 2, 3)])

"""The picture of a mission: the way from above in the colours of its phases, and under it speed and phases over time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lhdmap.haulage.records import Phase
from lhdmap.report import charts
from lhdmap.report import topology_drawing as drawing
from lhdmap.report.loading_charts import Span, spans_of
from lhdmap.report.path_charts import plan_axes
from lhdmap.report.production_charts import PHASE_COLOURS
from lhdmap.report.replay_data import ReplayData

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LANE = "mission"
_MOST_S = 900.0  # of a longer run its beginning: bars of single phases have to stay readable
_STRIP_IN, _LEGEND_IN = 1.9, 0.2
_TEXT_SHARE = 0.0085  # of the strip's width, a letter
_COLUMNS = 7
_WIDEST, _NARROWER, _NARROWEST = 5.5, 0.7, 1.4
_KNOWN = {str(phase): phase for phase in Phase}


def has_mission(data: ReplayData) -> bool:
    """Return whether the run has phases to draw."""
    return bool(data.changes.get(LANE)) and len(data.rows) > 1


def write_mission_picture(path: Path, data: ReplayData) -> None:
    """Write the picture as a PNG file on white ground."""
    with charts.styled():
        charts.write_figure(mission_chart(data), path, "png")


def mission_chart(data: ReplayData) -> Figure:
    """Draw walls, the true way by phase and the names of the places; speed and phases over time."""
    end_s = min(data.verdict["duration_s"], _MOST_S)
    spans = [one for one in spans_of(data.changes[LANE], data.start_ns, end_s) if one.from_s < end_s]
    spans = [one._replace(to_s=min(one.to_s, end_s)) for one in spans]
    whole = np.vstack([data.rows[:, 1:4], *data.lines_m])
    plan_in = charts.plan_height_in(whole, least=2.6)
    figure = charts.new_figure(plan_in + _STRIP_IN + _LEGEND_IN)
    plan, strip = figure.subplots(2, 1, height_ratios=(plan_in, _STRIP_IN))
    figure.subplots_adjust(hspace=1.1 / (0.5 * (plan_in + _STRIP_IN)), top=1.0 - 0.45 / figure.get_figheight())
    _draw_plan(plan, data, spans)
    _draw_strip(strip, data, spans, end_s)
    return figure


def _draw_plan(axes: Axes, data: ReplayData, spans: list[Span]) -> None:
    for line in data.lines_m:
        axes.plot(line[:, 0], line[:, 1], color=charts.INK, linewidth=0.7, alpha=0.5)
    time_s, states = data.column("time_s"), list(dict.fromkeys(span.state for span in spans))
    told = set[str]()
    for span in spans:
        rows = np.flatnonzero((time_s >= span.from_s - 0.1) & (time_s <= span.to_s + 0.1))
        x, y = data.rows[rows, 1], data.rows[rows, 2]
        label = None if span.state in told else span.state
        told.add(span.state)
        width = max(_WIDEST - _NARROWER * states.index(span.state), _NARROWEST)  # what lies under another is seen, too
        axes.plot(x, y, color=charts.INK, linewidth=width + 0.7, alpha=0.5)  # pale phases are seen on white
        axes.plot(x, y, color=_colour(span.state), linewidth=width, label=label, solid_capstyle="round")
    plan_axes(axes)
    charts.legend_above(axes, columns=_COLUMNS)
    if data.drive is not None and data.drive.topology is not None:
        axes.apply_aspect()  # labels are placed on the page
        points = data.drive.topology.waypoints
        drawing.draw_marks(axes, [one.pose for one in points], "d", charts.INK, "", markersize=5)
        drawing.draw_labels(axes, [(one.name, one.pose, 4.0) for one in points], [data.rows[:, 1:4], *data.lines_m])


def _draw_strip(axes: Axes, data: ReplayData, spans: list[Span], end_s: float) -> None:
    """Draw speed over time over bars of the phases, each with its seconds where they fit."""
    time_s, speed_kmh = charts.envelope(data.column("time_s"), 3.6 * data.column("speed_mps"))
    axes.plot(time_s, speed_kmh, color=charts.INK, linewidth=0.9)
    low, high = (float(one) for one in (np.nanmin(speed_kmh), np.nanmax(speed_kmh)))
    height = 0.22 * max(high - low, 1.0)
    for span in spans:
        width_s = span.to_s - span.from_s
        axes.axvspan(span.from_s, span.to_s, color=_colour(span.state), alpha=0.25, linewidth=0)
        text = next((one for one in _texts(span) if width_s > _TEXT_SHARE * end_s * len(one)), "")
        axes.text(0.5 * (span.from_s + span.to_s), high + 0.5 * height, text, ha="center", va="center", fontsize=7.5)
    axes.set(xlim=(0.0, max(end_s, 1.0)), ylim=(low - 0.1 * height, high + height))
    axes.set(xlabel="time, s", ylabel="speed, km/h")


def _texts(span: Span) -> tuple[str, str]:
    seconds = f"{span.to_s - span.from_s:.0f} s"
    return f"{span.state} {seconds}", seconds


def _colour(state: str) -> str:
    return PHASE_COLOURS[_KNOWN[state]] if state in _KNOWN else drawing.GREY

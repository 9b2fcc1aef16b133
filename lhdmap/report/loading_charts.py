"""Charts of a loading, after Figs. 5, 14, 16 and 23 of the autonomous-loading paper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.report import charts
from lhdmap.report.loading_data import LoadData
from lhdmap.report.replay_data import Change

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_S_NS = 1e9
_SHADES = {
    "rock_pile_identification": "#b7d3ea", "positioning": "#d9e8c5", "charging": "#f0c419", "excavation": "#e8a37c",
    "pull_back": "#cfd6dc", "payload_weighing": "#d7c5e8", "positioning_assistance": "#e26d6d", "loading_assistance": "#e26d6d",
    "held": "#8a949e",
}  # fmt: skip
_TOUCH = (
    ("transmission_bar", 0.01, charts.WHEELS, "transmission, 100 bar"),
    ("skid", 1.0, charts.ODOMETRY, "skid factor"),
    ("embed_m", 1.0, charts.TRUTH, "lip in rock (true), m"),
)
_BEFORE_S, _AFTER_S = 4.0, 2.0
_PANEL_IN = 1.45


class Span(NamedTuple):
    """A state of the loading task: from when to when, s."""

    state: str
    from_s: float
    to_s: float


def spans_of(changes: Sequence[Change], start_ns: int, end_s: float) -> list[Span]:
    """Return the states of the task as spans of time."""
    if not changes:
        return []
    starts = [(one.t_ns - start_ns) / _S_NS for one in changes]
    return [Span(one.state, start, end) for one, start, end in zip(changes, starts, [*starts[1:], end_s], strict=True)]


def signals_chart(data: LoadData, spans: Sequence[Span]) -> Figure:
    """Draw commands, angles, pressures, speeds and fill over time, the task's states shaded (Figs. 5, 23)."""
    figure = charts.new_figure(0.9 + 5 * _PANEL_IN)
    figure.subplots_adjust(hspace=0.5)
    panels = figure.subplots(5, 1, sharex=True)
    _draw(panels[0], data, (("propel", "pedal"), ("tilt", "tilt"), ("lift", "lift")), "command")
    _draw(panels[1], data, (("bucket_rad", "tilt angle α"), ("boom_rad", "lift angle β")), "angle, rad")
    bars = (("transmission_bar", "transmission"), ("lift_bar", "lift cylinders"), ("tilt_bar", "tilt cylinder"))
    _draw(panels[2], data, bars, "pressure, bar")
    _draw(
        panels[3], data, (("tacho_mps", "tachometer"), ("scan_mps", "scan odometry"), ("skid", "skid factor")), "m/s, 1"
    )
    panels[3].set_ylim(-1.6, 1.6)
    _draw(panels[4], data, (("fill", "as weighed"), ("fill_true", "true")), "fill")
    panels[4].set_ylim(0.0, 1.25)
    for axes in panels:
        _shade(axes, spans)
        axes.yaxis.set_label_coords(-0.065, 0.5)
        charts.legend_above(axes, columns=3)
    panels[-1].set_xlabel("time, s")
    _names(panels[-1], spans)
    return figure


def charge_chart(data: LoadData, spans: Sequence[Span]) -> Figure | None:
    """Draw the seconds around each touch of the pile, at most three: pressure, skid, and truly how deep the lip is (Fig. 16)."""
    touches = [one.to_s for one in spans if one.state == "charging"][:3]
    if not touches:
        return None
    figure = charts.new_figure(2.9)
    panels = np.atleast_1d(figure.subplots(1, len(touches), sharey=True))
    time_s = data.column("time_s")
    for number, (axes, at_s) in enumerate(zip(panels, touches, strict=True), start=1):
        near = (time_s > at_s - _BEFORE_S) & (time_s < at_s + _AFTER_S)
        for name, scale, colour, words in _TOUCH:
            axes.plot(time_s[near] - at_s, scale * data.column(name)[near], color=colour, label=words)
        axes.axvline(0.0, color=charts.INK, linewidth=0.8)
        axes.set_xlabel(f"charge {number}: time after the touch was told, s")
    charts.legend_above(panels[0], columns=3)
    return figure


def press_chart(data: LoadData, spans: Sequence[Span]) -> Figure | None:
    """Draw the tilt cylinder's pressure while the bucket is lowered before each charge (Fig. 14)."""
    ends = [one.from_s for one in spans if one.state == "charging"][:3]
    if not ends:
        return None
    figure = charts.new_figure(2.2)
    axes = figure.add_subplot()
    time_s, bars = data.column("time_s"), data.column("tilt_bar")
    for number, at_s in enumerate(ends, start=1):
        near = (time_s > at_s - 10.0) & (time_s < at_s + 0.5)
        axes.plot(time_s[near] - at_s, bars[near], label=f"charge {number}")
    axes.set(xlabel="time before the charge, s", ylabel="tilt cylinder, bar")
    charts.legend_above(axes, columns=3)
    return figure


def _draw(axes: Axes, data: LoadData, curves: Sequence[tuple[str, str]], label: str) -> None:
    colours = (charts.FINAL, charts.ODOMETRY, charts.TRUTH)
    for (name, words), colour in zip(curves, colours, strict=False):
        _curve(axes, data.column("time_s"), data.column(name), colour, words)
    axes.set_ylabel(label)


def _curve(axes: Axes, x: FloatArray, y: FloatArray, colour: str, label: str, **more: Any) -> None:
    axes.plot(*charts.envelope(x, y, bins=1400), color=colour, label=label, linewidth=0.9, **more)


def _shade(axes: Axes, spans: Sequence[Span]) -> None:
    for one in spans:
        if one.state in _SHADES:
            axes.axvspan(one.from_s, one.to_s, color=_SHADES[one.state], alpha=0.35, linewidth=0)


def _names(axes: Axes, spans: Sequence[Span]) -> None:
    """Write the states under the lowest panel, where there is room for them."""
    whole = max((one.to_s for one in spans), default=1.0)
    for one in spans:
        if one.state in _SHADES and one.to_s - one.from_s > 0.011 * whole * len(one.state.replace("_", " ")) * 0.75:
            middle = 0.5 * (one.from_s + one.to_s)
            axes.text(middle, 0.04, one.state.replace("_", " "), ha="center", va="bottom", fontsize=6.5)

"""Charts of a drive as in Figs. 15 to 20 of the navigation paper, and of the walls beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lhdmap.evaluation.navigation.drive import STEP_S, Samples
from lhdmap.evaluation.navigation.walls import WallRow
from lhdmap.messages import FloatArray
from lhdmap.report import charts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MODE_LEVELS = {"autonomous": 10.0, "idle": 0.0, "manual": -5.0, "assisted": -10.0, "teleoperated": -10.0}
"""The paper's scale: 10 autonomous, 0 idle, −10 tele-operation (assisted is that); manual has a level of its own."""


_MODES = "mode: 10 autonomous, −5 manual, −10 tele-operated"


def overview(samples: Samples) -> Figure:
    """Draw speed (km/h) and mode, and on a scale of its own the distance, over time: Fig. 15."""
    figure = charts.new_figure(3.2, right_in=0.65)
    axes = figure.add_subplot()
    levels = np.array([MODE_LEVELS.get(str(one), np.nan) for one in samples.mode])
    told = np.isfinite(levels).any()
    if told:
        axes.step(samples.time_s, levels, where="mid", color=charts.ODOMETRY, label=_MODES)
    axes.plot(*charts.envelope(samples.time_s, 3.6 * samples.speed_mps), color=charts.FINAL, label="speed, km/h")
    axes.plot([], [], "--", color=charts.TRUTH, label="travelled, m (right)")
    axes.axhline(0.0, color=charts.INK, linewidth=0.6, alpha=0.5)
    axes.set(xlabel="time, s", ylabel="speed, km/h; mode" if told else "speed, km/h", xlim=_span(samples))
    charts.legend_above(axes)
    right = axes.twinx()
    travelled = np.cumsum(np.abs(np.nan_to_num(samples.speed_mps)) * samples.moving) * STEP_S
    right.plot(*charts.envelope(samples.time_s, travelled), "--", color=charts.TRUTH)
    right.set(ylabel="travelled, m", ylim=(0.0, None))
    right.grid(visible=False)
    return figure


def steering(samples: Samples) -> Figure:
    """Draw the steering command and the angle of the joint: Figs. 17, 18."""
    angle_deg = np.degrees(samples.articulation_rad)
    return _pair(samples, (samples.steering, "steering command, ±1"), (angle_deg, "articulation, °"))


def propulsion(samples: Samples) -> Figure:
    """Draw the propel command and the speed: Figs. 19, 20."""
    return _pair(samples, (samples.propel, "propel command, ±1"), (3.6 * samples.speed_mps, "speed, km/h"))


def beside(samples: Samples, walls: Sequence[WallRow]) -> Figure:
    """Draw the distances to the left and the right wall."""
    figure = charts.new_figure(2.6)
    axes = figure.add_subplot()
    table = np.array([row[:3] for row in walls], dtype=float)
    for column, name, colour in ((1, "left wall", charts.FINAL), (2, "right wall", charts.WHEELS)):
        axes.plot(*charts.envelope(table[:, 0], table[:, column]), color=colour, linewidth=1.0, label=name)
    axes.axhline(0.1, color=charts.INK, linewidth=0.8, linestyle="--", alpha=0.6, label="0.10 m, the paper's floor")
    top = min(3.0, 1.1 * float(np.nanmax(table[:, 1:]))) if np.isfinite(table[:, 1:]).any() else 3.0
    axes.set(xlabel="time, s", ylabel="distance, m", xlim=_span(samples), ylim=(0.0, top))
    charts.legend_above(axes)
    return figure


def _pair(samples: Samples, command: tuple[FloatArray, str], state: tuple[FloatArray, str]) -> Figure:
    """Draw a command above the state that it moves, on one time."""
    figure = charts.new_figure(3.6)
    figure.subplots_adjust(hspace=0.3)
    panels = figure.subplots(2, 1, sharex=True)
    for axes, (values, label), colour in zip(panels, (command, state), (charts.ODOMETRY, charts.FINAL), strict=True):
        axes.plot(*charts.envelope(samples.time_s, values), color=colour, linewidth=1.0, label=label)
        axes.axhline(0.0, color=charts.INK, linewidth=0.6, alpha=0.5)
        axes.set_ylabel(label.split(" ")[-2].rstrip(",") + ", " + label.split(" ")[-1])
        axes.yaxis.set_label_coords(-0.065, 0.5)
        charts.legend_above(axes)
    panels[1].set(xlabel="time, s", xlim=_span(samples))
    return figure


def _span(samples: Samples) -> tuple[float, float]:
    return 0.0, max(float(samples.time_s[-1]) if len(samples.time_s) else 0.0, 1.0)

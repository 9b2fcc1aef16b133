"""Charts of production: cycles by phase, fill of the bucket, the time-usage stack, phases over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lhdmap.haulage.records import Cycle, Phase
from lhdmap.production.figures import FILL_STEP, Production
from lhdmap.production.usage import LEVELS, Usage
from lhdmap.report import charts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PHASE_COLOURS = {
    Phase.TRAM: "#b7d3ea", Phase.LOAD: charts.ODOMETRY, Phase.HAUL: charts.FINAL, Phase.DUMP: charts.TRUTH,
    Phase.RETURN: "#8fb8d8", Phase.PARK: "#cfd6dc", Phase.REFUEL: "#f0c419", Phase.ASSISTANCE: charts.FLAGGED,
    Phase.QUEUE_LOAD: "#c98a5b", Phase.QUEUE_DUMP: "#b56b35", Phase.TRAFFIC: charts.WHEELS, Phase.OBSTACLE: "#9c4a12",
    Phase.STOPPED: "#7a1f1f", Phase.PLACE: "#a05195", Phase.NO_ROUTE: "#665191", Phase.ROUTE: "#9aa5af",
    Phase.IDLE: "#e3e6e9", Phase.ABORTED: "#4a4a4a",
}  # fmt: skip
_USAGES = {
    Usage.UNSCHEDULED: "#e3e6e9", Usage.DOWN: "#7a1f1f", Usage.STANDBY: "#9aa5af", Usage.DELAY: charts.WHEELS,
    Usage.NON_PRODUCTIVE: charts.ODOMETRY, Usage.PRODUCTIVE: charts.FINAL,
}  # fmt: skip
_MOST_CYCLES = 120
_LEGEND_COLUMNS = 6


def cycle_chart(production: Production) -> Figure:
    """Draw each cycle as a bar of its phases."""
    cycles = production.cycles[:_MOST_CYCLES]
    phases = [phase for phase in Phase if any(one.seconds(phase) > 0.0 for one in cycles)]
    rows = -(-len(phases) // _LEGEND_COLUMNS)
    figure = charts.new_figure(3.1 + 0.19 * rows)
    axes = figure.add_subplot()
    at, below = np.arange(1, len(cycles) + 1), np.zeros(len(cycles))
    for phase in phases:
        seconds = np.array([one.seconds(phase) for one in cycles])
        axes.bar(at, seconds, bottom=below, width=0.8, color=PHASE_COLOURS[phase], label=str(phase))
        below += seconds
    axes.set(xlabel="bucket", ylabel="time, s")
    figure.subplots_adjust(top=1.0 - (0.14 + 0.19 * rows) / figure.get_figheight())
    charts.legend_above(axes, columns=_LEGEND_COLUMNS)
    return figure


def fill_chart(production: Production) -> Figure:
    """Draw how many buckets were how full."""
    figure = charts.new_figure(2.3)
    axes = figure.add_subplot()
    rows = production.fill_histogram()
    axes.bar(
        [low + 0.5 * FILL_STEP for low, _, _ in rows], [count for *_, count in rows], width=0.09, color=charts.FINAL
    )
    axes.axvline(float(np.mean(production.fills)), color=charts.WHEELS, label="mean")
    axes.set(xlabel="fill, share of the payload that is wanted", ylabel="buckets", xlim=(0.0, rows[-1][1]))
    charts.legend_above(axes)
    return figure


def usage_chart(production: Production) -> Figure:
    """Draw the levels of the time-usage stack, each with what it loses to the one below."""
    figure = charts.new_figure(2.6)
    figure.subplots_adjust(left=1.0 / charts.WIDTH_IN)
    axes = figure.add_subplot()
    stack, classes = production.stack, list(Usage)
    for row, level in enumerate(LEVELS):
        hours = stack.level_s(level) / 3600.0
        axes.barh(row, hours, color=charts.FINAL, alpha=0.85, height=0.7)
        axes.text(0.0, row, f" {hours:.2f} h", va="center", ha="left", fontsize=8)
        if row:
            lost = classes[row - 1]
            label = str(lost) if stack.by_class_ns[lost] else None
            axes.barh(row, stack.class_s(lost) / 3600.0, left=hours, color=_USAGES[lost], height=0.25, label=label)
    axes.set_yticks(range(len(LEVELS)), LEVELS)
    axes.set(xlabel="time, h", ylim=(len(LEVELS) - 0.5, -0.5))
    axes.set_xlim(0.0, 1.12 * max(stack.level_s("calendar") / 3600.0, 1e-6))
    charts.legend_above(axes, columns=5)
    return figure


def timeline_chart(cycles: Sequence[Cycle]) -> Figure:
    """Draw the phases of each machine over time."""
    names = list(dict.fromkeys(one.machine for one in cycles))
    start_ns = min(one.from_ns for one in cycles)
    figure = charts.new_figure(0.8 + 0.5 * len(names))
    figure.subplots_adjust(left=1.0 / charts.WIDTH_IN)
    axes = figure.add_subplot()
    for row, name in enumerate(names):
        parts = [part for one in cycles if one.machine == name for part in one.intervals]
        for phase in Phase:
            spans = [(1e-9 * (part.from_ns - start_ns) / 60.0, part.s / 60.0) for part in parts if part.phase == phase]
            if spans:
                axes.broken_barh(spans, (row - 0.35, 0.7), facecolors=PHASE_COLOURS[phase])
    axes.set_yticks(range(len(names)), names)
    axes.set(xlabel="time, min", ylim=(len(names) - 0.5, -0.5))
    axes.grid(visible=False)
    return figure

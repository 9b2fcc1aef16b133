"""Charts of a drive on a map: the map, legs and what guidance predicted; the place by localization against the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.report import charts
from lhdmap.report import topology_drawing as drawing
from lhdmap.report.replay_data import DriveData
from lhdmap.report.topology_levels import middle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORWARD, REVERSE, HORIZON = "#7fcdb0", "#f3cf7f", "#cc79a7"
_AROUND_M = 15.0
_GEARS = (("forward", FORWARD), ("reverse", REVERSE))


def draw_drive(axes: Axes, drive: DriveData) -> None:
    """Draw the map that is driven on, the legs of the route in their gears, and the predicted ways."""
    if drive.topology is not None:
        drawing.draw_intersections(axes, drive.topology.intersections)
        tunnels = [one.line_m for one in drive.topology.tunnels]
        drawing.draw_lines(axes, tunnels, drawing.GREY, ":", "tunnel of the map", linewidth=1.0, zorder=1.6)
        drawing.draw_marks(
            axes, [one.pose for one in drive.topology.waypoints], "d", drawing.GREY, "waypoint", markersize=4
        )
    for gear, colour in _GEARS:
        lines = [leg.line_m for leg in drive.legs if leg.gear == gear]
        drawing.draw_lines(axes, lines, colour, "-", f"leg, {gear}", linewidth=4.0, zorder=1.8)
    drawing.draw_lines(axes, drive.bodies, charts.INK, "-", "both bodies", linewidth=0.7, alpha=0.8, zorder=2.5)
    ways = [line for line in drive.horizons if len(line)]
    drawing.draw_lines(axes, ways, HORIZON, "-", "predicted way", linewidth=0.6, alpha=0.7, zorder=2.6)


def extent_m(drive: DriveData, way_m: FloatArray) -> FloatArray:
    """Return the corners (2, 2) of what is looked at: the way (N, 3) and the legs, with room around them."""
    points = np.concatenate([way_m[:, :2], *(leg.line_m[:, :2] for leg in drive.legs)])
    return np.array([points.min(axis=0) - _AROUND_M, points.max(axis=0) + _AROUND_M])


def name_places(axes: Axes, drive: DriveData, way_m: FloatArray) -> None:
    """Write the names of waypoints, intersections and tunnels where they cover neither the map nor the path (N, 3)."""
    topology = drive.topology
    if topology is None:
        return
    said = {(one.node, one.name) for one in topology.waypoints}
    names = [(one.name, one.pose, 4.0) for one in topology.waypoints]
    names += [(one.name, one.pose_map_node, 1.0) for one in topology.intersections]
    names += [(one.name, middle(one.line_m), 1.5) for one in topology.tunnels if (one.id, one.name) not in said]
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    near = [one for one in names if (one[1][:2] > low).all() and (one[1][:2] < high).all()]
    drawing.draw_labels(axes, near, [way_m, *(one.line_m for one in topology.tunnels)])


def place_chart(drive: DriveData, end_s: float) -> Figure:
    """Draw by how much the place on the map is off, along, across and in heading, with three of the deviations it tells."""
    figure = charts.new_figure(3.6)
    figure.subplots_adjust(hspace=0.32)
    panels = figure.subplots(2, 1, sharex=True)
    time_s, told_cm = drive.place("time_s"), 300.0 * drive.place("deviation_m")
    shown = charts.thinned(len(time_s))
    panels[0].fill_between(
        time_s[shown],
        -told_cm[shown],
        told_cm[shown],
        color=drawing.GREY,
        alpha=0.2,
        linewidth=0,
        label="3 deviations, told",
    )
    for name, colour in (("along", charts.FINAL), ("across", charts.ODOMETRY)):
        panels[0].plot(*charts.envelope(time_s, 100.0 * drive.place(f"{name}_m")), color=colour, label=name)
    most_cm = 100.0 * max(float(np.abs(drive.places[:, 1:3]).max()), 0.02)
    panels[0].set(ylabel="place, cm", ylim=(-1.3 * most_cm, 1.3 * most_cm))
    heading_deg = np.degrees(drive.place("heading_rad"))
    panels[1].plot(*charts.envelope(time_s, heading_deg), color=charts.TRUTH, label="heading, left +")
    panels[1].set(ylabel="heading, °", xlabel="time, s", xlim=(0.0, max(end_s, 1.0)))
    for axes in panels:
        axes.yaxis.set_label_coords(-0.065, 0.5)
        charts.legend_above(axes)
    return figure


def limit_shares(drive: DriveData) -> list[tuple[str, float]]:
    """Return what limited the speed, and in which share of the plans, the largest first."""
    if not len(drive.plans):
        return []
    counts = np.bincount(drive.plan("limit").astype(int), minlength=len(drive.limits))
    shares = zip(drive.limits, (counts / counts.sum()).tolist(), strict=True)
    return sorted(shares, key=lambda one: -one[1])

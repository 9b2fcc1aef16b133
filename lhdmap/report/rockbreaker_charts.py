"""Charts of a rockbreaker trajectory: tip and way (Fig. 7), cylinders and flows (Fig. 8), orientation (Fig. 4), speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.report import charts
from lhdmap.rockbreaker.collision import joint_positions
from lhdmap.rockbreaker.corridor import Corridor, corridor
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.rockbreaker.orientation import holds_vertical
from lhdmap.rockbreaker.plan import Trajectory
from lhdmap.rockbreaker.reach import workspace_slice
from lhdmap.rockbreaker.rocks import Scene
from lhdmap.rockbreaker.table import COLUMNS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = (charts.FINAL, charts.ODOMETRY, charts.TRUTH, charts.WHEELS, charts.FLAGGED)
_FLOWS = ("Q1 swing", "Q2 inner boom", "Q3 outer boom", "Q4 breaker", "pump")
_POSES = 12  # poses of the arm that are drawn


def _column(rows: FloatArray, name: str) -> FloatArray:
    return np.asarray(rows[:, COLUMNS.index(name)])


def _curves(rows: FloatArray, names: Sequence[str], labels: Sequence[str], ylabel: str) -> Figure:
    """Draw columns over time."""
    figure = charts.new_figure(2.9)
    axes = figure.add_subplot()
    kept = charts.thinned(len(rows))
    for name, label, colour in zip(names, labels, COLOURS, strict=False):
        axes.plot(_column(rows, "t_s")[kept], _column(rows, name)[kept], color=colour, label=label)
    axes.set(xlabel="time, s", ylabel=ylabel, xlim=(0.0, float(rows[-1, 0])))
    charts.legend_above(axes, columns=5)
    return figure


def tip_chart(rows: FloatArray) -> Figure:
    """Draw x, y and z of the tip over time: Fig. 7 (a), (b)."""
    return _curves(rows, ("x_m", "y_m", "z_m"), ("x", "y", "z"), "tip, m")


def cylinder_chart(rows: FloatArray) -> Figure:
    """Draw the lengths of the cylinders over time: Fig. 8 (a), (b)."""
    names = [f"rho{j}_m" for j in range(5)]
    return _curves(rows, names, [f"ρ{j}" for j in range(5)], "cylinder, m")


def flow_chart(rows: FloatArray) -> Figure:
    """Draw the flows over their limits over time: Fig. 8 (c), (d)."""
    figure = _curves(rows, ("q1", "q2", "q3", "q4", "qp"), _FLOWS, "flow over its limit")
    figure.axes[0].axhline(1.0, color=charts.INK, linewidth=0.8, linestyle="--")
    figure.axes[0].set_ylim(0.0, 1.08)
    return figure


def plan_chart(trajectories: Sequence[Trajectory], machine: Rockbreaker, scene: Scene | None = None) -> Figure:
    """Draw the way of the tip from above over the grizzly: Fig. 7 (c); with the rocks that were seen."""
    from matplotlib.patches import Rectangle

    low, high = np.array(machine.grizzly.min_m), np.array(machine.grizzly.max_m)
    figure = charts.new_figure(5.2)
    axes = figure.add_subplot()
    size = high - low
    axes.add_patch(Rectangle((low[0], low[1]), *size, fill=False, edgecolor="#8a949e", linewidth=1.2, label="grizzly"))
    for rock in scene.rocks if scene is not None else ():
        large = rock.passing_m > machine.grizzly.opening_m
        _circle(axes, rock.top_m, 0.5 * rock.length_m, charts.WHEELS if large else "#8a949e")
    for number, one in enumerate(trajectories):
        way = one.way_m()
        axes.plot(
            way[:, 0],
            way[:, 1],
            color=COLOURS[number],
            linewidth=2.0,
            label=f"step {number + 1}, {one.path.kind.upper()}",
        )
        axes.plot(*way[0, :2], "o", color=COLOURS[number], markersize=5)
        axes.plot(*way[-1, :2], "s", color=COLOURS[number], markersize=6)
    axes.plot(0.0, 0.0, "^", color=charts.INK, markersize=8, label="swing axis")
    axes.set(
        aspect="equal", xlabel="x, m", ylabel="y, m", xlim=(-0.5, high[0] + 1.5), ylim=(low[1] - 0.8, high[1] + 0.8)
    )
    charts.legend_above(axes, columns=5)
    return figure


def _circle(axes: Axes, at_m: FloatArray, radius_m: float, colour: str) -> None:
    from matplotlib.patches import Circle

    axes.add_patch(Circle((at_m[0], at_m[1]), radius_m, facecolor=colour, alpha=0.35, linewidth=0))


def side_chart(trajectories: Sequence[Trajectory], machine: Rockbreaker) -> Figure:
    """Draw the arm from the side, in the plane of its booms, from start (pale) to end (full)."""
    figure = charts.new_figure(4.4)
    axes = figure.add_subplot()
    theta = np.concatenate([one.path.theta(np.linspace(0.0, 1.0, _POSES)) for one in trajectories])
    flat = theta * np.array([0.0, 1.0, 1.0, 1.0])
    for k, joints in enumerate(joint_positions(machine, flat)):
        share = (k + 1) / len(theta)
        x, z = np.concatenate([[[0.0, 0.0], [0.0, machine.base.height_m]], joints[:, [0, 2]]]).T
        axes.plot(x, z, color=charts.FINAL, alpha=0.12 + 0.88 * share**3, linewidth=1.0 + 2.0 * share)
    axes.set(aspect="equal", xlabel="radius, m", ylabel="z, m")
    return figure


def speed_chart(trajectory: Trajectory) -> Figure:
    """Draw σ̇ along the path under the curve that the hydraulics allow."""
    figure = charts.new_figure(2.9)
    axes = figure.add_subplot()
    curve, law = trajectory.curve, trajectory.law
    sigma, rate = law(np.linspace(0.0, law.duration_s, 1500))
    top = 1.3 * float(np.percentile(curve.highest, 90))
    axes.plot(curve.sigma, curve.highest, color=charts.WHEELS, label="highest that valves, pump and swing allow")
    axes.plot(sigma, rate, color=charts.FINAL, label=f"{trajectory.timing}, {law.duration_s:.2f} s")
    axes.set(
        xlabel="σ along the path",
        ylabel="σ̇, 1/s",
        xlim=(0.0, 1.0),
        ylim=(0.0, top),
    )
    charts.legend_above(axes)
    return figure


def orientation_chart(trajectory: Trajectory) -> Figure:
    """Draw φ along the path within the region that the joints allow: Fig. 4 (d)."""
    figure = charts.new_figure(2.9)
    axes = figure.add_subplot()
    sigma = np.linspace(0.0, 1.0, 401)
    phi = trajectory.path.turning.phi
    region = corridor(trajectory.path, float(phi[0]), float(phi[-1]), sigma)
    if isinstance(region, Corridor):
        axes.fill_between(
            sigma,
            np.degrees(region.low),
            np.degrees(region.high),
            color=charts.TRUTH,
            alpha=0.2,
            linewidth=0,
            label="feasible",
        )
    axes.plot(sigma, np.degrees(trajectory.path.turning(sigma)[0]), color=charts.FINAL, label="φ of the breaker")
    axes.axhline(270.0, color=charts.INK, linewidth=0.8, linestyle="--", label="vertical")
    axes.set(xlabel="σ along the path", ylabel="φ, deg", xlim=(0.0, 1.0))
    charts.legend_above(axes)
    return figure


def workspace_chart(machine: Rockbreaker, at_m: FloatArray | None = None) -> Figure:
    """Draw the slice of Fig. 3: where the tip can be at θ1 = 0, and where with a vertical breaker."""
    x, z, low, high = workspace_slice(machine)
    vertical = holds_vertical(low, high)
    figure = charts.new_figure(5.6)
    axes = figure.add_subplot()
    for cells, colour, label in (
        (~np.isnan(low), "#8a949e", "reached"),
        (vertical, charts.FINAL, "with a vertical breaker"),
    ):
        axes.contourf(x, z, cells.T.astype(float), levels=[0.5, 1.5], colors=[colour], alpha=0.55)
        axes.plot([], [], "s", color=colour, alpha=0.55, label=label)
    axes.plot(
        [0.0, 0.0, machine.links_m[0]],
        [z[0], machine.base.height_m, machine.base.height_m],
        color=charts.INK,
        linewidth=3.0,
    )
    if at_m is not None:
        axes.plot(np.hypot(at_m[0], at_m[1]), at_m[2], "o", color=charts.WHEELS, label="the tip asked for")
    axes.set(aspect="equal", xlabel="x at θ1 = 0, m", ylabel="z, m")
    charts.legend_above(axes)
    return figure

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
from lhdmap.rockbreaker.rocks import Rock, Scene
from lhdmap.rockbreaker.table import COLUMNS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = (charts.FINAL, charts.ODOMETRY, charts.TRUTH, charts.WHEELS, charts.FLAGGED)
_FLOWS = ("Q1 swing", "Q2 inner boom", "Q3 outer boom", "Q4 breaker", "pump")
_POSES = 12  # poses of the arm that are drawn for each step
_UPRIGHT_M = 0.02
_AT_TARGET_M = 0.05
TARGET = "target"


def _column(rows: FloatArray, name: str) -> FloatArray:
    return np.asarray(rows[:, COLUMNS.index(name)])


def _curves(
    rows: FloatArray, names: Sequence[str], labels: Sequence[str], ylabel: str, trajectories: Sequence[Trajectory]
) -> Figure:
    """Draw columns over time, with the steps named where there are several."""
    figure = charts.new_figure(2.9)
    axes = figure.add_subplot()
    kept = charts.thinned(len(rows))
    for name, label, colour in zip(names, labels, COLOURS, strict=False):
        axes.plot(_column(rows, "t_s")[kept], _column(rows, name)[kept], color=colour, label=label)
    axes.set(xlabel="time, s", ylabel=ylabel, xlim=(0.0, float(rows[-1, 0])))
    _steps_over_time(axes, trajectories)
    charts.legend_above(axes, columns=5)
    return figure


def _steps_over_time(axes: Axes, trajectories: Sequence[Trajectory]) -> None:
    """Draw where a step ends and the next one begins, and their names."""
    if len(trajectories) < 2:
        return
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.12 * (high - low))
    begun_s = 0.0
    for number, one in enumerate(trajectories):
        middle_s = begun_s + 0.5 * one.law.duration_s
        name = axes.text(middle_s, 0.985, step_name(number), ha="center", va="top", fontsize=8.5, alpha=0.85)
        name.set_transform(axes.get_xaxis_transform())
        begun_s += one.law.duration_s
        if number + 1 < len(trajectories):
            axes.axvline(begun_s, color=charts.INK, linewidth=0.9, linestyle=":")


def step_name(number: int) -> str:
    """Return what a step of a plan is called, counted from 0."""
    return f"step {number + 1}"


def tip_chart(rows: FloatArray, trajectories: Sequence[Trajectory]) -> Figure:
    """Draw x, y and z of the tip over time: Fig. 7 (a), (b)."""
    return _curves(rows, ("x_m", "y_m", "z_m"), ("x", "y", "z"), "tip, m", trajectories)


def cylinder_chart(rows: FloatArray, trajectories: Sequence[Trajectory]) -> Figure:
    """Draw the lengths of the cylinders over time: Fig. 8 (a), (b)."""
    names = [f"rho{j}_m" for j in range(5)]
    return _curves(rows, names, [f"ρ{j}" for j in range(5)], "cylinder, m", trajectories)


def flow_chart(rows: FloatArray, trajectories: Sequence[Trajectory]) -> Figure:
    """Draw the flows over their limits over time: Fig. 8 (c), (d)."""
    figure = _curves(rows, ("q1", "q2", "q3", "q4", "qp"), _FLOWS, "flow over its limit", trajectories)
    figure.axes[0].axhline(1.0, color=charts.INK, linewidth=0.8, linestyle="--")
    figure.axes[0].set_ylim(0.0, 1.16)
    return figure


def plan_chart(trajectories: Sequence[Trajectory], machine: Rockbreaker, scene: Scene | None = None) -> Figure:
    """Draw the way of the tip from above over the grizzly: Fig. 7 (c); with the rocks that were seen."""
    from matplotlib.patches import Circle, Rectangle

    low, high = np.array(machine.grizzly.min_m), np.array(machine.grizzly.max_m)
    figure = charts.new_figure(5.2)
    axes = figure.add_subplot()
    size = high - low
    axes.add_patch(Rectangle((low[0], low[1]), *size, fill=False, edgecolor="#8a949e", linewidth=1.2, label="grizzly"))
    for colour, label, rocks in _kinds(scene, machine, trajectories):
        for rock in rocks:
            place = (float(rock.top_m[0]), float(rock.top_m[1]))
            axes.add_patch(Circle(place, 0.5 * rock.length_m, facecolor=colour, alpha=0.4, linewidth=0, label=label))
            if label == TARGET:
                outline = Circle(place, 0.5 * rock.length_m, fill=False, edgecolor=colour, linewidth=2.0)
                axes.add_patch(outline)
                above = place[1] + 0.5 * rock.length_m + 0.08
                axes.text(place[0], above, f"target, {rock.size_m:.2f} m", ha="center", va="bottom", fontsize=9.0)
            label = None
    for number, one in enumerate(trajectories):
        way = one.way_m()
        axes.plot(
            way[:, 0],
            way[:, 1],
            color=COLOURS[number],
            linewidth=2.0,
            label=f"{step_name(number)}, {one.path.kind.upper()}",
        )
        axes.plot(*way[0, :2], "o", color=COLOURS[number], markersize=9 - 4 * (number > 0))
        axes.plot(*way[-1, :2], "s", color=COLOURS[number], markersize=6)
        middle, shift = tuple(way[len(way) // 2, :2].tolist()), (14.0, -4.0 - 12.0 * (number == 0))
        words = step_name(number) + _upright(way)
        axes.annotate(words, middle, shift, textcoords="offset points", color=COLOURS[number], fontsize=9.0)
    axes.plot(0.0, 0.0, "^", color=charts.INK, markersize=8, label="swing axis")
    axes.set(
        aspect="equal", xlabel="x, m", ylabel="y, m", xlim=(-0.5, high[0] + 1.5), ylim=(low[1] - 0.8, high[1] + 0.8)
    )
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
    return figure


def _upright(way_m: FloatArray) -> str:
    """Return in words that a way (N, 3) is upright: from above it is a point."""
    if np.ptp(way_m[:, :2], axis=0).max() > _UPRIGHT_M:
        return ""
    return ", straight down" if way_m[-1, 2] < way_m[0, 2] else ", straight up"


def _kinds(
    scene: Scene | None, machine: Rockbreaker, trajectories: Sequence[Trajectory]
) -> list[tuple[str, str | None, list[Rock]]]:
    """Return colour, name and rocks of each kind: what falls through, what does not, and the one that the plan goes to."""
    kinds: dict[str, list[Rock]] = {"falls through": [], "too large": [], TARGET: []}
    end_m = trajectories[-1].way_m()[-1] if trajectories else np.full(3, np.inf)
    for rock in () if scene is None else scene.rocks:
        if rock.passing_m <= machine.grizzly.opening_m:
            kinds["falls through"].append(rock)
        else:
            kinds[TARGET if np.hypot(*(rock.top_m - end_m)[:2]) < _AT_TARGET_M else "too large"].append(rock)
    colours = ("#8a949e", charts.ODOMETRY, charts.WHEELS)
    return [(colour, name, rocks) for colour, (name, rocks) in zip(colours, kinds.items(), strict=True)]


def side_chart(trajectories: Sequence[Trajectory], machine: Rockbreaker, scene: Scene | None = None) -> Figure:
    """Draw the arm from the side, in the plane of its booms, each step from its start (pale) to its end (full).

    Bars and rocks lie at their own distance from the swing axis.
    """
    figure = charts.new_figure(5.0)
    axes = figure.add_subplot()
    _grizzly_from_the_side(axes, machine, trajectories, scene)
    for number, one in enumerate(trajectories):
        theta = one.path.theta(np.linspace(0.0, 1.0, _POSES)) * np.array([0.0, 1.0, 1.0, 1.0])
        for k, joints in enumerate(joint_positions(machine, theta)):
            share = (k + 1) / len(theta)
            x, z = np.concatenate([[[0.0, 0.0], [0.0, machine.base.height_m]], joints[:, [0, 2]]]).T
            label = step_name(number) if k + 1 == len(theta) else None
            width, alpha = 1.0 + 2.0 * share * (number + 1 == len(trajectories)), 0.12 + 0.88 * share**3
            axes.plot(x, z, color=COLOURS[number], label=label, alpha=alpha, linewidth=width)
    axes.set(aspect="equal", xlabel="distance from the swing axis, m", ylabel="z, m")
    charts.legend_above(axes, columns=5)
    return figure


def _grizzly_from_the_side(
    axes: Axes, machine: Rockbreaker, trajectories: Sequence[Trajectory], scene: Scene | None
) -> None:
    """Draw the bars as a line where they were seen, and the rocks on it."""
    from matplotlib.patches import Ellipse

    if scene is None:
        return
    low, high = np.array(machine.grizzly.min_m), np.array(machine.grizzly.max_m)
    x = np.linspace(low[0], high[0], max(round((high[0] - low[0]) / machine.grizzly.opening_m), 1) + 1)
    bars = np.array([scene.height_m(float(one), 0.0) for one in x])
    axes.plot(x, bars, "|-", color="#8a949e", linewidth=2.0, markersize=9.0, label="bars of the grizzly")
    for colour, label, rocks in _kinds(scene, machine, trajectories):
        for rock in rocks:
            middle = (float(np.hypot(*rock.top_m[:2])), float(rock.top_m[2]) - 0.5 * rock.height_m)
            axes.add_patch(Ellipse(middle, rock.length_m, rock.height_m, facecolor=colour, alpha=0.5, label=label))
            label = None


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

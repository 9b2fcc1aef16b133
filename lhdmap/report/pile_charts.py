"""Charts of the ore pile: from above, cut along the drift, the face as a relief, and how the estimate converged."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.geometry.frame import UprightFrame
from lhdmap.messages import FloatArray
from lhdmap.pile.result import STATUSES, PileEstimate, PileReport, Snapshot
from lhdmap.report import charts

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FLOOR, WALL, FACE, REST, ROCK = "#b08d57", "#8a949e", charts.FINAL, "#8cc4ee", charts.WHEELS
STATUS_COLOURS = dict(
    zip(STATUSES, (charts.TRUTH, charts.ODOMETRY, charts.FINAL, charts.FLAGGED, "#8a949e"), strict=True)
)
_BEFORE_M, _BEYOND_M = 7.0, 3.5
_FLOOR_M = 0.2  # what lies lower over the toe is drawn as floor
_NEAR_WALL_M = 0.25
_NEAR_FACE_M = 0.28
_PROUD_M = 0.5  # end of the colours
_CELL_M = 0.1
_ELSEWHERE_M = 5.0


class Ahead(NamedTuple):
    """The pile's own frame, origin in the middle of the toe, x into the pile, y to the left, z up; half the pile's width (m)."""

    frame: UprightFrame
    half_m: float

    @classmethod
    def of(cls, pile: PileEstimate) -> Ahead:
        """Return the frame of an estimate that was found."""
        across = pile.left_limit_m - pile.right_limit_m
        heading = math.atan2(-float(across[0]), float(across[1]))
        frame = UprightFrame(0.5 * (pile.left_limit_m + pile.right_limit_m), heading)
        if len(pile.toe_m):
            x, _, z = np.median(frame.local(pile.toe_m), axis=0)  # the limits of Fig. 9 are not at the toe
            frame = UprightFrame(frame.map(np.array([x, 0.0, z])), heading)
        return cls(frame, 0.5 * float(np.hypot(*across[:2])))

    @property
    def heading_rad(self) -> float:
        """Heading of the x axis in the map, rad."""
        return self.frame.heading_rad

    def local(self, points_m: FloatArray) -> FloatArray:
        """Return points (N, 3) of the map in this frame."""
        return self.frame.local(np.atleast_2d(points_m))


def above_chart(report: PileReport, pile: PileEstimate) -> Figure:
    """Draw the hits around the face from above by what they are taken for, toe, limits, boulders and the attack point."""
    frame = Ahead.of(pile)
    side = frame.half_m + 1.0
    figure = charts.new_figure(min(0.9 * charts.WIDTH_IN * 2.0 * side / (_BEFORE_M + _BEYOND_M) + 1.1, 7.5))
    axes = figure.add_subplot()
    _segments(axes, frame, pile, report.around_m)
    face, toe = frame.local(pile.face_m), frame.local(pile.toe_m)
    _dots(axes, face[:, 0], face[:, 1], FACE, "face, fitted")
    axes.plot(toe[:, 0], toe[:, 1], color=charts.FLAGGED, linewidth=2.2, label="toe")
    _limits(axes, frame, pile)
    _boulders(axes, frame, pile, (0, 1))
    _attack(axes, frame, pile)
    axes.set(xlim=(-_BEFORE_M, _BEYOND_M), ylim=(-side, side), aspect="equal")
    axes.set(xlabel="from the middle of the toe into the pile, m", ylabel="to the left, m")
    charts.legend_above(axes, columns=5)
    return figure


def cut_chart(report: PileReport, pile: PileEstimate) -> Figure:
    """Draw face, floor and fitted line from the side, with the band of twice the inclination's deviation."""
    frame = Ahead.of(pile)
    figure = charts.new_figure(3.6)
    axes = figure.add_subplot()
    middle = report.around_m[np.abs(frame.local(report.around_m)[:, 1]) < frame.half_m - 0.5]
    before = frame.local(middle)
    _dots(axes, before[:, 0], before[:, 2], WALL, "between the walls")
    face, slope = frame.local(pile.face_m), _slope(pile.inclination_deg)
    x = face[:, 0] - _toe_at(frame.local(pile.toe_m), face[:, 1])
    _dots(axes, x, face[:, 2], FACE, "face, at its own place of the toe")
    heights = np.linspace(0.0, max(2.0, float(face[:, 2].max(initial=0.0))), 40)
    hinge = float(np.median(face[:, 2])) if len(face) else 0.8
    x_fit, std_deg = slope * heights, float(np.nan_to_num(pile.inclination_std_deg))
    ends = [slope * hinge + _slope(pile.inclination_deg + k * std_deg) * (heights - hinge) for k in (-2.0, 2.0)]
    axes.fill_betweenx(
        heights, ends[0], ends[1], color=charts.ODOMETRY, alpha=0.35, linewidth=0, label="± 2 deviations"
    )
    label = f"fit, {pile.inclination_deg:.1f}°"
    axes.plot(x_fit, heights, color=charts.ODOMETRY, linewidth=1.8, label=label)
    axes.set(xlim=(-4.0, max(3.0, float(x_fit.max()) + 0.5)), ylim=(-0.5, float(heights[-1]) + 0.4), aspect="equal")
    axes.set(xlabel="from the toe into the pile, m", ylabel="over the toe, m")
    charts.legend_above(axes)
    return figure


def relief_chart(report: PileReport, pile: PileEstimate) -> Figure:
    """Draw the face as the machine sees it, coloured by how far the rock stands out of the fit."""
    frame = Ahead.of(pile)
    face = frame.local(np.concatenate([pile.face_m, report.around_m]))
    proud = _proud(frame, pile, face)
    near = (proud > -0.8) & (proud < 1.6) & (face[:, 2] > 0.05) & (face[:, 2] < 3.0)
    near &= (np.abs(face[:, 1]) < frame.half_m - 0.12) & ~((face[:, 2] < _FLOOR_M) & (proud > 0.5 * _FLOOR_M))
    face, proud = face[near], proud[near]
    top = max(float(face[:, 2].max(initial=1.6)), 1.0) + 0.15
    figure = charts.new_figure(min(0.8 * charts.WIDTH_IN * top / (2.0 * frame.half_m) + 0.9, 5.0), right_in=0.95)
    axes = figure.add_subplot()
    values, extent = _mean_cells(-face[:, 1], face[:, 2], proud)
    image = axes.imshow(
        values, extent=extent, origin="lower", cmap="RdBu_r", vmin=-_PROUD_M, vmax=_PROUD_M, interpolation="nearest"
    )
    _boulders(axes, frame, pile, (1, 2))
    edge = frame.half_m
    for x in (-edge, edge):
        axes.axvline(x, color=charts.INK, linewidth=1.0, linestyle="--")
    axes.set(xlim=(-edge - 0.2, edge + 0.2), ylim=(0.0, top), aspect="equal")
    axes.set(xlabel="left limit … right limit, m from the middle", ylabel="over the toe, m")
    axes.grid(visible=False)
    bar = figure.colorbar(image, cax=axes.inset_axes((1.015, 0.0, 0.018, 1.0)), label="stands out, m")
    bar.ax.grid(visible=False)
    charts.legend_above(axes)
    return figure


def convergence_chart(report: PileReport) -> Figure:
    """Draw width, inclination and the statuses' probabilities over the distance to the toe, bands of two deviations."""
    seen = _of_the_end([one for one in report.history if one.estimate.found and math.isfinite(one.distance_m)])
    figure = charts.new_figure(6.4)
    rows = figure.subplots(3, 1, sharex=True)
    x = np.array([one.distance_m for one in seen])
    width = np.array([(one.estimate.width_m, one.estimate.width_std_m) for one in seen])
    slope = np.array([(one.estimate.inclination_deg, one.estimate.inclination_std_deg) for one in seen])
    _band(rows[0], x, width, "width, m", least=0.4)
    _band(rows[1], x, slope, "inclination, °", least=4.0)
    for name in STATUSES:
        share = np.array([one.estimate.probabilities.get(name, 0.0) for one in seen])
        if share.max(initial=0.0) > 0.02:
            rows[2].plot(x, 100.0 * share, color=STATUS_COLOURS[name], label=name.replace("_", " "))
    rows[2].set(ylabel="probability, %", ylim=(-4.0, 104.0), xlabel="base_link to the toe, m")
    for axes in rows:
        _decision(axes, report.decision)
    charts.legend_above(rows[0])
    rows[2].legend(loc="center right", fontsize=8.0)
    rows[0].invert_xaxis()
    return figure


def _of_the_end(seen: list[Snapshot]) -> list[Snapshot]:
    """Return the estimates of what the last one is of: on the way something else may have been taken for the end."""
    last = seen[-1].estimate.center_m
    return [one for one in seen if not np.linalg.norm((one.estimate.center_m - last)[:2]) > _ELSEWHERE_M]


def _segments(axes: Axes, frame: Ahead, pile: PileEstimate, points_m: FloatArray) -> None:
    """Draw what was not fitted: walls, floor, face beyond the heights of the fit, and what is none of these."""
    local = frame.local(points_m)
    proud = _proud(frame, pile, local)
    inside = np.abs(local[:, 1]) < frame.half_m - _NEAR_WALL_M
    floor = inside & (local[:, 2] < _FLOOR_M) & (proud > 0.0)
    near = inside & ~floor & (np.abs(proud) < _NEAR_FACE_M)
    other = inside & ~floor & ~near
    for rows, colour, name in (
        (~inside, WALL, "walls"),
        (floor, FLOOR, "floor"),
        (near, REST, "face, not in the fit"),
        (other, ROCK, "off the face"),
    ):
        _dots(axes, local[rows, 0], local[rows, 1], colour, name, size=5.0 if rows.sum() < 500 else 1.6)


def _proud(frame: Ahead, pile: PileEstimate, local: FloatArray) -> FloatArray:
    """Return how far points (N, 3) of the pile's frame stand out of the fitted face, along its normal, shape (N,)."""
    slope = _slope(pile.inclination_deg)
    x_fit = _toe_at(frame.local(pile.toe_m), local[:, 1]) + slope * local[:, 2]
    return (x_fit - local[:, 0]) / math.hypot(1.0, slope)


def _dots(axes: Axes, x: FloatArray, y: FloatArray, colour: str, label: str, size: float = 1.6) -> None:
    """Draw points as pixels: thousands of marks would make the page heavy."""
    if len(x):
        rows = charts.thinned(len(x), 12_000)
        axes.scatter(x[rows], y[rows], s=size, color=colour, linewidths=0, rasterized=True)
        axes.plot([], [], "o", color=colour, markersize=4.0, label=label)


def _limits(axes: Axes, frame: Ahead, pile: PileEstimate) -> None:
    """Draw E_L and E_R; the width's deviation is shared by the two."""
    ends = frame.local(np.vstack([pile.left_limit_m, pile.right_limit_m]))
    axes.errorbar(
        *(ends[:, 0], ends[:, 1]),
        yerr=2.0 * float(np.nan_to_num(pile.width_std_m)) / math.sqrt(2.0),
        fmt="D",
        color=charts.INK,
        markersize=4.5,
        capsize=4.0,
        label="limits ± 2 deviations",
    )
    for (x, y, _), name, below in zip(ends, ("E_L", "E_R"), (False, True), strict=True):
        axes.annotate(name, (x, y), (9.0, -12.0 if below else 6.0), textcoords="offset points")


def _boulders(axes: Axes, frame: Ahead, pile: PileEstimate, columns: tuple[int, int]) -> None:
    """Draw boulders as circles of their size; seen from the machine, left is left."""
    from matplotlib.patches import Circle

    for number, rock in enumerate(pile.boulders):
        centre = frame.local(rock.center_m)[0]
        if columns == (1, 2):
            centre = centre * np.array([1.0, -1.0, 1.0])
        label = "boulder" if number == 0 else None
        place = (float(centre[columns[0]]), float(centre[columns[1]]))
        axes.add_patch(Circle(place, 0.5 * rock.size_m, fill=False, color=ROCK, linewidth=1.8, label=label))


def _attack(axes: Axes, frame: Ahead, pile: PileEstimate) -> None:
    """Draw where to drive into the pile, as an arrow that ends there."""
    if pile.attack is None:
        return
    x, y, _ = frame.local(pile.attack.point_m)[0]
    turn = pile.attack.heading_rad - frame.heading_rad
    start = (x - 2.5 * math.cos(turn), y - 2.5 * math.sin(turn))
    axes.annotate("", (x, y), start, arrowprops={"arrowstyle": "-|>", "color": charts.TRUTH, "linewidth": 2.2})
    axes.plot([], [], color=charts.TRUTH, linewidth=2.2, label="attack")


def _toe_at(toe: FloatArray, y: FloatArray) -> FloatArray:
    """Return x of the toe (K, 3) at y (N,); of one that is not known, zero: it runs from limit to limit."""
    if not len(toe):
        return np.zeros_like(y)
    order = np.argsort(toe[:, 1])
    return np.interp(y, toe[order, 1], toe[order, 0])


def _slope(inclination_deg: float) -> float:
    """Return dx/dz of a face, inclination with the sign of Table 6."""
    return 1.0 / math.tan(math.radians(min(max(-inclination_deg, 1.0), 179.0)))


def _mean_cells(
    x: FloatArray, y: FloatArray, values: FloatArray
) -> tuple[FloatArray, tuple[float, float, float, float]]:
    """Return the mean of values (N,) in cells, NaN where none is, and the extent x0, x1, y0, y1."""
    if not len(values):
        return np.full((1, 1), math.nan), (-1.0, 1.0, 0.0, 1.0)
    edges: list[npt.NDArray[np.float64]] = [
        np.arange(math.floor(float(a.min()) / _CELL_M), math.ceil(float(a.max()) / _CELL_M) + 1.5) * _CELL_M
        for a in (x, y)
    ]
    count = np.histogram2d(y, x, (edges[1], edges[0]))[0]
    total = np.histogram2d(y, x, (edges[1], edges[0]), weights=values)[0]
    mean = np.divide(total, count, out=np.full(count.shape, math.nan), where=count > 0)
    return mean, (float(edges[0][0]), float(edges[0][-1]), float(edges[1][0]), float(edges[1][-1]))


def _band(axes: Axes, x: FloatArray, values: FloatArray, name: str, least: float) -> None:
    """Draw values and deviations (N, 2) as a line in a band; the scale follows the nearer half."""
    middle, std = values[:, 0], np.nan_to_num(values[:, 1])  # a method may not know its deviation
    axes.fill_between(x, middle - 2.0 * std, middle + 2.0 * std, color=charts.FINAL, alpha=0.25, linewidth=0)
    axes.plot(x, middle, ".-", color=charts.FINAL, markersize=3.0)
    near = np.argsort(x)[: max(len(x) * 2 // 3, 1)]
    low, high = float((middle - 2.0 * std)[near].min()), float((middle + 2.0 * std)[near].max())
    pad = max(0.5 * (least - (high - low)), 0.08 * (high - low))
    axes.set(ylabel=name, ylim=(low - pad, high + pad))


def _decision(axes: Axes, decision: Snapshot | None) -> None:
    if decision is not None:
        axes.axvline(decision.distance_m, color=charts.WHEELS, linewidth=1.4, linestyle="--", label="decided")

"""Charts of the landmarks of a tunnel: the similarity matrix with its keys, and how distinctive the walls are along it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.messages import FloatArray
from lhdmap.report import charts

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HEIGHT_IN = 4.2
_SHOWN_GAP = 4.0  # times the least gap: where the scale ends


def similarity_chart(landmarks: Landmarks, tunnel: str) -> Figure:
    """Draw the similarity matrix of a tunnel as root mean square distances, with its keys; beside it each landmark's threshold."""
    figure = charts.new_figure(_HEIGHT_IN, right_in=0.3)
    matrix, margins = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
    figure.subplots_adjust(wspace=0.32)
    if tunnel in landmarks.similarity and len(landmarks.similarity[tunnel]):
        _matrix(figure, matrix, landmarks, tunnel)
        _margins(margins, landmarks, tunnel)
    return figure


def _matrix(figure: Figure, axes: Axes, landmarks: Landmarks, tunnel: str) -> None:
    rows, F = landmarks.of(tunnel), landmarks.similarity[tunnel]
    at_m = landmarks.at_m[rows]
    ends = _edges(at_m)
    image = axes.imshow(
        1e3 * np.sqrt(F), origin="lower", cmap="viridis", extent=(*ends, *ends), interpolation="nearest", aspect="auto"
    )
    bar = figure.colorbar(image, ax=axes, fraction=0.06, pad=0.03)
    bar.set_label("distance of a pair once matched, rms, mm")
    for number, k in enumerate(rows[landmarks.key[rows]]):
        reach = (landmarks.radius[k] + 0.5) * _spacing(at_m)
        low, high = landmarks.at_m[k] - reach, landmarks.at_m[k] + reach
        label = "key, and what is within its radius" if number == 0 else None
        axes.plot([landmarks.at_m[k]] * 2, [low, high], color=charts.WHEELS, linewidth=3.0, label=label)
    axes.grid(visible=False)
    axes.set(
        xlabel="landmark matched with, m along the tunnel", ylabel="landmark that is matched, m", xlim=ends, ylim=ends
    )
    charts.legend_above(axes)


def _margins(axes: Axes, landmarks: Landmarks, tunnel: str) -> None:
    """Draw what a match of each landmark may have, and what the most similar one has that is no neighbour."""
    rows = landmarks.of(tunnel)
    judged = rows[landmarks.radius[rows] > 0]
    at_m, threshold = landmarks.at_m[judged], landmarks.threshold[judged]
    keys = landmarks.key[judged]
    other = 1e3 * np.sqrt(threshold + landmarks.delta[judged])
    axes.plot(at_m, other, ".", color=charts.ODOMETRY, label="next other")
    axes.plot(at_m, 1e3 * np.sqrt(threshold), ".", color=charts.FINAL, label="threshold")
    axes.plot(at_m[keys], 1e3 * np.sqrt(threshold[keys]), "^", color=charts.WHEELS, label="of a key")
    axes.set(xlabel="along the tunnel, m", ylabel="rms, mm", ylim=(0.0, None))
    charts.legend_above(axes)


def distinctness_chart(landmarks: Landmarks, tunnel: str, settings: LandmarkSettings) -> Figure:
    """Draw along a tunnel: the walls about its mid line, and how much less likely the most similar other place is."""
    surface = landmarks.surfaces[tunnel]
    figure = charts.new_figure(4.4)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 1.2))
    if surface.profile is None or not len(surface.profile.at_m):
        return figure
    profile, at = surface.profile, surface.profile.at_m.astype(np.float64)
    for wall, label in ((profile.left_m, "walls about the mid line"), (-profile.right_m, None)):
        upper.plot(at, wall, color=charts.FINAL, linewidth=1.0, label=label)
    upper.set(ylabel="to the left, m")
    upper.axhline(0.0, color=charts.INK, linewidth=0.6, alpha=0.4)
    top = _SHOWN_GAP * settings.distinct_gap
    gap = np.where(np.isfinite(profile.gap), profile.gap, np.nan).astype(np.float64)
    lower.plot(at, np.clip(gap, -0.5 * settings.distinct_gap, top), color=charts.FINAL, label="gap, nats")
    lower.axhline(settings.distinct_gap, color=charts.ODOMETRY, linewidth=1.0, linestyle="--", label="least gap")
    _stretches(upper, lower, landmarks.not_distinctive_m(tunnel, settings))
    lower.set(
        xlabel="along the tunnel, m",
        ylabel=f"gap over {settings.distinct_m:g} m, nats",
        ylim=(-0.55 * settings.distinct_gap, 1.02 * top),
    )
    _keys(lower, landmarks, tunnel)
    charts.legend_above(upper)
    charts.legend_above(lower)
    figure.subplots_adjust(hspace=0.32)
    return figure


def _stretches(upper: Axes, lower: Axes, stretches: list[tuple[float, float]]) -> None:
    for number, (start, stop) in enumerate(stretches):
        for axes in (upper, lower):
            label = "not distinctive" if number == 0 and axes is lower else None
            axes.axvspan(start, stop, color=charts.FLAGGED, alpha=0.3, linewidth=0, label=label)


def _keys(axes: Axes, landmarks: Landmarks, tunnel: str) -> None:
    keys = [k for k in landmarks.of(tunnel) if landmarks.key[k]]
    low = axes.get_ylim()[0]
    axes.plot(landmarks.at_m[keys], np.full(len(keys), low), "^", color=charts.WHEELS, clip_on=False, label="keys")


def _spacing(at_m: FloatArray) -> float:
    return float(np.median(np.diff(at_m))) if len(at_m) > 1 else 1.0


def _edges(at_m: FloatArray) -> tuple[float, float]:
    """Return where the first cell of a matrix begins and the last one ends."""
    half = 0.5 * _spacing(at_m)
    return (float(at_m[0]) - half, float(at_m[-1]) + half) if len(at_m) else (0.0, 1.0)

"""Figures of `evaluation/tracking.md`: the site with what both axles are off, and ways to docks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from lhdmap.tracking.path import beside
from lhdmap.tracking.settings import TrackingSettings
from tests.tracking.paths import site
from tests.tracking.plant import Errors

from tools.evaluate.docking import APRONS
from tools.evaluate.tracking import followed, machine

mpl.use("Agg")
import matplotlib.pyplot as plt

Row = dict[str, Any]
_COLOURS = {"both": "#0b6e99", "circles": "#c0672b"}


def draw_site(target: Path) -> None:
    """The site in plan, z0 + z1 of both methods and the joint along the way, truck at 30 km/h."""
    rows = site()
    model, _ = machine("truck")
    figure, axes = plt.subplots(3, 1, figsize=(9.0, 7.5), height_ratios=[1.3, 1.0, 1.0], layout="constrained")
    axes[0].plot(rows[:, 1], -rows[:, 0], color="#999999", lw=5.0, alpha=0.4)
    for method, colour in _COLOURS.items():
        out, _ = followed(model, rows, 30.0, Errors(seed=1), TrackingSettings(method=method), rows[::10, :2])
        table, near, way = out.table(), 0.0, []
        for x, y in table[:, 1:3].tolist():
            near = beside(rows, x, y, near, 6.0, 6.0)[0]
            way.append(near)
        axes[1].plot(way, table[:, 7] + table[:, 8], color=colour, lw=1.2, label=method)
        axes[2].plot(way, np.degrees(table[:, 4]), color=colour, lw=1.2, label=method)
        if method == "both":
            axes[0].plot(table[:, 2], -table[:, 1], color=colour, lw=1.0)
            axes[2].plot(way, 3.6 * table[:, 6], color="#777777", lw=1.0, label="speed, km/h")
    axes[0].set(aspect="equal", xlabel="y, m", ylabel="-x, m", title="The paper's site, truck, 30 km/h, slip and noise")
    axes[1].set(ylabel="z0 + z1, m")
    axes[1].set_ylim(-0.4, 0.55)
    axes[2].set_ylim(-26.0, 42.0)
    axes[1].axhspan(-0.3, 0.3, color="#0b6e99", alpha=0.08)
    axes[2].set(ylabel="joint, deg", xlabel="way of the rear axle, m")
    for one in axes[1:]:
        one.legend(loc="upper left", ncols=3, frameon=False)
        one.grid(alpha=0.3)
    target.parent.mkdir(exist_ok=True)
    figure.savefig(target, dpi=110)
    plt.close(figure)


def draw_docks(rows: list[Row], target: Path) -> None:
    """Ways of the rear axle to docks, as driven: both machines on both aprons."""
    kinds = [(name, kind) for name in ("truck", "LHD") for kind in list(APRONS)[:2]]
    figure, axes = plt.subplots(2, 2, figsize=(9.0, 8.0), layout="constrained")
    for one, (name, kind) in zip(axes.ravel(), kinds, strict=True):
        width, height = APRONS[kind]
        one.plot([0, width, width, 0, 0], [0, 0, height, height, 0], color="#444444", lw=1.5)
        for row in rows:
            if row["machine"] == name and row["apron"] == kind and row.get("track"):
                track = np.array(row["track"])
                (line,) = one.plot(
                    track[:, 0], track[:, 1], lw=1.2, label=f"{row['cusps']} cusps, {row['off_m'] * 100:.0f} cm"
                )
                colour = line.get_color()
                one.plot(*track[0, :2], "o", color=colour, ms=4.0)
                ahead = track[0, :2] + 3.0 * np.array([np.cos(track[0, 2]), np.sin(track[0, 2])])
                one.plot(*np.stack([track[0, :2], ahead]).T, color=colour, lw=2.5, alpha=0.5)
        one.set(aspect="equal", title=f"{name}, {kind} m")
        one.legend(fontsize=7, frameon=False, loc="lower left")
    figure.savefig(target, dpi=110)
    plt.close(figure)

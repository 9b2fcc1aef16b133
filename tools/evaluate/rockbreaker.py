"""Durations of the rockbreaker's trajectories beside the paper's, and soundness of plans between random poses.

python -m tools.evaluate.rockbreaker [--pairs N]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from lhdmap.cli.eval_rockbreaker import NAMES
from lhdmap.evaluation.rockbreaker import WHY_293, Row, Table, regenerate
from lhdmap.messages import FloatArray
from lhdmap.report import charts
from lhdmap.rockbreaker.check import check
from lhdmap.rockbreaker.kinematics import pose_of_theta
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.rockbreaker.paths import KINDS
from lhdmap.rockbreaker.plan import Planner, Request
from lhdmap.rockbreaker.timing import Timing

ROOT = Path(__file__).resolve().parents[2]
RESULT = ROOT / "evaluation" / "rockbreaker.md"
PICTURE = ROOT / "docs" / "img" / "rockbreaker_times.png"
EXECUTABLE: tuple[Timing, ...] = ("paper", "paper-best", "smooth")
HEADING = """\
# Rockbreaker

Written by `python -m tools.evaluate.rockbreaker`; not edited by hand. Machine: Table 1 of the paper as printed. Seconds.
"""


def main(words: list[str] | None = None) -> int:
    """Regenerate the table, plan between random poses, write page and picture; 1 where a figure is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=1000)
    options = parser.parse_args(words)
    table = regenerate(Planner())
    lines = [HEADING, *_durations(table), "", *_further(table), "", *_random(options.pairs)]
    RESULT.write_text("\n".join(lines) + "\n", encoding="utf-8")
    _draw(table)
    return 1 if table.missed else 0


def _durations(table: Table) -> Iterator[str]:
    for phi_given, title in ((True, "## φ = 293.6° given"), (False, "## φ by Section 3.1")):
        yield f"{title}\n\n| path, timing | {' | '.join(NAMES)} |\n| --- |{' --- |' * len(NAMES)}"
        rows = [row for row in table.rows if row.phi_given == phi_given]
        for path, timing in dict.fromkeys((row.path, row.timing) for row in rows):
            yield from _lines([row for row in rows if (row.path, row.timing) == (path, timing)])
        yield ""
    yield f"{WHY_293[0].upper()}{WHY_293[1:]}."


def _lines(rows: list[Row]) -> Iterator[str]:
    name = f"{rows[0].path} `{rows[0].timing}`"
    if rows[0].paper_s is not None:
        yield f"| {name}, the paper | " + " | ".join(f"{row.paper_s:.1f}" for row in rows) + " |"
    yield (
        f"| {name}, lhdmap | "
        + " | ".join(f"{row.duration_s:.2f}{'' if row.ok else ' **missed**'}" for row in rows)
        + " |"
    )
    if rows[0].target_s is not None:
        yield f"| {name}, wanted | " + " | ".join(f"{row.target_s:.2f}" for row in rows) + " |"


def _further(table: Table) -> Iterator[str]:
    yield "## Further figures\n\n| | measured | wanted | ok |\n| --- | --- | --- | --- |"
    for one in table.figures:
        yield f"| {one.name} | {one.value} | {one.wanted} | {'yes' if one.ok else '**no**'} |"
    yield "\n| paper's profile | limited by | at, s | oil, L |\n| --- | --- | --- | --- |"
    for row in table.rows:
        if row.timing == "paper" and row.phi_given:
            yield f"| {row.trajectory} {row.path} | {row.limiting} | {row.limit_reached_at_s:.1f} | {row.pump_volume_l:.2f} |"


def _random(pairs: int) -> Iterator[str]:
    """Yield how plans between random poses passed the dense check, by timing."""
    planner = Planner()
    poses = random_poses(planner.machine, 2 * pairs)
    yield f"## {pairs} random pairs of poses within all limits, both paths\n"
    yield "| timing | planned | refused | failed the check | highest load | over the any-path bound | planning, ms: median, p99 |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    for timing in EXECUTABLE:
        loads, over, spent, refused, failed = [], [], [], 0, 0
        for start, end in zip(poses[::2], poses[1::2], strict=True):
            for kind in KINDS:
                plan = planner.plan(Request(start[:3], end[:3], float(start[3]), float(end[3]), kind, timing))
                if plan.trajectory is None:
                    refused += 1
                    continue
                verdict = check(plan.trajectory.path, plan.trajectory.law)
                failed += bool(verdict.problems) or plan.trajectory.law.duration_s < plan.trajectory.bound_s
                loads.append(float(verdict.highest.max()))
                over.append(plan.trajectory.law.duration_s / plan.trajectory.bound_s)
                spent.append(plan.planning_ms)
        cells = (f"`{timing}`", len(loads), refused, failed, f"{max(loads):.6f}", f"{np.median(over):.2f}")
        yield "| " + " | ".join(map(str, cells)) + f" | {np.median(spent):.1f}, {np.percentile(spent, 99):.1f} |"


def random_poses(machine: Rockbreaker, count: int) -> FloatArray:
    """Return poses (count, 4) before the machine."""
    rng = np.random.default_rng(2026)
    low, high = machine.theta_limits
    poses = np.zeros((0, 4))
    while len(poses) < count:
        theta = rng.uniform(low, high, (4 * count, 4))
        found = pose_of_theta(machine, theta)
        poses = np.concatenate([poses, found[np.abs(np.arctan2(found[:, 1], found[:, 0]) - theta[:, 0]) < 1e-9]])
    return poses[:count]


def _draw(table: Table) -> None:
    """Draw the durations as bars: the paper's, ours, and what no path can beat."""
    series = (
        ("the paper, DSJM", "#8a949e", [row.paper_s for row in _rows(table, "dsjm", "paper")]),
        ("the paper, CSLM", "#c9d1d9", [row.paper_s for row in _rows(table, "cslm", "paper")]),
        ("smooth, DSJM", charts.FINAL, [row.duration_s for row in _rows(table, "dsjm", "smooth")]),
        ("smooth, CSLM", "#8cc4ee", [row.duration_s for row in _rows(table, "cslm", "smooth")]),
    )
    with charts.styled():
        figure = charts.new_figure(3.6)
        axes = figure.add_subplot()
        places = np.arange(len(NAMES))
        for k, (label, colour, values) in enumerate(series):
            axes.bar(places + 0.2 * (k - 1.5), np.array(values, dtype=float), 0.18, color=colour, label=label)
        for place, row in zip(places, _rows(table, "any", "bound"), strict=True):
            axes.hlines(row.duration_s, place - 0.4, place + 0.4, color=charts.WHEELS, linewidth=2.0)
        axes.plot([], [], color=charts.WHEELS, linewidth=2.0, label="bound of any path")
        axes.set(xticks=places, xticklabels=NAMES, ylabel="duration, s")
        charts.legend_above(axes, columns=5)
        figure.savefig(PICTURE, dpi=110, facecolor="white")


def _rows(table: Table, path: str, timing: str) -> list[Row]:
    return [row for row in table.rows if (row.path, row.timing, row.phi_given) == (path, timing, True)]


if __name__ == "__main__":
    raise SystemExit(main())

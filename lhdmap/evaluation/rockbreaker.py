"""Table 3 of the rockbreaker paper regenerated: durations of T1 to T6 by path and timing, beside the paper's and the targets.

The corners (Table 2) and the figures to reach stand in `evaluation/rockbreaker_table2.csv` and `…_table3.csv`;
which corners a trajectory joins is erratum 10.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from lhdmap.resources import resource
from lhdmap.rockbreaker.check import PathVerdict, check
from lhdmap.rockbreaker.orientation import nearest_vertical, phi_range, planar_position
from lhdmap.rockbreaker.paths import KINDS, Kind
from lhdmap.rockbreaker.plan import Planner, Request
from lhdmap.rockbreaker.timing import Timing

ENDS = {"T1": "NL FR", "T2": "FR NL", "T3": "NL FL", "T4": "FL NL", "T5": "NL NR", "T6": "FL FR"}
TIMINGS: tuple[Timing, ...] = get_args(Timing)
WHY_293 = (
    "phi at FL and FR: Section 3.1 with Table 1 as printed gives 292.72 deg, where cylinder 3 is at its shortest; the paper's "
    "293.6 deg, given in the reproduction, must come from parameters before their rounding, and Table 1 is not tuned to meet it"
)


@dataclass(frozen=True, slots=True)
class Row:
    """One duration: `phi_given` tells whether the paper's 293.6 deg or Section 3.1 was used; targets are for the former."""

    trajectory: str
    path: str
    timing: str
    phi_given: bool
    duration_s: float
    bound_s: float
    paper_s: float | None
    target_s: float | None
    ok: bool
    limiting: str = ""
    limit_reached_at_s: float = math.nan
    pump_volume_l: float = math.nan
    problems: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure that is not a duration, with what was wanted."""

    name: str
    value: float | str
    wanted: str
    ok: bool


@dataclass(frozen=True, slots=True)
class Target:
    """What a duration should be, and how far below and above it may be, seconds."""

    target_s: float
    below_s: float
    above_s: float

    def met(self, duration_s: float) -> bool:
        """Return whether a duration is within."""
        return self.target_s + self.below_s <= duration_s <= self.target_s + self.above_s


@dataclass
class Table:
    """Rows and further figures."""

    rows: list[Row] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)

    @property
    def missed(self) -> list[str]:
        """Return what missed its target, in words."""
        rows = [f"{row.trajectory} {row.path} {row.timing} {row.duration_s:.3f} s" for row in self.rows if not row.ok]
        return rows + [f"{one.name} {one.value} (wanted {one.wanted})" for one in self.figures if not one.ok]


def regenerate(planner: Planner) -> Table:
    """Return the whole table, both variants of φ, for the machine of `planner`."""
    corners = _corners(resource("evaluation/rockbreaker_table2.csv"))
    published, targets = _targets(resource("evaluation/rockbreaker_table3.csv"))
    table = Table()
    for phi_given in (True, False):
        for name in ENDS:
            ends = [corners[corner] for corner in ENDS[name].split()]
            for kind in KINDS:
                for timing in TIMINGS:
                    known = (published, targets) if phi_given else ({}, {})
                    table.rows.append(_row(planner, name, ends, (kind, timing), known))
    table.rows += list(_bounds(table.rows, targets))
    table.figures += list(_figures(planner, table.rows, corners))
    return table


Known = tuple[dict[tuple[str, str, str], float], dict[tuple[str, str, str], Target]]


def _row(planner: Planner, name: str, ends: list[np.ndarray], how: tuple[Kind, Timing], known: Known) -> Row:
    kind, timing = how
    phi = [math.radians(end[3]) if known[1] else math.nan for end in ends]
    plan = planner.plan(Request(ends[0][:3], ends[1][:3], phi[0], phi[1], kind, timing))
    key = (kind, timing, name)
    target = known[1].get(key)
    row = Row(
        name,
        kind,
        timing,
        bool(known[1]),
        math.nan,
        math.nan,
        known[0].get(key),
        target.target_s if target else None,
        ok=False,
    )
    if plan.trajectory is None:
        return replace(row, problems=(plan.refusal.text if plan.refusal else "not feasible",))
    found = plan.trajectory
    verdict = check(found.path, found.law, executable=timing != "limit")
    duration_s = found.law.duration_s
    met = (target is None or target.met(duration_s)) and _sound(duration_s, found.bound_s, verdict)
    row = replace(row, duration_s=duration_s, bound_s=found.bound_s, ok=met, pump_volume_l=found.pump_volume_l)
    at_s = verdict.limit_reached_at_s
    return replace(row, limiting=verdict.limiting, limit_reached_at_s=at_s, problems=verdict.problems)


def _sound(duration_s: float, bound_s: float, verdict: PathVerdict) -> bool:
    """Return whether a plan passed the dense check and is not below the any-path bound."""
    return not verdict.problems and duration_s >= bound_s - 1e-6


def _bounds(rows: list[Row], targets: dict[tuple[str, str, str], Target]) -> Iterator[Row]:
    """Yield the any-path bounds as rows of their own."""
    for row in rows:
        if row.path == KINDS[0] and row.timing == "paper" and row.phi_given:
            target = targets[("any", "bound", row.trajectory)]
            ok = target.met(row.bound_s)
            yield Row(row.trajectory, "any", "bound", True, row.bound_s, row.bound_s, None, target.target_s, ok)


def _figures(planner: Planner, rows: list[Row], corners: dict[str, np.ndarray]) -> Iterator[Figure]:
    """Yield what the paper says besides durations, and the kinematic figures that are known."""
    paper = {(row.trajectory, row.path): row for row in rows if row.phi_given and row.timing == "paper"}
    for kind, litres in (("dsjm", 26.13), ("cslm", 28.94)):
        found = paper[("T1", kind)].pump_volume_l
        yield Figure(f"pump volume of T1, {kind}, L", round(found, 3), f"{litres} ± 0.03", abs(found - litres) <= 0.03)
        yield Figure(
            f"limiting valve of T1, {kind}", paper[("T1", kind)].limiting, "Q3", paper[("T1", kind)].limiting == "Q3"
        )
    for one, other in (("T1", "T3"), ("T2", "T4")):
        apart_s = abs(paper[(one, "dsjm")].duration_s - paper[(other, "dsjm")].duration_s)
        yield Figure(f"{one} and {other}, dsjm, apart, s", apart_s, "at most 1e-6", apart_s <= 1e-6)
    for corner, wanted in (("NL", (227.290, 286.422)), ("FL", (292.719, 331.542))):
        found_deg = np.degrees(phi_range(planner.machine, planar_position(corners[corner][:3])))
        for name, value, limit in zip(("lowest", "highest"), found_deg, wanted, strict=True):
            yield Figure(
                f"{name} phi at {corner}, deg", round(float(value), 4), f"{limit} ± 0.01", abs(value - limit) <= 0.01
            )
    phi_deg = math.degrees(nearest_vertical(planner.machine, corners["FL"][:3]))
    yield Figure("phi at FL by Section 3.1, deg", round(phi_deg, 3), "292.72 ± 0.01", abs(phi_deg - 292.72) <= 0.01)


def _corners(path: Path) -> dict[str, np.ndarray]:
    with path.open(newline="", encoding="utf-8") as file:
        rows = csv.DictReader(file)
        return {
            row["corner"]: np.array([float(row[name]) for name in ("x_m", "y_m", "z_m", "phi_deg")]) for row in rows
        }


def _targets(path: Path) -> Known:
    """Return published durations and targets by path, timing and trajectory."""
    published, targets = {}, {}
    with path.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            for name in ENDS:
                key, value = (row["path"], row["timing"], name), float(row[name])
                if row["quantity"] == "published":
                    published[key] = value
                else:
                    targets[key] = Target(
                        value, _slack(row, "least", value, -math.inf), _slack(row, "most", value, math.inf)
                    )
    return published, targets


def _slack(row: dict[str, str], side: str, value: float, otherwise: float) -> float:
    """Return how far a duration may be off on one side: a share of it, seconds, or without limit."""
    if row[f"{side}_share"]:
        return float(row[f"{side}_share"]) * value
    return float(row[f"{side}_s"]) if row[f"{side}_s"] else otherwise


def row_json(row: Row) -> dict[str, Any]:
    """Return a row as values for JSON."""
    return {name: getattr(row, name) for name in Row.__slots__}

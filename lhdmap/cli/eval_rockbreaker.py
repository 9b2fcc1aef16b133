"""`lhdmap eval rockbreaker`: Table 3 of the paper regenerated beside the paper's figures."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from lhdmap.cli.console import Console
from lhdmap.errors import EvaluationShortfall

if TYPE_CHECKING:
    from lhdmap.evaluation.rockbreaker import Row, Table

NAMES = ("T1", "T2", "T3", "T4", "T5", "T6")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the subject `rockbreaker`: none, so that nobody can tune the table to match."""


def run(arguments: argparse.Namespace, console: Console) -> int:  # noqa: ARG001  # all subjects are called alike
    """Regenerate the table, print it, and raise where a figure misses its target (exit code 1)."""
    from lhdmap.evaluation.rockbreaker import WHY_293, regenerate, row_json
    from lhdmap.rockbreaker.plan import Planner

    table = regenerate(Planner())
    figures = [{"name": one.name, "value": one.value, "wanted": one.wanted, "ok": one.ok} for one in table.figures]
    values = {
        "rows": [row_json(row) for row in table.rows],
        "figures": figures,
        "missed": table.missed,
        "note": WHY_293,
    }
    console.result(values, "\n".join([*_lines(table), "", WHY_293]))
    if table.missed:
        raise EvaluationShortfall("figures missed: " + "; ".join(table.missed))
    return 0


def _lines(table: Table) -> list[str]:
    lines = [f"{'seconds':<34}" + "".join(f"{name:>8}" for name in NAMES)]
    for phi_given, title in ((True, "phi = 293.6 deg given"), (False, "phi by Section 3.1")):
        lines += ["", title]
        rows = [row for row in table.rows if row.phi_given == phi_given]
        for path, timing in dict.fromkeys((row.path, row.timing) for row in rows):
            lines += _group([row for row in rows if (row.path, row.timing) == (path, timing)])
    lines += ["", *(_limits(table)), ""]
    lines += [f"{one.name:<36} {one.value}  wanted {one.wanted}{'' if one.ok else '  MISSED'}" for one in table.figures]
    return lines


def _group(rows: list[Row]) -> list[str]:
    """Return the lines of one path and timing: the paper's durations, ours, and what was wanted."""
    name = f"{rows[0].path} {rows[0].timing}"
    lines = []
    if rows[0].paper_s is not None:
        lines.append(f"  {name + ', the paper':<32}" + "".join(f"{row.paper_s or 0.0:8.1f}" for row in rows))
    lines.append(f"  {name + ', lhdmap':<32}" + "".join(f"{row.duration_s:8.2f}" for row in rows))
    if rows[0].target_s is not None:
        marks = "".join(f"{row.target_s or 0.0:8.2f}" for row in rows)
        missed = [row.trajectory for row in rows if not row.ok]
        lines.append(f"  {name + ', wanted':<32}{marks}" + (f"  MISSED: {', '.join(missed)}" if missed else ""))
    return lines


def _limits(table: Table) -> list[str]:
    """Return what limits each trajectory of the paper's profile, when, and the oil it takes."""
    lines = ["paper's profile: limited by, at, oil"]
    for row in table.rows:
        if row.timing == "paper" and row.phi_given:
            at = f"{row.limiting:>5} at {row.limit_reached_at_s:5.1f} s {row.pump_volume_l:7.2f} L"
            lines.append(f"  {row.trajectory} {row.path} {at}")
    return lines

"""Tables 3 and 4 of the navigation paper as printed: its rows, and its own lines of µ and σ.

They stand in `evaluation/topological_navigation_table3.csv` and `…_table4.csv`. TD is taken as net (erratum). µ and σ of runs
1 to 14 in Table 4 are, for ACD, MCD, ASD and MSD, those of the loaded runs alone (2, 4 … 14); of all 14 the means are 0.0059,
0.2729, 0.0438 and 5.05. The distances to the walls are of all.
"""

from __future__ import annotations

import csv
from typing import Any

from lhdmap.evaluation.navigation.row import FIGURES, Row
from lhdmap.resources import resource

TABLES = ("evaluation/topological_navigation_table3.csv", "evaluation/topological_navigation_table4.csv")
_TAD = "tad_m"  # printed without a word on net or travelled; the system drove one way
_LINES = ("mu", "sigma")


def paper_rows() -> list[Row]:
    """Return the paper's 14 runs of its system and 4 of an operator (M1 to M4)."""
    found: dict[str, dict[str, str]] = {}
    for table in TABLES:
        for line in _read(table):
            if not line["id"].startswith(_LINES):
                found.setdefault(line["id"], {}).update(line)
    return [_row(name, cells) for name, cells in found.items()]


def printed() -> list[dict[str, dict[str, float]]]:
    """Return the printed lines of µ and σ of Table 3 and of Table 4: figures by the line's name."""
    return [
        {
            line["id"]: {_figure(name): float(text) for name, text in line.items() if _is_figure(name) and text}
            for line in _read(table)
            if line["id"].startswith(_LINES)
        }
        for table in TABLES
    ]


def _row(name: str, cells: dict[str, str]) -> Row:
    figures: dict[str, float | None] = dict.fromkeys(FIGURES)
    figures |= {_figure(key): float(text) for key, text in cells.items() if _is_figure(key) and text}
    operation = "manual" if name.startswith("M") else "autonomous"
    return Row(f"paper {name}", cells["load"] or None, operation, cells["heading"] or None, figures)


def _is_figure(name: str) -> bool:
    return name == _TAD or name in FIGURES


def _figure(name: str) -> str:
    return "tad_travelled_m" if name == _TAD else name


def _read(table: str) -> list[dict[str, Any]]:
    with resource(table).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))

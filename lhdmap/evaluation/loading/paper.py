"""The paper's 30 loads, made of its Tables 3 and 5: each load has the mean of its kind, so that all means come out as printed.

Tables 3 and 5 together tell what the loads that went on had before: 50.9, 69.9 and 72.8 %. The 7 early triggers are put on the
first loads; the paper does not say which had them.
"""

from __future__ import annotations

import csv
from typing import NamedTuple

from lhdmap.evaluation.loading.loads import Attempt, Load
from lhdmap.resources import resource

TABLE_3, TABLE_5 = "evaluation/autonomous_loading_table3.csv", "evaluation/autonomous_loading_table5.csv"
PRINTED_ATTEMPTS, PRINTED_FILL, EARLY_TRIGGERS = 3.6, 0.90, 7
"""Table 4 as printed, and section 4.1. 3.6 is an erratum: the rows of Table 3 give 74 / 30 = 2.47."""


class Printed(NamedTuple):
    """A row of a table: number of attempts or of the attempt, loads, mean fill, mean duration (Table 5)."""

    number: int
    n: int
    fill: float
    duration_s: float = 0.0


def printed_3() -> list[Printed]:
    """Return Table 3."""
    return [Printed(int(row["attempts"]), int(row["n"]), float(row["fill"])) for row in _read(TABLE_3)]


def printed_5() -> list[Printed]:
    """Return Table 5."""
    return [
        Printed(int(row["attempt"]), int(row["n"]), float(row["fill"]), float(row["duration_s"]))
        for row in _read(TABLE_5)
    ]


def paper_loads() -> list[Load]:
    """Return 30 loads that give the paper's tables."""
    kinds, rows = printed_3(), printed_5()
    before = _before(kinds, rows)
    loads: list[Load] = []
    for kind in kinds:
        fills = [*before[: kind.number - 1], kind.fill]
        digs = tuple(Attempt(0.0, row.duration_s, fill) for row, fill in zip(rows, fills, strict=False))
        loads += [Load(f"paper {len(loads) + i + 1}", digs) for i in range(kind.n)]
    early = Attempt(0.0, float("nan"), early=True)
    return [Load(load.log, (early, *load.attempts)) if i < EARLY_TRIGGERS else load for i, load in enumerate(loads)]


def _before(kinds: list[Printed], rows: list[Printed]) -> list[float]:
    """Return what those loads had after their k-th attempt that went on: what Table 5's mean leaves of Table 3's."""
    found = []
    for kind, row in zip(kinds, rows, strict=True):
        going_on = row.n - kind.n
        found.append((row.n * row.fill - kind.n * kind.fill) / going_on if going_on else 0.0)
    return found


def _read(table: str) -> list[dict[str, str]]:
    with resource(table).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))

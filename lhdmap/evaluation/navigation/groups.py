"""Mean and deviation of rows by who drove and by load, as at the end of Tables 3 and 4.

σ is that of a sample (n − 1): the paper's own rows give its printed figures with that one (`tests/evaluation/navigation`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lhdmap.evaluation.navigation.row import FIGURES, Row

ALL = "all"


@dataclass(frozen=True, slots=True)
class Group:
    """Rows of one way of driving; `load` is `E`, `L` or `all`. `mu`, `sigma` by figure, None where not known.

    `counts`: how many rows have the figure.
    """

    operation: str | None
    load: str
    n: int
    mu: dict[str, float | None]
    sigma: dict[str, float | None]
    counts: dict[str, int]

    @property
    def name(self) -> str:
        """What a person calls the group."""
        return f"{self.operation or 'not told'}, {self.load}"

    def to_json(self) -> dict[str, Any]:
        """Return the group as a table."""
        return {
            "operation": self.operation,
            "load": self.load,
            "n": self.n,
            "mu": self.mu,
            "sigma": self.sigma,
            "counts": self.counts,
        }


def grouped(rows: Iterable[Row]) -> list[Group]:
    """Return a group for each way of driving and load that there is, and for each way of driving one of all loads."""
    usable = [row for row in rows if not row.problem]
    found = []
    for operation in dict.fromkeys(row.operation for row in usable):
        own = [row for row in usable if row.operation == operation]
        loads = [load for load in ("E", "L") if any(row.load == load for row in own)]
        found += [_group(operation, load, [row for row in own if row.load == load]) for load in loads]
        found.append(_group(operation, ALL, own))
    return found


def _group(operation: str | None, load: str, rows: Sequence[Row]) -> Group:
    values = {name: [row.figures[name] for row in rows if row.figures.get(name) is not None] for name in FIGURES}
    arrays = {name: np.array(column, dtype=float) for name, column in values.items()}
    return Group(
        operation,
        load,
        len(rows),
        {name: float(column.mean()) if len(column) else None for name, column in arrays.items()},
        {name: float(column.std(ddof=1)) if len(column) > 1 else None for name, column in arrays.items()},
        {name: len(column) for name, column in arrays.items()},
    )

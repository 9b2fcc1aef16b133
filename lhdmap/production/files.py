"""Records as tables: `cycles` (a row a bucket) and `phases` (a row an interval), as CSV and as parquet."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lhdmap.haulage.records import Cycle, Phase
from lhdmap.production.usage import CLASS_OF

Rows = list[dict[str, Any]]


def cycle_rows(cycles: Sequence[Cycle]) -> Rows:
    """Return a row for each cycle: what it was, and the seconds of each phase."""
    rows = []
    for one in cycles:
        row: dict[str, Any] = {
            "machine": one.machine,
            "number": one.number,
            "load": one.load,
            "dump": one.dump,
            "from_ns": one.from_ns,
            "to_ns": one.to_ns,
            "finished": one.finished,
            "mass_t": one.mass_t,
            "fill": one.fill,
            "attempts": one.attempts,
            "slip": one.slip,
            "distance_m": one.distance_m,
        }
        rows.append(row | {f"{phase.name.lower()}_s": one.seconds(phase) for phase in Phase})
    return rows


def phase_rows(cycles: Sequence[Cycle]) -> Rows:
    """Return a row for each interval, with its class of time usage."""
    return [
        {
            "machine": one.machine,
            "number": one.number,
            "phase": str(part.phase),
            "usage": str(CLASS_OF[part.phase]),
            "from_ns": part.from_ns,
            "to_ns": part.to_ns,
            "place": part.place,
            "cause": part.cause,
            "distance_m": part.distance_m,
        }
        for one in cycles
        for part in one.intervals
    ]


def write_csv(path: Path, rows: Rows) -> None:
    """Write rows as CSV; what is not known is empty."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]) if rows else [])
        writer.writeheader()
        writer.writerows({key: "" if _unknown(value) else value for key, value in row.items()} for row in rows)


def write_parquet(path: Path, rows: Rows) -> None:
    """Write rows as parquet."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.Table.from_pylist(rows), path)


def _unknown(value: Any) -> bool:
    return isinstance(value, float) and not math.isfinite(value)

"""`batch.parquet`: a row for each log, with the figures that its command gives."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lhdmap.batch.ledger import RowResult
from lhdmap.names import shown


def write_table(path: Path, rows: Sequence[RowResult]) -> None:
    """Write the table; what a row does not have is null. Figures that are lists or tables are in the rows' JSON files alone."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    told = [_cells(row) for row in rows]
    names = list(dict.fromkeys(name for cells in told for name in cells))
    with path.open("wb") as file:
        pq.write_table(pa.table({name: _column([cells.get(name) for cells in told]) for name in names}), file)


def _cells(row: RowResult) -> dict[str, Any]:
    own: dict[str, Any] = {
        "log": row.task.log,
        "name": row.task.name,
        "command": row.task.command,
        "status": row.status,
    }
    own |= {"reason": row.reason or None, "map": row.map}
    own |= {"run": row.folder, "retried": row.retried, "seconds": row.wall_s}
    own |= {"machine": row.task.machine or None, "shift": row.task.shift or None}
    told = {**row.figures, **row.values}
    figures = {key: value for key, value in told.items() if isinstance(value, (bool, int, float, str))}
    return own | {key: value for key, value in figures.items() if key not in own}


def _column(values: Sequence[Any]) -> Any:
    import pyarrow as pa

    kinds = {type(value) for value in values if value is not None}
    if kinds == {bool}:
        return pa.array(values, pa.bool_())
    if kinds == {int}:
        return pa.array(values, pa.int64())
    if kinds and kinds <= {int, float}:
        return pa.array([None if value is None else float(value) for value in values], pa.float64())
    return pa.array([None if value is None else shown(value) for value in values], pa.string())

"""The columns of `localization.parquet` are the contract's: names, order, types, units, also where nothing is known."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from lhdmap.localization.rows import NOWHERE, TRACKING, UNKNOWN, LocalizationRow, columns
from lhdmap.runfolder import RunFolderWriter

CONTRACT = {
    "stamp_ns": "int64",
    "status": "string",
    "node": "string",
    **dict.fromkeys(("rho_m", "lateral_m", "heading_rad", "x_m", "y_m", "z_m", "yaw_rad"), "double"),
    **dict.fromkeys(("std_along_m", "std_across_m", "std_heading_rad", "information_along", "probability"), "double"),
    "source": "string",
    "next_point": "string",
    **dict.fromkeys(("next_point_m", "latency_ms"), "double"),
}
SOMEWHERE = NOWHERE._replace(stamp_ns=2**60 + 1, status=TRACKING, node="t1", x_m=1.5, source="walls", next_point="w1")


def test_names_and_types_of_the_file(tmp_path: Path) -> None:
    with RunFolderWriter("localization", tmp_path / "run") as folder:
        path = folder.write_table("localization.parquet", columns([NOWHERE, SOMEWHERE]))
        table = pq.read_table(path)
    assert {field.name: str(field.type) for field in table.schema} == CONTRACT
    assert table.column_names == list(LocalizationRow._fields)
    assert table["stamp_ns"].to_pylist() == [0, 2**60 + 1]
    assert table["node"].to_pylist() == ["", "t1"]
    assert table["x_m"][1].as_py() == 1.5


def test_a_row_of_nothing_has_no_figures() -> None:
    table = columns([NOWHERE])
    assert table["status"] == [UNKNOWN]
    numbers = [name for name, kind in CONTRACT.items() if kind == "double" and name != "probability"]
    assert all(math.isnan(table[name][0]) for name in numbers)
    assert table["probability"][0] == 0.0


def test_no_rows_have_the_same_columns() -> None:
    table = columns([])
    assert list(table) == list(CONTRACT)
    assert table["stamp_ns"].dtype == np.int64

"""Trends by machine and shift: what is read of a result, how rows are put together, what the page shows of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from lhdmap.batch.figures import folder_figures
from lhdmap.report.batch_page import write_batch_report
from lhdmap.report.batch_trends import cells_of, trend_section


def _map(folder: Path) -> Path:
    """A map's folder with all that the figures are read from."""
    folder.mkdir()
    counts = {"expected_error": {"end_pct": 0.25}, "degenerate_share": 0.125}
    described = {"kind": "map", "software": {"name": "lhdmap", "version": "0"}, "counts": counts}
    (folder / "map.json").write_text(json.dumps(described))
    (folder / "trajectory.tum").write_text("# stamp x y z\n1700000000.5 0 0 0 0 0 0 1\n1700000009.0 1 0 0 0 0 0 1\n")
    pq.write_table(pa.table({"slip": np.array([0.1, np.nan, 0.3])}), folder / "diagnostics.parquet")
    (folder / "pile.json").write_text(json.dumps({"status": "loadable", "width_m": 4.5, "volume_m3": None}))
    return folder


def test_figures_of_a_map(tmp_path: Path) -> None:
    found = folder_figures(_map(tmp_path / "map"))
    assert found.pop("slip_mean") == pytest.approx(0.2)
    assert found == {
        "began": "2023-11-14T22:13:20+00:00",
        "drift_pct": 0.25,
        "weak_pct": 12.5,
        "pile_status": "loadable",
        "pile_width_m": 4.5,
    }


def test_what_is_not_there_is_left_out(tmp_path: Path) -> None:
    assert folder_figures(tmp_path / "none") == {}
    folder = _map(tmp_path / "map")
    for name in ("trajectory.tum", "pile.json", "diagnostics.parquet"):
        (folder / name).write_text("not what it should be")
    assert set(folder_figures(folder)) == {"drift_pct", "weak_pct"}


def _row(machine: str, shift: str, status: str = "done", **figures: Any) -> dict[str, Any]:
    told = {"log": f"{machine}_{shift}.mcap", "command": "build-map", "status": status, "reason": "why", "link": None}
    return told | {"machine": machine, "shift": shift, "figures": figures, "values": {}, "wall_s": 1.0, "name": "x"}


ROWS = [
    _row("lhd_7", "2", drift_pct=0.4, weak_pct=3.0, pile_status="loadable"),
    _row("lhd_7", "1", drift_pct=0.1),
    _row("lhd_7", "1", drift_pct=0.3, pile_status="too_shallow"),
    _row("lhd_7", "1", "failed"),
    _row("lhd_12", "1", drift_pct=0.5),
    _row("lhd_12", "", slip_mean=0.01),
]


def test_rows_are_put_together_by_machine_and_shift() -> None:
    found = {(cell.machine, cell.shift): (len(cell.rows), cell.values("drift_pct")) for cell in cells_of(ROWS)}
    assert found == {
        ("lhd_7", "1"): (3, [0.1, 0.3]),
        ("lhd_7", "2"): (1, [0.4]),
        ("lhd_12", "1"): (1, [0.5]),
        ("lhd_12", "not known"): (1, []),
    }


def test_the_page_has_medians_and_a_chart(tmp_path: Path) -> None:
    values = {"total": 6, "done": 5, "failed": 1, "skipped": 0, "retried": 0}
    write_batch_report(tmp_path / "report.html", "m.csv", values, ROWS)
    page = (tmp_path / "report.html").read_text()
    assert "Trends by machine and shift" in page
    line = next(line for line in page.splitlines() if "<td>lhd_7</td><td>1</td>" in line)
    assert "0.20 (2)" in line
    assert "1 too shallow" in line
    assert "data:image/svg+xml" in page


def test_without_figures_there_are_no_trends() -> None:
    assert trend_section([_row("lhd_7", "1", "failed")]) == ""

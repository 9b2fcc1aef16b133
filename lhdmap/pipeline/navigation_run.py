"""What `eval navigation` gives: one table for JSON, and the folder with CSV tables, samples and report."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.evaluation.navigation.drive import RATE_HZ
from lhdmap.evaluation.navigation.groups import grouped
from lhdmap.evaluation.navigation.paper import paper_rows
from lhdmap.evaluation.navigation.rate_free import LOW_PASS
from lhdmap.evaluation.navigation.row import Row
from lhdmap.pipeline.navigation import Drive
from lhdmap.report.navigation_page import DrawnDrive, write_navigation_report
from lhdmap.runfolder import RunFolderWriter, RunInfo

KIND = "navigation"
CONVENTION = {
    "rate_hz": RATE_HZ,
    "propel": "±1",
    "steering": "rate / largest rate, ±1",
    "speed": "km/h",
    "articulation": "deg",
    "low_pass": LOW_PASS,
    "sigma": "of a sample (n - 1)",
}


def result_of(rows: Sequence[Row]) -> dict[str, Any]:
    """Return what `--json` prints: rows, groups, the convention of E, and the paper's rows and groups."""
    paper = paper_rows()
    return {
        "rows": [row.to_json() for row in rows],
        "groups": [group.to_json() for group in grouped(rows)],
        "convention": CONVENTION,
        "paper": {
            "rows": [_without_texts(row) for row in paper],
            "groups": [group.to_json() for group in grouped(paper)],
        },
    }


def write_run(target: Path, drives: Sequence[Drive], rows: Sequence[Row], *, force: bool = False) -> Path:
    """Write `rows.csv`, `groups.csv`, `samples_N.parquet`, `navigation.json` and `report.html`; return the folder.

    Raises:
        UsageError: the folder is there already.
    """
    logs = [Path(drive.row.log) for drive in drives]
    warnings = [f"{row.log}: {text}" for row in rows for text in (*row.warnings, row.problem) if text]
    with RunFolderWriter(KIND, target, force=force, inputs=logs) as folder:
        found = result_of(rows)
        folder.write_json("navigation.json", found)
        _write_csv(folder, "rows.csv", [{**row, "warnings": "; ".join(row["warnings"])} for row in found["rows"]])
        _write_csv(folder, "groups.csv", _flat(found))
        for number, drive in enumerate(drives, start=1):
            folder.write_table(f"samples_{number}.parquet", columns_of(drive))
        drawn = [DrawnDrive(drive.row, drive.samples, drive.walls) for drive in drives]
        write_navigation_report(folder.path / "report.html", target.name, drawn, rows)
        folder.finished(folder.path / "report.html")
        counts = {"drives": len(drives), "failed": len(rows) - len(drives)}
        return folder.complete(RunInfo(logs, {"convention": CONVENTION}, counts, warnings))


def columns_of(drive: Drive) -> dict[str, Any]:
    """Return a drive's samples at 10 Hz as columns, walls of the nearest moment beside."""
    samples = drive.samples
    walls = np.array([row[:3] for row in drive.walls], dtype=float).reshape(-1, 3)
    beside = np.full((len(samples.time_s), 2), np.nan)
    if len(walls):
        near = np.clip(np.searchsorted(walls[:, 0], samples.time_s), 0, len(walls) - 1)
        close = np.abs(walls[near, 0] - samples.time_s) <= 2.0 / RATE_HZ
        beside[close] = walls[near[close], 1:]
    return {
        "time_s": samples.time_s,
        "speed_mps": samples.speed_mps,
        "articulation_rad": samples.articulation_rad,
        "propel": samples.propel,
        "steering": samples.steering,
        "mode": [str(one) for one in samples.mode],
        "left_wall_m": beside[:, 0],
        "right_wall_m": beside[:, 1],
    }


def _without_texts(row: Row) -> dict[str, Any]:
    return {key: value for key, value in row.to_json().items() if key not in ("warnings", "problem")}


def _flat(found: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return µ and σ of all groups, ours and the paper's, a line each."""
    return [
        {
            "of": whose,
            "operation": group["operation"],
            "load": group["load"],
            "n": group["n"],
            "figure": name,
            **group[name],
        }
        for whose, groups in (("logs", found["groups"]), ("paper", found["paper"]["groups"]))
        for group in groups
        for name in ("mu", "sigma")
    ]


def _write_csv(folder: RunFolderWriter, name: str, lines: Sequence[Mapping[str, Any]]) -> None:
    path = folder.path / name
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(lines[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)
    folder.finished(path)

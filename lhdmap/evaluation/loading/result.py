"""What `eval loading` gives: one table for JSON, and the folder with CSV tables."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lhdmap.evaluation.loading.loads import Load
from lhdmap.evaluation.loading.paper import PRINTED_ATTEMPTS, PRINTED_FILL, paper_loads
from lhdmap.evaluation.loading.tables import tables_of
from lhdmap.runfolder import RunFolderWriter, RunInfo

KIND = "loading tables"


def result_of(loads: Sequence[Load], problems: Sequence[str] = ()) -> dict[str, Any]:
    """Return what `--json` prints: the three tables, the loads, and the paper's tables by the same code."""
    printed = {"attempts": PRINTED_ATTEMPTS, "fill": PRINTED_FILL, "note": "3.6 is an erratum: Table 3 gives 74 / 30"}
    return {
        **tables_of(loads).to_json(),
        "loads": [load.to_json() for load in loads],
        "problems": list(problems),
        "paper": {**tables_of(paper_loads()).to_json(), "table4_printed": printed},
    }


def write_run(
    target: Path, loads: Sequence[Load], logs: Sequence[Path], problems: Sequence[str], *, force: bool = False
) -> Path:
    """Write `attempts.csv`, `table3.csv`, `table5.csv` and `loading.json` into a new folder; return it.

    Raises:
        UsageError: the folder is there already.
    """
    warnings = [f"{load.log}: {text}" for load in loads for text in load.warnings]
    with RunFolderWriter(KIND, target, force=force, inputs=list(logs)) as folder:
        found = result_of(loads, problems)
        folder.write_json("loading.json", found)
        attempts = [
            {"log": load["log"], "attempt": number, **one}
            for load in found["loads"]
            for number, one in enumerate(load["attempts"], start=1)
        ]
        _write_csv(folder, "attempts.csv", attempts)
        for name in ("table3", "table5"):
            _write_csv(folder, f"{name}.csv", [_flat(row) for row in found[name]["rows"]])
        counts = {"loads": len(loads), "attempts": len(attempts), "failed": len(problems)}
        return folder.complete(RunInfo(list(logs), {}, counts, [*warnings, *problems]))


def _flat(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row whose figures with their statistics are columns, `fill_mean` and so on."""
    found: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, Mapping):
            found |= {f"{name}_{key}": one for key, one in value.items() if key != "mean_95"}
            low, high = value["mean_95"] or (None, None)
            found |= {f"{name}_low_95": low, f"{name}_high_95": high}
        else:
            found[name] = value
    return found


def _write_csv(folder: RunFolderWriter, name: str, rows: Sequence[Mapping[str, Any]]) -> None:
    if not rows:
        return
    path = folder.path / name
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    folder.finished(path)

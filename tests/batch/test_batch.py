"""A batch of rows whose ends are known: what is run, retried, skipped, told and kept."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from lhdmap.batch.pool import run_here
from lhdmap.batch.run import BatchRequest, BatchResult, run_batch
from lhdmap.batch.work import BatchJob
from lhdmap.errors import UsageError

from tests.batch.works import work

LOGS = ("good", "killed", "once", "raises", "fails", "other")


def _manifest(folder: Path, logs: Sequence[str], command: str = "pile") -> Path:
    for name in logs:
        (folder / f"{name}.mcap").touch()
    rows = "".join(f"{name}.mcap,{command}\n" for name in logs)
    (folder / "m.csv").write_text(f"log,command\n{rows}", encoding="utf-8")
    return folder / "m.csv"


def _run(manifest: Path, told: list[str] | None = None, *, force: bool = False, workers: int = 2) -> BatchResult:
    lines = [] if told is None else told
    runner = partial(run_here, workers=workers)
    return run_batch(BatchRequest(manifest, manifest.parent / "out", work, runner, force, lines.append))


def _tries(folder: Path) -> dict[str, int]:
    return {path.stem: path.stat().st_size for path in folder.glob("*.tries")}


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, BatchResult, list[str]]:
    """A batch in which a worker is killed once, another one each time."""
    folder, told = tmp_path_factory.mktemp("batch"), list[str]()
    return folder, _run(_manifest(folder, LOGS), told), told


def test_each_row_costs_itself_alone(first: tuple[Path, BatchResult, list[str]]) -> None:
    folder, result, _ = first
    assert [row.task.path.stem for row in result.rows] == list(LOGS)
    assert [row.status for row in result.rows] == ["done", "failed", "done", "failed", "failed", "done"]
    assert _tries(folder) == {"good": 1, "killed": 2, "once": 2, "raises": 1, "fails": 1, "other": 1}
    reasons = {row.task.path.stem: row.reason for row in result.rows if row.reason}
    assert reasons["killed"] == "its process was killed 2 times (out of memory?)"
    assert reasons["raises"] == "ValueError: odd"
    assert reasons["fails"] == "not a log"


def test_json_has_what_the_contract_says(first: tuple[Path, BatchResult, list[str]]) -> None:
    values = first[1].to_json()
    counts = {key: values[key] for key in ("total", "done", "failed", "skipped", "retried")}
    assert counts == {"total": 6, "done": 3, "failed": 3, "skipped": 0, "retried": 2}
    assert all({"log", "status", "reason", "map"} <= set(row) for row in values["rows"])


def test_a_line_for_each_row(first: tuple[Path, BatchResult, list[str]]) -> None:
    told = first[2]
    assert [line.split(":")[0] for line in told] == [f"{k} of 6" for k in range(1, 7)]
    assert any("once.mcap: done" in line and "retried 1" in line for line in told)


def test_table_page_and_folder(first: tuple[Path, BatchResult, list[str]]) -> None:
    folder, result, _ = first
    table = pq.read_table(folder / "out" / "batch.parquet").to_pylist()
    assert [row["log"] for row in table] == [f"{name}.mcap" for name in LOGS]
    assert [row["width_m"] for row in table] == [3.5, None, 3.5, None, None, 3.5]
    page = (folder / "out" / "report.html").read_text()
    assert 'href="good_pile/report.html"' in page
    assert "not a log" in page
    assert not list((folder / "out").glob("*.partial"))
    assert (folder / "out" / "rows" / "fails_pile.txt").read_text() == "lhdmap: not a log\n"
    assert json.loads((folder / "out" / "run.json").read_text())["counts"]["failed"] == 3
    assert result.rows[0].folder == str(folder / "out" / "good_pile")


def test_a_second_run_takes_what_is_missing(tmp_path: Path) -> None:
    manifest = _manifest(tmp_path, ["good", "fails", "other", "third"])
    _run(manifest)
    (tmp_path / "other.mcap").write_text("another log by now")
    stale = tmp_path / "out" / "fails_pile.partial"
    stale.mkdir()
    (stale / ".lhdmap").touch()
    (tmp_path / "out" / "rows" / "third_pile.json").unlink()  # it was killed between folder and line
    result = _run(manifest)
    assert [row.status for row in result.rows] == ["skipped", "failed", "done", "skipped"]
    assert _tries(tmp_path) == {"good": 1, "fails": 2, "other": 2, "third": 1}
    assert not stale.exists()
    assert result.to_json()["rows"][0]["run"] == str(tmp_path / "out" / "good_pile")
    assert pq.read_table(tmp_path / "out" / "batch.parquet").to_pylist()[0]["width_m"] == 3.5  # of the first run
    assert [row.status for row in _run(manifest, force=True).rows] == ["done", "failed", "done", "done"]


def test_a_row_that_asks_for_something_else_is_run_again(tmp_path: Path) -> None:
    manifest = _manifest(tmp_path, ["good"])
    _run(manifest)
    (tmp_path / "c.toml").touch()
    manifest.write_text("log,command,config\ngood.mcap,pile,c.toml\n", encoding="utf-8")
    assert [row.status for row in _run(manifest).rows] == ["done"]


def test_commands_without_a_folder_are_skipped_by_their_line(tmp_path: Path) -> None:
    manifest = _manifest(tmp_path, ["good"], "doctor")
    assert [row.status for row in _run(manifest).rows] == ["done"]
    assert [row.status for row in _run(manifest).rows] == ["skipped"]


def test_one_worker_gives_the_same(tmp_path: Path) -> None:
    result = _run(_manifest(tmp_path, LOGS[:4]), workers=1)
    assert [row.status for row in result.rows] == ["done", "failed", "done", "failed"]


def test_a_process_that_dies_between_two_rows_costs_none(tmp_path: Path) -> None:
    """Of two workers one dies a moment after its row, while the other one is at work."""
    jobs = [BatchJob(name, ("pile", str(tmp_path / name))) for name in ("late", "slow", "slow_2", "good")]
    runs = {ran.key: ran for ran in run_here(jobs, work, 2)}
    assert all(ran.outcome is not None for ran in runs.values())
    assert len(runs) == 4


def test_a_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    manifest = _manifest(tmp_path, ["good"])
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").touch()
    with pytest.raises(UsageError, match="no folder of a batch"):
        _run(manifest)
    assert _tries(tmp_path) == {}

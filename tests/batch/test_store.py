"""Logs and results on stores of fsspec: one in memory, and a folder that is named as a URL."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from lhdmap.batch.pool import run_here
from lhdmap.batch.run import BatchRequest, BatchResult, run_batch
from lhdmap.batch.staged import Staged
from lhdmap.batch.store import Store, check_store, is_url
from lhdmap.batch.work import JobOutcome
from lhdmap.errors import UsageError

from tests.batch.works import work

fsspec = pytest.importorskip("fsspec")


@pytest.fixture
def memory() -> Iterator[Any]:
    """An empty store of this process."""
    files = fsspec.filesystem("memory")
    files.store.clear()
    files.pseudo_dirs[:] = [""]
    yield files
    files.store.clear()


def _maps(words: Sequence[str]) -> JobOutcome:
    """Write a map of a log whose description and values name both, as commands do."""
    log, target = Path(words[1]), Path(words[words.index("-o") + 1])
    target.mkdir()
    (target / "tiles").mkdir()
    (target / "tiles" / "a.bin").write_bytes(log.read_bytes())
    (target / "aa.txt").write_text(Path(words[3]).joinpath("sub", "b.txt").read_text())
    described = {"software": {"name": "lhdmap"}, "sources": [{"path": str(log), "bytes": 3}]}
    (target / "map.json").write_text(json.dumps(described))
    return JobOutcome(0, {"map": str(target), "more": [str(log)]}, f"read {log}\n")


WORDS = ["build-map", "memory://in/drive.mcap", "--map", "memory://in/old_map", "-o", "memory://out/night/drive_map"]


def test_a_row_is_staged_in_and_out_with_its_description_last(memory: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    memory.pipe({"/in/drive.mcap": b"log", "/in/old_map/sub/b.txt": b"old", "/in/old_map/map.json": b"{}"})
    memory.pipe({"/out/night/drive_map/map.json": b"{}", "/out/night/drive_map/gone.bin": b"of a result before"})
    sent, put = [], type(memory).put_file

    def noted(files: Any, path: str, there: str, **more: Any) -> None:
        sent.append(there)
        put(files, path, there, **more)

    monkeypatch.setattr(type(memory), "put_file", noted)
    outcome = Staged(_maps)(WORDS)
    assert outcome.values == {"map": WORDS[5], "more": [WORDS[1]]}
    assert outcome.said == f"read {WORDS[1]}\n"
    assert [one.rpartition("drive_map/")[2] for one in sent] == ["aa.txt", "tiles/a.bin", "map.json"]
    assert memory.cat("/out/night/drive_map/tiles/a.bin") == b"log"
    assert memory.cat("/out/night/drive_map/aa.txt") == b"old"
    assert not memory.exists("/out/night/drive_map/gone.bin")
    described = Store("memory://out/night").described("drive_map")
    assert described is not None
    assert described["sources"][0]["path"] == WORDS[1]


def test_what_cannot_be_fetched_costs_its_row(memory: Any) -> None:
    outcome = Staged(_maps)(WORDS)
    assert outcome.exit_code == 3
    assert outcome.values["error"]["message"].startswith("memory://in/drive.mcap: FileNotFoundError")
    assert not memory.find("/out")


def test_a_result_that_is_half_sent_is_none(memory: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    memory.pipe({"/in/drive.mcap": b"log", "/in/old_map/sub/b.txt": b"old"})
    memory.pipe("/out/night/drive_map/map.json", b'{"software": {"name": "lhdmap"}}')
    put = type(memory).put_file

    def breaks(files: Any, path: str, there: str, **more: Any) -> None:
        if there.endswith("a.bin"):
            raise ConnectionError("link is down")
        put(files, path, there, **more)

    monkeypatch.setattr(type(memory), "put_file", breaks)
    outcome = Staged(_maps)(WORDS)
    assert "ConnectionError: link is down" in outcome.values["error"]["message"]
    assert Store("memory://out/night").described("drive_map") is None


def _run(manifest: Path, target: str, url: str) -> BatchResult:
    runner = partial(run_here, workers=1)
    return run_batch(BatchRequest(manifest, manifest.parent / target, work, runner, store=url))


def test_a_batch_between_stores_goes_on_from_another_machine(tmp_path: Path) -> None:
    logs, results = tmp_path / "logs", tmp_path / "results"
    logs.mkdir()
    for name in ("good", "fails"):
        (logs / f"{name}.mcap").write_text(name)
    url = f"file://{results}"
    lines = "".join(f"file://{logs}/{name}.mcap,pile\n" for name in ("good", "fails"))
    (tmp_path / "m.csv").write_text(f"log,command\n{lines}", encoding="utf-8")
    first = _run(tmp_path / "m.csv", "here", url)
    assert [row.status for row in first.rows] == ["done", "failed"]
    assert first.rows[0].folder == f"{url}/good_pile"
    assert not (tmp_path / "here" / "good_pile").exists()
    assert {path.name for path in results.iterdir()} >= {
        "good_pile",
        "batch.parquet",
        "report.html",
        "run.json",
        "rows",
    }
    assert 'href="good_pile/report.html"' in (results / "report.html").read_text()
    second = _run(tmp_path / "m.csv", "elsewhere", url)
    assert [row.status for row in second.rows] == ["skipped", "failed"]
    (logs / "good.mcap").write_text("another log by now")
    assert [row.status for row in _run(tmp_path / "m.csv", "here", url).rows] == ["done", "failed"]


@pytest.mark.parametrize(
    ("text", "url"), [("s3://a/b.mcap", True), ("/a/b.mcap", False), ("a:b.mcap", False), ("C:/a", False)]
)
def test_urls_are_told_from_paths(text: str, url: bool) -> None:
    assert is_url(text) is url


def test_what_a_store_needs_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match="s3fs for s3://"):
        check_store("nosuch://bucket")
    monkeypatch.setitem(sys.modules, "fsspec", None)
    with pytest.raises(UsageError, match=r"lhdmap\[store\]"):
        check_store("s3://bucket")


def test_a_store_is_a_url(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text("log\na.mcap\n", encoding="utf-8")
    with pytest.raises(UsageError, match="a URL was wanted"):
        _run(tmp_path / "m.csv", "here", "folder/results")

"""`lhdmap batch` with real commands on tiny logs."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from lhdmap.cli.main import main

from tests.cli.logs import write_room_log


def test_logs_in_maps_and_a_table_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_room_log(tmp_path / "a.mcap", 40)
    (tmp_path / "bad.mcap").write_bytes(b"nothing of a log" * 9)
    rows = "a.mcap,\na.mcap,doctor\nbad.mcap,doctor\nnone.mcap,\n"
    (tmp_path / "m.csv").write_text(f"log,command\n{rows}", encoding="utf-8")
    words = ["batch", str(tmp_path / "m.csv"), "-o", str(tmp_path / "out"), "--jobs", "1", "--json"]
    assert main(words) == 1
    values = json.loads(capsys.readouterr().out)
    assert [row["status"] for row in values["rows"]] == ["done", "done", "failed", "failed"]
    assert values["rows"][0]["map"] == str(tmp_path / "out" / "a_map")
    assert (tmp_path / "out" / "a_map" / "map.json").is_file()
    assert "none.mcap" in values["rows"][3]["reason"]
    assert values["error"]["kind"] == "shortfall"
    assert main(words) == 1
    again = json.loads(capsys.readouterr().out)
    assert (again["done"], again["skipped"], again["failed"]) == (0, 2, 2)


@pytest.mark.parametrize(
    ("more", "code"), [(["--jobs", "0"], 2), (["--jobs", "2", "--cluster", "tcp://127.0.0.1:1"], 2)]
)
def test_wrong_usage(tmp_path: Path, more: list[str], code: int) -> None:
    (tmp_path / "m.csv").write_text("log\na.mcap\n", encoding="utf-8")
    assert main(["batch", str(tmp_path / "m.csv"), "-o", str(tmp_path / "out"), *more]) == code
    assert not (tmp_path / "out").exists()


def test_a_cluster_without_dask_says_how_to_install_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    (tmp_path / "m.csv").write_text("log\na.mcap\n", encoding="utf-8")
    assert main(["batch", str(tmp_path / "m.csv"), "--cluster", "tcp://127.0.0.1:1"]) == 2
    assert "pip install 'lhdmap[cluster]'" in capsys.readouterr().err


def test_a_manifest_that_is_not_there_is_input(tmp_path: Path) -> None:
    assert main(["batch", str(tmp_path / "m.csv"), "-o", str(tmp_path / "out")]) == 3

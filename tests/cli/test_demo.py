"""`lhdmap demo`: everything in one go, at a new place each time."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from lhdmap.cli.main import main
from lhdmap.mapfolder import MapFolder
from lhdmap.pipeline.demo import new_folder
from lhdmap.trajectory import read_tum


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """The folder of a demo and what it printed as JSON."""
    target = tmp_path_factory.mktemp("demo") / "first"
    with pytest.MonkeyPatch.context() as patch:
        printed: list[str] = []
        patch.setattr("builtins.print", lambda text="", **options: None if "file" in options else printed.append(text))
        assert main(["demo", "-o", str(target), "--json"]) == 0
    assert len(printed) == 1
    return target, json.loads(printed[0])


def test_all_files_are_where_it_says(demo: tuple[Path, Any]) -> None:
    folder, told = demo
    assert told["folder"] == str(folder)
    for name in ("log", "truth", "report", "recording"):
        assert Path(told[name]).stat().st_size > 1000
    assert MapFolder.open(folder / "drive_map").changed_files() == []
    assert (folder / "evaluation.png").stat().st_size > 1000


def test_the_map_is_close_to_the_truth(demo: tuple[Path, Any]) -> None:
    folder, told = demo
    assert told["evaluation"]["reach"] > 0.99
    assert told["evaluation"]["end_pct"] < 1.5
    assert told["map"]["lost_stretches"] == 0
    assert json.loads((folder / "evaluation.json").read_text(encoding="utf-8")) == told["evaluation"]


def test_a_pose_for_every_front_scan(demo: tuple[Path, Any]) -> None:
    folder, told = demo
    assert len(read_tum(folder / "drive_map" / "trajectory.tum").stamps_ns) == told["map"]["scans"]


def test_a_taken_name_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo" / "mine.txt").write_text("kept", encoding="utf-8")
    assert new_folder(tmp_path / "demo") == tmp_path / "demo-2"
    assert new_folder(tmp_path / "demo") == tmp_path / "demo-3"
    assert (tmp_path / "demo" / "mine.txt").read_text(encoding="utf-8") == "kept"

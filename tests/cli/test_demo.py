"""`lhdmap demo`: everything in one go, over nothing that is there unless that is asked for."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from lhdmap.cli.main import main
from lhdmap.mapfolder import MapFolder
from lhdmap.replay.run import ReplayResult
from lhdmap.runfolder import RunFolderWriter
from lhdmap.simulation.scenario import DriftScenario, load_scenario
from lhdmap.trajectory import read_tum

VERDICT = {"ok": True, "reason": "done", "cycles": 1, "tonnes": 9.5, "distance_m": 200.0, "duration_s": 150.0,
           "realtime_factor": 4.0}  # fmt: skip


def cycle(folder: RunFolderWriter, *_: Any) -> ReplayResult:
    """The cycle, which takes most of the time and has tests of its own (tests/replay): nothing is driven."""
    made = folder.path / "cycle"
    made.mkdir()
    return ReplayResult(made, VERDICT)


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """The folder of a demo and what it printed as JSON."""
    target = tmp_path_factory.mktemp("demo") / "first"
    with pytest.MonkeyPatch.context() as patch:
        printed: list[str] = []
        patch.setattr("lhdmap.replay.demo._cycle", cycle)
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


def shortened(whole: DriftScenario) -> DriftScenario:
    """Return the scenario with a drive of 3 m."""
    drift, drive = replace(whole.drift, cross_drifts=()), replace(whole.drive, distance_m=3.0)
    return replace(whole, drift=drift, drive=replace(drive, stops=(), reversals=()))


@pytest.fixture
def short_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    """The demo with a drive of 3 m, and without its cycle."""
    monkeypatch.setattr("lhdmap.replay.demo.load_scenario", lambda path: shortened(load_scenario(path)))
    monkeypatch.setattr("lhdmap.replay.demo._cycle", cycle)


def test_a_taken_name_is_refused_before_the_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo" / "mine.txt").write_text("kept", encoding="utf-8")
    for words in ([], ["--force"]):
        assert main(["demo", "-o", str(tmp_path / "demo"), *words]) == 2
        told = capsys.readouterr().err
        assert str(tmp_path / "demo") in told
        assert "-o OTHER" in told
        assert "simulate" not in told
    assert [path.name for path in tmp_path.rglob("*")] == ["demo", "mine.txt"]


def test_a_second_demo_replaces_the_first_with_force(
    short_drive: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "demo"
    for _ in range(2):
        assert main(["demo", "-o", str(target), "--force", "--json", "--quiet"]) == 0
        (target / "stale.txt").touch()
    told = json.loads(capsys.readouterr().out.splitlines()[-1])
    (target / "stale.txt").unlink()
    assert [path.name for path in tmp_path.iterdir()] == ["demo"]
    for name in ("log", "truth", "report", "recording"):
        assert Path(told[name]).is_relative_to(target)
        assert Path(told[name]).is_file()
    assert told["cycle"]["picture"] == str(target / "cycle" / "mission.png")
    source = json.loads((target / "drive_map" / "map.json").read_text(encoding="utf-8"))["sources"][0]
    assert source["path"] == str(target / "drive.mcap")
    assert main(["demo", "-o", str(target)]) == 2


def test_make_demo_works_twice() -> None:
    lines = (Path(__file__).parents[2] / "Makefile").read_text(encoding="utf-8").splitlines()
    assert any("lhdmap demo" in line and "--force" in line for line in lines)

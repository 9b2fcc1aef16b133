"""`lhdmap info`: what is in a folder, in ten lines; and logs and maps that are taken for each other."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from lhdmap.cli.main import main
from lhdmap.runfolder import RunFolderWriter, RunInfo

from tests.cli.logs import write_room_log


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The map of 80 scans over 79 x 4 cm, with one setting changed."""
    folder = tmp_path_factory.mktemp("info")
    log = write_room_log(folder / "room.mcap", 80)
    words = [
        "build-map",
        str(log),
        "-o",
        str(folder / "map"),
        "--set",
        "odometry.step_m=0.2",
        "--one-process",
        "--quiet",
    ]
    assert main(words) == 0
    return folder / "map"


def values_of(path: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    capsys.readouterr()
    assert main(["info", str(path), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_map_in_ten_lines(built: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["info", str(built)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 10
    text = "\n".join(lines)
    for part in (
        "map ",
        str(built),
        "room.mcap",
        "3 m in 3 s",
        "80 (",
        "odometry.step_m = 0.2",
        "cloud.ply",
        "warnings",
    ):
        assert part in text


def test_the_same_as_values(built: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = values_of(built, capsys)
    assert (found["kind"], found["counts"]["scans"]) == ("map", 80)
    assert found["settings"] == {"odometry.step_m": 0.2}
    assert found["files"]["trajectory.tum"] == (built / "trajectory.tum").stat().st_size
    assert found["sources"][0]["there"]
    assert found["changed"] == []


def test_files_that_changed_are_named(built: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    copy = tmp_path / "copy"
    copy.mkdir()
    for path in built.iterdir():
        (copy / path.name).write_bytes(path.read_bytes())
    (copy / "cloud.ply").write_bytes(b"ply")
    (copy / "odometry.tum").unlink()
    assert values_of(copy, capsys)["changed"] == ["cloud.ply", "odometry.tum"]


def test_a_run_with_a_map_in_it_tells_of_both(built: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with RunFolderWriter("demo", tmp_path / "demo") as folder:
        (folder.path / "drive_map").mkdir()
        for path in built.iterdir():
            (folder.path / "drive_map" / path.name).write_bytes(path.read_bytes())
        demo = folder.complete(RunInfo(more={"map": "drive_map"}))
    found = values_of(demo, capsys)
    assert (found["kind"], found["map"]["kind"]) == ("demo", "map")
    assert main(["info", str(demo)]) == 0
    assert capsys.readouterr().out.startswith(f"demo         {demo}\nmap          {demo / 'drive_map'}")


def test_a_partial_folder_says_that_it_was_interrupted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "map.partial").mkdir()
    (tmp_path / "map.partial" / "odometry.tum").touch()
    assert main(["info", str(tmp_path / "map.partial")]) == 3
    told = capsys.readouterr().err
    assert "interrupted" in told
    assert "odometry.tum" in told


def test_doctor_tells_of_a_map_that_is_given_as_a_log(built: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["doctor", str(built), "--json"]) == 3
    found = json.loads(capsys.readouterr().out)
    assert "is a map folder of lhdmap" in found["error"]["message"]
    assert "room.mcap" in found["error"]["message"]
    assert found["logs"][0]["verdict"] == "not usable"


def test_one_section_of_the_settings(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["config", "slip", "wheels", "--json"]) == 0
    assert sorted(json.loads(capsys.readouterr().out)) == ["slip", "wheels"]
    assert main(["config", "slip"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("[slip]")
    assert text.count("\n[") == 0


def test_common_options_before_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--json", "config", "slip"]) == 0
    assert "slip" in json.loads(capsys.readouterr().out)
    assert main(["--json", "confg"]) == 2
    assert "config" in json.loads(capsys.readouterr().out)["error"]["message"]

"""What commands print, and what is kept of a run that was interrupted."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from lhdmap.cli.main import main

from tests.cli.logs import write_room_log

BUILD_MAP_KEYS = {
    "map", "scans", "scans_processed", "duration_s", "distance_m", "wall_s", "realtime_factor", "peak_memory_mib",
    "degenerate_share", "lost_stretches", "closures", "pile", "warnings",
}  # fmt: skip


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_room_log(tmp_path_factory.mktemp("results") / "room.mcap", 100)


def _json(words: list[str], capsys: pytest.CaptureFixture[str]) -> Any:
    """Return the one JSON object that a command prints on standard output."""
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_build_map_gives_the_contracts_object(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = _json(["build-map", str(log), "-o", str(tmp_path / "map")], capsys)
    assert found.keys() >= BUILD_MAP_KEYS
    assert found["scans"] == 100
    assert found["distance_m"] == pytest.approx(99 * 0.04, rel=0.05)
    assert found["map"] == str(tmp_path / "map")


@pytest.mark.parametrize("words", [["doctor", "{log}"], ["config"], ["doctor", "{log}", "{log}"]])
def test_one_json_object(words: list[str], log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert isinstance(_json([word.format(log=log) for word in words], capsys), dict)


def test_without_an_output_the_map_lies_beside_its_log(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert Path(_json(["build-map", str(log)], capsys)["map"]).parent == log.parent


def test_settings_reach_the_map(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[odometry]\nstep_m = 0.3\n", encoding="utf-8")
    words = ["--config", str(file), "--set", "odometry.step_deg=2", "-o", str(tmp_path / "map")]
    found = _json(["build-map", str(log), *words], capsys)
    options = json.loads((Path(found["map"]) / "map.json").read_text(encoding="utf-8"))["options"]
    assert (options["odometry"]["step_m"], options["odometry"]["step_deg"]) == (0.3, 2.0)


def test_quiet_says_nothing_on_standard_error(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        main(["simulate", "drift", "--length", "2", "--mesh-size", "0.2", "-o", str(tmp_path / "a.mcap"), "--quiet"])
        == 0
    )
    told = capsys.readouterr()
    assert told.err == ""
    assert "a.mcap" in told.out


_WITH_POSES_BYTES = 500_000


@pytest.fixture
def interrupted(tmp_path: Path) -> tuple[int, str, Path]:
    """Exit code, standard error and output folder of a long `build-map` that gets the signal of Ctrl-C."""
    long_log = write_room_log(tmp_path / "long.mcap", 25000)
    command = [sys.executable, "-m", "lhdmap", "build-map", str(long_log), "-o", str(tmp_path / "map")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        partial = tmp_path / "map.partial" / "recording.rrd"
        for _ in range(6000):
            # Poses are in it, not its head alone: a slow machine still compiles then.
            if process.poll() is not None or (partial.exists() and partial.stat().st_size > _WITH_POSES_BYTES):
                break
            time.sleep(0.02)
        os.kill(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=120)
    return process.returncode, errors, tmp_path


def test_interrupted_keeps_what_is_there(interrupted: tuple[int, str, Path]) -> None:
    exit_code, errors, folder = interrupted
    assert exit_code == 4
    assert "Traceback" not in errors
    assert "interrupted" in errors
    assert not (folder / "map").exists(), "an interrupted map does not look like a complete one"
    assert (folder / "map.partial").is_dir()
    assert f"what was finished is kept in {folder / 'map.partial'}" in errors
    assert {"odometry.tum", "trajectory.tum", "cloud.ply"} <= {path.name for path in (folder / "map.partial").iterdir()}

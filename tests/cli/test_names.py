"""Commands on logs whose names are not UTF-8, or `.`, or begin with a dash."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from lhdmap.cli.main import main
from lhdmap.mapfolder import MapFolder

from tests.cli.logs import write_room_log

NAME, SHOWN = os.fsdecode(b"M\xfcller <drive>"), "M\\xfcller <drive>"
pytestmark = pytest.mark.skipif(os.name != "posix", reason="names are bytes on POSIX alone")


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_room_log(tmp_path_factory.mktemp("names") / "room.mcap", 60)


def _lhdmap(*words: str, cwd: Path | None = None) -> Any:
    """Run the program as a person would and return its JSON object."""
    command = [sys.executable, "-m", "lhdmap", *words, "--json", "--quiet"]
    done = subprocess.run(command, cwd=cwd, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    done.stderr.decode()  # what is said can be read
    return json.loads(done.stdout)


def test_a_log_whose_name_is_not_utf8(room: Path, tmp_path: Path) -> None:
    log = tmp_path / f"{NAME}.mcap"
    shutil.copy(room, log)
    (examined,) = _lhdmap("doctor", str(log))["logs"]
    assert examined["path"] == f"{tmp_path}/{SHOWN}.mcap"
    built = _lhdmap("build-map", str(log))
    assert built["map"] == f"{tmp_path}/{SHOWN}_map"
    folder = MapFolder.open(tmp_path / f"{NAME}_map")
    assert folder.changed_files() == []
    assert folder.info["sources"][0]["path"] == f"{tmp_path}/{SHOWN}.mcap"
    assert len(folder.diagnostics().stamp_ns) == built["scans_processed"]
    assert {"report.html", "recording.rrd", "cloud.ply", "trajectory.tum"} <= {
        path.name for path in folder.path.iterdir()
    }
    assert "M\\xfcller &lt;drive&gt;" in (folder.path / "report.html").read_text(encoding="utf-8")
    assert (folder.path / "recording.rrd").read_bytes()[:4] == b"RRF2"
    assert _lhdmap("pile", str(log))["folder"] == f"{tmp_path}/{SHOWN}_pile"


def test_a_name_that_is_refused_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["build-map", str(tmp_path / NAME)]) == 3
    assert f"{tmp_path}/{SHOWN}: no such file" in capsys.readouterr().err


@pytest.mark.parametrize("given", [".", "../drive/"])
def test_the_folder_that_one_is_in(room: Path, tmp_path: Path, given: str) -> None:
    folder = tmp_path / "drive"
    folder.mkdir()
    shutil.copy(room, folder / "drive_0.mcap")
    built = _lhdmap("build-map", given, cwd=folder)
    assert Path(built["map"]).resolve() == tmp_path / "drive_map"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["drive", "drive_map"]


def test_a_name_that_begins_with_a_dash(room: Path, tmp_path: Path) -> None:
    shutil.copy(room, tmp_path / "-x.mcap")
    command = [sys.executable, "-m", "lhdmap", "doctor", "--json", "--", "-x.mcap"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, check=True)
    assert json.loads(done.stdout)["logs"][0]["path"] == "-x.mcap"

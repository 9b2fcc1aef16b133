"""The map folder: partial until complete, never over another one, hashes that hold, clear errors."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from lhdmap import __version__
from lhdmap.errors import InputError, LhdmapWarning
from lhdmap.mapfolder import MapFolder, MapFolderWriter
from lhdmap.provenance import source_entry
from lhdmap.runfolder import RunInfo

from tests.report.synthetic import diagnostics, drive

EMPTY_SHA256 = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "drive.mcap"
    path.write_bytes(b"")
    return path


def write(target: Path, log: Path) -> Path:
    with MapFolderWriter(target) as folder:
        folder.write_trajectory(drive(40))
        folder.write_odometry(drive(40, scale=1.01))
        folder.write_diagnostics(diagnostics(drive(40)))
        counts = {"scans": np.int64(40), "share": float("nan")}
        return folder.complete(RunInfo([log], {"spacing_m": 0.5}, counts, ["late scans"]))


def test_complete_folder_reads_back(tmp_path: Path, log: Path) -> None:
    found = MapFolder.open(write(tmp_path / "map", log))
    assert found.path == tmp_path / "map"
    assert np.abs(found.trajectory().positions_m - drive(40).positions_m).max() <= 5.1e-7
    assert found.trajectory().stamps_ns.tolist() == drive(40).stamps_ns.tolist()
    assert found.odometry().positions_m[-1, 0] > found.trajectory().positions_m[-1, 0]
    back, wanted = found.diagnostics(), diagnostics(drive(40))
    assert back.stamp_ns.tolist() == wanted.stamp_ns.tolist()
    assert back.substitute == list(wanted.substitute)
    assert np.array_equal(back.information_along, wanted.information_along)
    assert back.degenerate.tolist() == wanted.degenerate.tolist()
    assert found.changed_files() == []


def test_map_json_says_where_the_map_came_from(tmp_path: Path, log: Path) -> None:
    info = json.loads((write(tmp_path / "map", log) / "map.json").read_text())
    assert info["format_version"] == 1
    assert info["software"] == {"name": "lhdmap", "version": __version__}
    assert info["sources"] == [{"path": str(log), "sha256": EMPTY_SHA256, "bytes": 0}]
    assert info["options"] == {"spacing_m": 0.5}
    assert info["counts"] == {"scans": 40, "share": None}
    assert info["warnings"] == ["late scans"]
    assert sorted(info["files"]) == ["diagnostics.parquet", "odometry.tum", "trajectory.tum"]
    assert {"map", "base_link"} <= info["frames"].keys()


def test_an_interrupted_run_keeps_what_it_had_under_a_partial_name(tmp_path: Path, log: Path) -> None:
    def interrupted() -> None:
        with MapFolderWriter(tmp_path / "map") as folder:
            folder.write_trajectory(drive(10))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [path.name for path in tmp_path.iterdir() if path.is_dir()] == ["map.partial"]
    assert (tmp_path / "map.partial" / "trajectory.tum").exists()
    with pytest.raises(InputError, match="interrupted before it was complete"):
        MapFolder.open(tmp_path / "map.partial")
    with pytest.warns(LhdmapWarning, match="left over from an interrupted run, is replaced"):
        assert write(tmp_path / "map", log).name == "map"
    assert not (tmp_path / "map.partial").exists()


def test_changed_and_missing_files_are_found(tmp_path: Path, log: Path) -> None:
    path = write(tmp_path / "map", log)
    (path / "odometry.tum").unlink()
    with (path / "trajectory.tum").open("a") as file:
        file.write("# changed\n")
    assert sorted(MapFolder.open(path).changed_files()) == ["odometry.tum", "trajectory.tum"]
    with pytest.raises(InputError, match=r"no odometry.tum"):
        MapFolder.open(path).odometry()


@pytest.mark.parametrize(
    ("text", "wanted"),
    [(None, "no map.json"), ("{", "not the description of a map"), ('{"format_version": 99}', "format version 99")],
)
def test_what_is_no_map_is_said(tmp_path: Path, text: str | None, wanted: str) -> None:
    folder = tmp_path / "x"
    folder.mkdir()
    if text is not None:
        (folder / "map.json").write_text(text)
    with pytest.raises(InputError, match=wanted):
        MapFolder.open(folder)


def test_damaged_diagnostics_are_an_error(tmp_path: Path, log: Path) -> None:
    path = write(tmp_path / "map", log)
    (path / "diagnostics.parquet").write_bytes(b"PAR1 and no more")
    with pytest.raises(InputError, match=r"diagnostics.parquet"):
        MapFolder.open(path).diagnostics()


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="cannot be made"):
        MapFolderWriter(tmp_path / "file" / "map")


def test_sources_may_be_folders_and_must_exist(tmp_path: Path, log: Path) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    (folder / "part_0.mcap").write_bytes(b"")
    assert source_entry(folder)["files"] == {"part_0.mcap": {"sha256": EMPTY_SHA256, "bytes": 0}}
    with pytest.raises(InputError, match="No such file"):
        source_entry(tmp_path / "none.mcap")

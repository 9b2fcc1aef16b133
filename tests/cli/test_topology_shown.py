"""What the commands show of a map's topology: `info` in a line, `route` and `view` in a picture."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from lhdmap.cli.main import main
from lhdmap.runfolder import RunFolderWriter, RunInfo
from lhdmap.topology.geojson import to_geojson
from lhdmap.topology.sheet import write_sheets

from tests.report.topologies import told, two_levels
from tests.topology.maps import ladder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    topology, sheets = two_levels()
    log = tmp_path / "drive.mcap"
    log.touch()
    with RunFolderWriter("map", tmp_path / "map") as writer:
        writer.write_json("topology.geojson", to_geojson(topology))
        writer.finished(write_sheets(writer.path / "free_space.npz", sheets))
        writer.complete(RunInfo([log], {}, {}, [], {}))
    return tmp_path / "map"


def test_info_has_a_line_on_the_topology(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(folder)]) == 0
    told_lines = capsys.readouterr().out.splitlines()
    assert "topology     5 tunnels, 3 intersections, 2 levels, 1 waypoint, 0 ends unexplored" in told_lines
    assert len(told_lines) <= 10


def test_info_survives_a_damaged_topology(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "topology.geojson").write_text("{}", encoding="utf-8")
    assert main(["info", str(folder)]) == 0
    assert "topology     not readable" in capsys.readouterr().out.splitlines()


@pytest.mark.parametrize(("ending", "start"), [("svg", b"<svg"), ("png", b"\x89PNG"), ("rrd", b"RRF2")])
def test_a_route_is_drawn_into_a_file(folder: Path, tmp_path: Path, ending: str, start: bytes) -> None:
    target = tmp_path / f"route.{ending}"
    assert main(["route", str(folder), "DP1", "T2", "--picture", str(target)]) == 0
    assert target.read_bytes().startswith(start)
    assert main(["route", str(folder), "DP1", "T2", "--picture", str(target)]) == 2
    assert main(["route", str(folder), "DP1", "T2", "--picture", str(target), "--force"]) == 0


def test_a_route_can_be_drawn_over_a_topology_alone(tmp_path: Path) -> None:
    file = tmp_path / "t.geojson"
    file.write_text(json.dumps(to_geojson(ladder())), encoding="utf-8")
    assert main(["route", str(file), "DP1", "T2", "--picture", str(tmp_path / "route.svg")]) == 0
    assert "DP1" in (tmp_path / "route.svg").read_text(encoding="utf-8")


def test_a_picture_of_an_unknown_kind_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["route", str(folder), "DP1", "T2", "--picture", "route.bmp"]) == 2
    assert ".svg, .png, .rrd" in capsys.readouterr().err


def test_no_route_no_picture(tmp_path: Path) -> None:
    file = tmp_path / "t.geojson"
    file.write_text(json.dumps(to_geojson(told())), encoding="utf-8")
    assert main(["route", str(file), "DP1", "T2", "--avoid", "I1", "--picture", str(tmp_path / "route.svg")]) == 1
    assert not (tmp_path / "route.svg").exists()


def test_a_topology_is_viewed_like_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "t.geojson"
    file.write_text("{}", encoding="utf-8")
    assert main(["view", str(file), "--screenshot", str(tmp_path / "s.png")]) == 3
    assert "not a topological map" in capsys.readouterr().err

"""`lhdmap export` as a person or a script calls it."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import pytest
from lhdmap.cli.main import main
from lhdmap.errors import LhdmapWarning
from lhdmap.exports.formats import FORMATS
from lhdmap.extras import is_installed

from tests.exports.folders import control_points, map_folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return map_folder(tmp_path / "drive.v2_map")


def told(capsys: pytest.CaptureFixture[str], *words: object, exit_code: int = 0) -> dict[str, Any]:
    assert main(["export", *map(str, words), "--json", "--quiet"]) == exit_code
    values: dict[str, Any] = json.loads(capsys.readouterr().out)
    return values


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_beside_the_map(folder: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    if name == "e57" and not is_installed("pye57"):
        pytest.skip("the extra e57 is not installed")
    values = told(capsys, folder, "--format", name)
    assert (values["format"], values["frame"], values["registration"]) == (name, "map", None)
    for file in map(Path, values["files"]):
        assert file.parent == folder.parent
        assert file.name.startswith("drive.v2_map")
        assert file.stat().st_size > 0
    before = sorted(path.name for path in folder.parent.iterdir())
    assert told(capsys, folder, "--format", name, exit_code=2)["error"]["kind"] == "usage"
    told(capsys, folder, "--format", name, "--force")
    assert sorted(path.name for path in folder.parent.iterdir()) == before  # and nothing partial


def test_the_registration_is_told(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points = control_points(tmp_path / "points.csv", {"B": (0.02, 0.0, 0.0)})
    values = told(capsys, folder, "--format", "dxf", "--control-points", points)
    assert values["frame"] == "mine_grid"
    member = values["registration"]
    assert member["rms_m"] < member["max_residual_m"] < member["max_leave_one_out_m"] < 0.05
    assert len(member["control_points"]) == 4
    assert main(["export", str(folder), "--format", "dxf", "--control-points", str(points), "--force"]) == 0
    text = capsys.readouterr().out
    assert "turned by 34.3" in text
    assert text.count("leave-one-out") == 5


def test_points_that_do_not_fit_end_with_1_and_their_figures(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    points = control_points(tmp_path / "points.csv", {"C": (0.3, 0.0, 0.0)})
    words = (folder, "--format", "dxf", "--control-points", points, "-o", tmp_path / "x.dxf")
    values = told(capsys, *words, exit_code=1)
    assert values["error"]["kind"] == "shortfall"
    assert "control point C" in values["error"]["message"]
    assert "without C the others fit within 0.000 m" in values["error"]["message"]
    assert max(values["registration"]["control_points"], key=lambda one: one["miss_m"])["name"] == "C"
    assert not (tmp_path / "x.dxf").exists()
    assert main(["export", *map(str, words)]) == 1
    assert "not written: control point C" in capsys.readouterr().out
    assert told(capsys, *words, "--tolerance", "0.5")["files"] == [str(tmp_path / "x.dxf")]


def test_another_scale_is_warned_of(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points = control_points(tmp_path / "points.csv", scale=1.003)
    with warnings.catch_warnings():
        warnings.simplefilter("default", LhdmapWarning)
        words = ["export", str(folder), "--format", "geojson", "--control-points", str(points), "--tolerance", "0.3"]
        assert main(words) == 0
    assert "warning: lengths" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "exit_code", "says"),
    [
        ("--format dfx", 2, "'dfx' is none of geojson, nav2-route"),
        ("", 2, "--format"),
        ("--format dxf -o x.ply", 2, "its suffix is .dxf"),
        ("--format dxf --frame mine_grid", 2, "--control-points FILE gives it one"),
        ("--format dxf --tolerance 0.2", 2, "--tolerance is about --control-points"),
        ("--format dxf --control-points none.csv", 3, "none.csv"),
        ("--format dxf --control-points none.csv --tolerance -1", 2, "more than 0 m"),
    ],
)
def test_wrong_calls(folder: Path, words: str, exit_code: int, says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert says in told(capsys, folder, *words.split(), exit_code=exit_code)["error"]["message"]


def test_what_is_no_map_and_a_map_of_before(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert told(capsys, tmp_path / "none", "--format", "dxf", exit_code=3)["error"]["kind"] == "input"
    old = map_folder(tmp_path / "old", plain=True)
    assert "topology.geojson" in told(capsys, old, "--format", "dxf", exit_code=3)["error"]["message"]
    points = control_points(tmp_path / "points.csv")
    assert told(capsys, old, "--format", "laz", "--control-points", points)["frame"] == "mine_grid"


def test_the_map_s_own_files_are_safe(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = (folder / "cloud.ply").read_bytes()
    words = (folder, "--format", "ply", "-o", folder / "cloud.ply", "--force")
    assert "is the input itself" in told(capsys, *words, exit_code=2)["error"]["message"]
    assert (folder / "cloud.ply").read_bytes() == before


def test_a_damaged_topology_is_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "topology.geojson").write_text('{"type": "FeatureCollection", "lhdmap": {}, "features": [{}]}')
    assert "damaged" in told(capsys, folder, "--format", "graphml", exit_code=3)["error"]["message"]

"""A new version of a map: what it has, what it keeps of the old one, and what stops it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from lhdmap.cli.main import main
from lhdmap.errors import InputError, UsageError
from lhdmap.mapfolder import MapFolder
from lhdmap.pipeline import update, update_files
from lhdmap.pipeline.update import UpdateRequest, update_map
from lhdmap.topology.files import read_topology
from lhdmap.topology.views_file import read_views

from tests.update.conftest import Updated
from tests.update.drives import BRANCH_M, DEEP_M, first_way, mine, second_way, write_drive


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_the_new_tunnel_is_there_and_where_it_is(updated: Updated) -> None:
    found = read_topology(updated.result.folder)
    assert updated.result.version == found.version == 2
    (node,) = found.intersections
    assert node.degree == 3
    assert node.pose_map_node[:2] == pytest.approx([BRANCH_M - 0.5, 0.0], abs=0.6)  # base_link began at x = 0.5
    (new,) = (one for one in found.tunnels if one.name in updated.result.difference["tunnels_new"])
    assert new.line_m[:, 1].min() < -0.6 * DEEP_M
    assert np.median(np.abs(new.line_m[:, 0] - BRANCH_M + 0.5)) < 0.3


def test_names_stay_and_are_not_given_twice(updated: Updated) -> None:
    before, now = (read_topology(path) for path in (updated.before, updated.result.folder))
    (old,) = before.waypoints
    (same,) = (one for one in now.waypoints if one.name == old.name)
    assert np.hypot(*(same.pose - old.pose)[:2]) < 1.0
    names = [one.name for one in now.waypoints] + [one.name for one in now.nodes.values()]
    assert len(set(names)) == len(names)


def test_the_walls_that_went_are_told(updated: Updated) -> None:
    (level,) = updated.result.difference["walls"]
    assert level["went_m2"] > 0.3
    assert level["came_m2"] < 0.3
    assert level["went_at_m"] == pytest.approx([BRANCH_M - 0.5, -2.25], abs=1.5)
    assert updated.result.difference == MapFolder.open(updated.result.folder).json("difference.json")


def test_the_second_drive_lies_where_it_was_driven(updated: Updated) -> None:
    old, new = (MapFolder.open(path).trajectory() for path in (updated.before, updated.result.folder))
    later = new.stamps_ns > old.stamps_ns[-1]
    assert (np.diff(new.stamps_ns) > 0).all()
    assert (new.positions_m[~later] == old.positions_m).all()  # the map itself stays
    true = second_way()[-1, :2] - first_way()[0, :2]
    assert new.positions_m[later][-1, :2] == pytest.approx(true, abs=0.25)


def test_views_and_counts_are_of_both_drives(updated: Updated) -> None:
    old, new = MapFolder.open(updated.before), MapFolder.open(updated.result.folder)
    assert len(read_views(new.file("views.npz"))) > len(read_views(old.file("views.npz")))
    counts = new.info["counts"]
    assert counts["scans"] == len(new.trajectory().stamps_ns)
    driven = sum(float(np.hypot(*np.diff(way[:, :2], axis=0).T).sum()) for way in (first_way(), second_way()))
    assert counts["distance_m"] == pytest.approx(driven, rel=0.02)
    assert new.info["previous"]["version"] == 1
    assert [Path(one["path"]).name for one in new.info["earlier_sources"]] == ["first.mcap"]


def test_page_and_recording_are_those_of_a_map(updated: Updated) -> None:
    folder = updated.result.folder
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "What is different" in page
    assert "new tunnel" in page
    assert "<h2>Topology</h2>" in page
    assert (folder / "recording.rrd").stat().st_size > 10_000
    assert (
        "wall went" in (folder / "difference.svg").read_text(encoding="utf-8")
        or (folder / "difference.svg").stat().st_size > 5_000
    )


@pytest.mark.parametrize(
    "words",
    [
        ["info"],
        ["check-map", "--json"],
        ["export", "--format", "geojson", "-o", "OUT.geojson"],
        ["route", "T1.1", "T2"],
    ],
)
def test_other_commands_work_on_it(
    updated: Updated, words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, *more = [word.replace("OUT", str(tmp_path / "out")) for word in words]
    assert main([name, str(updated.result.folder), *more]) in (0, 1)
    assert "fault" not in capsys.readouterr().err


def test_the_command_says_what_is_different_and_finds_the_next_name(
    drift_map: Path, branch_log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(drift_map, tmp_path / "mine_map")
    before = contents(tmp_path / "mine_map")
    assert main(["update-map", str(tmp_path / "mine_map"), str(branch_log), "--json", "--start", "0,0,0"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert Path(found["map"]) == tmp_path / "mine_map_v2"
    assert found["version"] == 2
    assert found["difference"]["tunnels_new"]
    assert contents(tmp_path / "mine_map") == before


def test_the_old_map_as_target_is_refused(drift_map: Path, branch_log: Path) -> None:
    before = contents(drift_map)
    with pytest.raises(UsageError, match="folder of its own"):
        update_map(UpdateRequest(drift_map, [branch_log], drift_map, force=True))
    assert contents(drift_map) == before


def test_a_drive_elsewhere_is_refused(drift_map: Path, tmp_path: Path) -> None:
    before = contents(drift_map)
    log = write_drive(tmp_path / "other.mcap", mine(branch=True, seed=77), second_way(), 3)
    with pytest.raises(InputError, match=r"other\.mcap.*(nowhere|do not fit)"):
        update_map(UpdateRequest(drift_map, [log], tmp_path / "v2"))
    assert contents(drift_map) == before
    assert not list(tmp_path.glob("v2*"))


@pytest.mark.parametrize("moment", ["placings", "topology_of", "write_report"])
def test_an_interrupted_update_leaves_the_old_map_whole(
    moment: str, drift_map: Path, branch_log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    before = contents(drift_map)
    monkeypatch.setattr(update_files if moment == "write_report" else update, moment, interrupted)
    with pytest.raises(KeyboardInterrupt):
        update_map(UpdateRequest(drift_map, [branch_log], tmp_path / "v2"))
    assert contents(drift_map) == before
    assert not (tmp_path / "v2").exists()


def test_what_the_drive_alone_came_to_is_not_kept(
    drift_map: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A log that ends in an error within its own map: the scratch folder is gone, and nobody is sent there."""
    monkeypatch.setenv("TMPDIR", str(tmp_path / "scratch"))
    monkeypatch.setattr("tempfile.tempdir", None)
    (tmp_path / "scratch").mkdir()

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("lhdmap.pipeline.build.write_cloud", interrupted)
    log = write_drive(tmp_path / "second.mcap", mine(branch=True), second_way(), 2)
    assert main(["update-map", str(drift_map), str(log), "-o", str(tmp_path / "v2")]) == 4
    assert "kept" not in capsys.readouterr().err
    assert not list((tmp_path / "scratch").iterdir())


@pytest.mark.parametrize("harm", ["gone", "damaged"])
@pytest.mark.parametrize("name", ["views.npz", "free_space.npz", "topology.geojson", "cloud.ply"])
def test_a_map_that_lacks_something_says_what_to_do(
    harm: str, name: str, drift_map: Path, branch_log: Path, tmp_path: Path
) -> None:
    broken = tmp_path / "mine_map"
    shutil.copytree(drift_map, broken)
    if harm == "gone":
        (broken / name).unlink()
    else:
        (broken / name).write_bytes(b"PK\x03\x04 nothing that can be read" * 3)
    with pytest.raises(InputError, match=name.replace(".", r"\.")) as told:
        update_map(UpdateRequest(broken, [branch_log], tmp_path / "v2"))
    assert str(told.value).count("\n") < 2
    assert not list(tmp_path.glob("v2*"))


@pytest.mark.parametrize(("start", "said"), [("1,two,3", "three numbers"), ("Nowhere", "no waypoint")])
def test_a_start_that_is_none_is_told(
    start: str, said: str, drift_map: Path, branch_log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["update-map", str(drift_map), str(branch_log), "-o", str(tmp_path / "v2"), "--start", start]
    assert main(words) == 2
    assert said in capsys.readouterr().err


def test_a_drive_with_the_times_of_the_map_is_put_behind_it(drift_map: Path, tmp_path: Path) -> None:
    """Two simulated logs begin at the same time; each time has one pose all the same, and it can be updated again."""
    log = write_drive(tmp_path / "again.mcap", mine(branch=True), second_way(), 1)
    first = update_map(UpdateRequest(drift_map, [log], tmp_path / "v2"))
    assert any("later" in text for text in first.warnings)
    stamps = MapFolder.open(first.folder).trajectory().stamps_ns
    assert (np.diff(stamps) > 0).all()
    again = update_map(UpdateRequest(first.folder, [log], tmp_path / "v3"))
    assert again.version == 3
    assert again.difference["tunnels_new"] == again.difference["tunnels_gone"] == []
    assert sum(one["came_m2"] + one["went_m2"] for one in again.difference["walls"]) < 0.3

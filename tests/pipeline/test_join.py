"""Several drives through one mine as one map: both orders, a part in common, another mine, a log that pauses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from lhdmap.cli.main import main
from lhdmap.errors import InputError
from lhdmap.geometry import se2
from lhdmap.logs.writer import LogWriter
from lhdmap.mapfolder import MapFolder
from lhdmap.messages import FloatArray
from lhdmap.pipeline.build import BuildRequest
from lhdmap.pipeline.join import build_drives
from lhdmap.simulation.planar import PlanarScanner, simulate_scans, world_from_polylines
from lhdmap.topology.files import read_topology

from tests.update.drives import BRANCH_M, DEEP_M, RATE_HZ, first_way, mine, north_way, write_drive

LEAST_KEYS = {"map", "scans", "scans_processed", "duration_s", "distance_m", "degenerate_share", "closures", "pile"}


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder, world = tmp_path_factory.mktemp("drives"), mine(branch=True)
    return write_drive(folder / "east.mcap", world, first_way(), 1), write_drive(
        folder / "north.mcap", world, north_way(), 2
    )


@pytest.fixture(scope="module")
def joined(logs: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_drives(BuildRequest(list(logs), tmp_path_factory.mktemp("joined") / "map")).folder


def errors(folder: Path, first: FloatArray, second: FloatArray) -> FloatArray:
    """Return how far (M,) the second drive is off, by its truth in the frame of the first one's start; its scans come last."""
    found = MapFolder.open(folder).trajectory().positions_m[-len(second) :, :2]
    T_map_world = se2.inverse(first[0])
    true = np.array([se2.compose(T_map_world, pose) for pose in second])[:, :2]
    off: FloatArray = np.linalg.norm(found - true, axis=1)
    return off


def test_the_second_drive_lies_where_it_was_driven(joined: Path) -> None:
    assert errors(joined, first_way(), north_way()).max() < 0.3


def test_the_map_is_of_both(joined: Path) -> None:
    topology = read_topology(joined)
    (node,) = topology.intersections
    assert node.degree == 3
    assert node.pose_map_node[:2] == pytest.approx([BRANCH_M - 0.5, 0.0], abs=0.6)
    assert min(tunnel.line_m[:, 1].min() for tunnel in topology.tunnels) < -0.6 * DEEP_M
    assert topology.version == 1


def test_the_folder_is_that_of_a_map(joined: Path, logs: tuple[Path, Path]) -> None:
    folder = MapFolder.open(joined)
    assert [Path(one["path"]).name for one in folder.info["sources"]] == [log.name for log in logs]
    counts = folder.info["counts"]
    assert counts["drives"] == 2
    assert counts["scans"] == len(folder.trajectory().stamps_ns) == len(folder.odometry().stamps_ns)
    assert counts["tied"][0] > 10
    assert (np.diff(folder.trajectory().stamps_ns) > 0).all()
    names = {"trajectory.tum", "odometry.tum", "diagnostics.parquet", "cloud.ply", "topology.geojson", "landmarks.npz"}
    assert {one.name for one in joined.iterdir()} >= names | {
        "views.npz",
        "free_space.npz",
        "recording.rrd",
        "report.html",
    }


@pytest.mark.parametrize("words", [["info"], ["check-map", "--json"], ["export", "--format", "geojson", "-o", "OUT"]])
def test_other_commands_read_it(
    joined: Path, words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, *more = [word.replace("OUT", str(tmp_path / "out.geojson")) for word in words]
    assert main([name, str(joined), *more]) in (0, 1)
    assert "fault" not in capsys.readouterr().err


def test_the_other_order_gives_the_other_frame(
    logs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By the command, one JSON object on standard output; north.mcap was driven later, its frame is the map's nevertheless."""
    assert main(["build-map", str(logs[1]), str(logs[0]), "-o", str(tmp_path / "map"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told.keys() >= LEAST_KEYS | {"drives", "tied"}
    trajectory = MapFolder.open(tmp_path / "map").trajectory()
    later = trajectory.positions_m[-len(north_way()) :, :2]
    assert later[0] == pytest.approx([0.0, 0.0], abs=0.15)
    T_map_world = se2.inverse(north_way()[0])
    true = se2.compose(T_map_world, first_way()[-1])[:2]
    row = len(trajectory.stamps_ns) - len(north_way()) - 11  # each log begins with ten scans at rest
    assert trajectory.positions_m[row, :2] == pytest.approx(true, abs=0.35)


def test_another_mine_is_refused_with_both_names(logs: tuple[Path, Path], tmp_path: Path) -> None:
    other = write_drive(tmp_path / "other.mcap", mine(branch=True, seed=77), north_way(), 3)
    with pytest.raises(InputError, match=r"other\.mcap.*east\.mcap"):
        build_drives(BuildRequest([logs[0], other], tmp_path / "map"))
    assert not list(tmp_path.glob("map*"))


def write_with_pause(path: Path, first: FloatArray, second: FloatArray, *, other: int | None = None) -> Path:
    """A log of one drive, a pause of a minute, and another one; `other`: the second is in another mine of this seed."""
    with LogWriter(path) as writer:
        for world, way, at_s in (
            (mine(branch=True), first, 0.0),
            (mine(branch=True, seed=other or 4), second, 100.0),
        ):
            for scan in simulate_scans(world, way, PlanarScanner(270.0, max_range_m=30.0), RATE_HZ, 5):
                writer.write("/lidar/front/scan", scan._replace(stamp_ns=scan.stamp_ns + round(at_s * 1e9)))
    return path


def test_a_log_in_which_the_machine_was_moved_is_one_map(tmp_path: Path) -> None:
    log = write_with_pause(tmp_path / "moved.mcap", first_way(), north_way())
    result = build_drives(BuildRequest([log], tmp_path / "map"))
    assert result.summary["drives"] == 2
    assert errors(result.folder, first_way(), north_way()).max() < 0.3
    assert [Path(one["path"]).name for one in MapFolder.open(result.folder).info["sources"]] == ["moved.mcap"]


def test_a_log_whose_parts_cannot_be_joined_is_one_drive_with_a_warning(tmp_path: Path) -> None:
    log = write_with_pause(tmp_path / "moved.mcap", first_way()[:200], north_way()[:200], other=77)
    result = build_drives(BuildRequest([log], tmp_path / "map"))
    assert "drives" not in result.summary
    assert any("seems to be in another place" in text for text in result.warnings)


def test_where_two_places_look_alike_nothing_is_joined(tmp_path: Path) -> None:
    """A drift whose walls repeat each 30 m: a second drive over 24 m of it may be in one place or the other."""
    rng = np.random.default_rng(6)
    waves, phases = rng.integers(2, 40, 30), rng.uniform(0.0, 2.0 * np.pi, (2, 30))
    x = np.arange(-60.0, 130.0, 0.05)
    rough = [np.sin(2.0 * np.pi * waves * x[:, None] / 30.0 + one).sum(axis=1) * 0.12 / np.sqrt(15.0) for one in phases]
    walls = [np.column_stack([x, side * 2.2 + noise]) for side, noise in zip((1.0, -1.0), rough, strict=True)]
    world = world_from_polylines(walls, np.zeros((1, 3)))
    ways = [
        np.column_stack([at, np.zeros((len(at), 2))])
        for at in (np.arange(0.0, 75.0, 0.15), np.arange(33.0, 57.0, 0.15))
    ]
    logs = [write_drive(tmp_path / f"{k}.mcap", world, way, k) for k, way in enumerate(ways, 1)]
    with pytest.raises(InputError, match=r"2\.mcap.*1\.mcap.*two places"):
        build_drives(BuildRequest(logs, tmp_path / "map"))

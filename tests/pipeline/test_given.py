"""Given poses: whatever the order of the file, by rising time, heading without jumps; clear errors."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.geometry import se3
from lhdmap.integration.cloud_io import read_cloud
from lhdmap.logs.source import LogSource
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import LaserScan, Mount, Tachometer
from lhdmap.pipeline.build import BuildRequest, build_map
from lhdmap.pipeline.given import GROUND_TRUTH, given_rows
from lhdmap.provenance import sha256_of
from lhdmap.simulation.drive import SimulatedDrive
from lhdmap.trajectory import Trajectory, write_tum

START_NS = 1_700_000_000_123_456_789


def test_poses_of_a_shuffled_file_come_by_rising_time(tmp_path: Path) -> None:
    heading = np.linspace(3.0, 3.4, 9)  # across the wrap at pi
    stamps = START_NS + 40_000_000 * np.arange(9, dtype=np.int64)
    positions = np.column_stack([np.arange(9.0), -np.arange(9.0), 0.1 * np.arange(9.0)])
    quaternions = se3.quaternions_from_rpy(np.full(9, 0.01), np.full(9, -0.02), heading)
    order = np.array([4, 0, 8, 1, 7, 2, 6, 3, 5, 4])  # one of them twice
    path = tmp_path / "given.tum"
    write_tum(path, Trajectory(stamps[order], positions[order], quaternions[order]))
    rows = given_rows(str(path), [], {})
    assert rows.times_ns.tolist() == stamps.tolist()
    np.testing.assert_allclose(rows.poses[:, :3], positions, atol=1e-6)
    np.testing.assert_allclose(rows.poses[:, 5], heading, atol=1e-6)
    np.testing.assert_allclose(rows.poses[:, 3:5], np.tile([0.01, -0.02], (9, 1)), atol=1e-6)


def test_a_log_without_truth_says_so(tmp_path: Path) -> None:
    log = tmp_path / "scans.mcap"
    with LogWriter(log) as writer:
        writer.write("/scan", LaserScan(START_NS, "laser", -1.0, 0.1, 0.0, 0.1, 50.0, np.full(21, 5.0, np.float32)))
    with pytest.raises(InputError, match="no ground-truth topic"):
        given_rows(GROUND_TRUTH, [log], {})


def _moved(drive: SimulatedDrive, path: Path, by_ns: int = 0, by_m: float = 0.0, keep: slice = slice(None)) -> str:
    truth = drive.truth
    places = truth.positions_m[keep] + by_m
    write_tum(path, Trajectory(truth.stamps_ns[keep] + by_ns, places, truth.quaternions_xyzw[keep]))
    return str(path)


def test_poses_of_another_time_are_refused(drive: SimulatedDrive, tmp_path: Path) -> None:
    poses = _moved(drive, tmp_path / "late.tum", by_ns=3600 * 10**9)
    with pytest.raises(InputError, match=r"none has a pose"):
        build_map(BuildRequest([drive.log], tmp_path / "map", poses=poses))
    assert (tmp_path / "map.partial" / "odometry.tum").exists()  # what was finished is kept


def test_poses_in_a_mine_s_grid_are_refused(drive: SimulatedDrive, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="subtract an offset"):
        given_rows(_moved(drive, tmp_path / "utm.tum", by_m=453_000.0), [], {})


def test_holes_between_poses_are_told_and_the_map_says_what_it_was_made_of(
    drive: SimulatedDrive, tmp_path: Path
) -> None:
    poses = _moved(drive, tmp_path / "ends.tum", keep=slice(None, None, len(drive.truth.stamps_ns) - 1))
    found = build_map(BuildRequest([drive.log], tmp_path / "map", poses=poses))
    assert any("1 hole(s)" in text for text in found.warnings)
    info = json.loads((found.folder / "map.json").read_text(encoding="utf-8"))
    assert info["options"]["request"]["poses"] == poses
    assert info["options"]["request"]["poses_file"]["sha256"] == sha256_of(Path(poses))
    assert "given poses" in info["frames"]["map"]


def test_a_sweep_that_cannot_be_is_left_out_with_given_poses_too(drive: SimulatedDrive, tmp_path: Path) -> None:
    """The time of a scan given for that of a beam: each sweep was smeared over fifteen seconds of the path."""
    points = []
    for name, increment_s in (("none", 0.0), ("wrong", 0.04)):
        with LogSource([drive.log]) as source, LogWriter(tmp_path / f"{name}.mcap") as writer:
            for role, message in source.messages(["front", "tf_static", "ground_truth"]):
                if isinstance(message, LaserScan):
                    message = message._replace(time_increment_s=increment_s)
                writer.write(source.roles[role], [message] if isinstance(message, Mount) else message)
        found = build_map(BuildRequest([tmp_path / f"{name}.mcap"], tmp_path / name, poses=GROUND_TRUTH))
        points.append(read_cloud(found.folder / "cloud.ply").points_m)
    assert points[0] == pytest.approx(points[1])


def _with_fast_wheels(drive: SimulatedDrive, path: Path, leave_out: tuple[str, ...] = ()) -> Path:
    """Write the drive's log with a tachometer in km/h."""
    with LogSource([drive.log]) as source, LogWriter(path) as writer:
        for role, message in source.messages([role for role in source.roles if role not in leave_out]):
            if isinstance(message, Tachometer):
                message = message._replace(speed_mps=3.6 * message.speed_mps)
            writer.write(source.roles[role], [message] if isinstance(message, Mount) else message)
    return path


def test_with_given_poses_nothing_is_said_of_what_took_no_part(drive: SimulatedDrive, tmp_path: Path) -> None:
    """Wheels that contradict the scans are a warning of the odometry, not of a map whose poses were given."""
    log = _with_fast_wheels(drive, tmp_path / "fast.mcap")
    own = build_map(BuildRequest([log], tmp_path / "own"))
    assert any("wheels:" in text for text in own.warnings)
    given = build_map(BuildRequest([log], tmp_path / "given", poses=GROUND_TRUTH))
    assert not any("wheels" in text or "odometry" in text for text in given.warnings)
    assert given.summary["poses"] == GROUND_TRUTH
    assert given.summary["degenerate_share"] is None
    assert (given.summary["closures"], given.summary["lost_stretches"]) == (0, 0)
    page = re.sub(r"<pre>.*?</pre>", "", (given.folder / "report.html").read_text(encoding="utf-8"), flags=re.DOTALL)
    assert "path and map are made from ground-truth" in page
    for words in ("weak scans", "lost stretches", "loop closures", "Speed and slip", "used as tachometer"):
        assert words not in page
    assert "used as ground_truth" in page
    assert own.summary["poses"] is None


def test_given_poses_tell_roll_and_pitch_where_there_is_no_inclinometer(drive: SimulatedDrive, tmp_path: Path) -> None:
    log = _with_fast_wheels(drive, tmp_path / "flat.mcap", leave_out=("inclinometer",))
    given = build_map(BuildRequest([log], tmp_path / "given", poses=GROUND_TRUTH))
    assert given.summary["pile"] is not None
    assert (given.folder / "pile.json").exists()
    assert not any("inclinometer" in text for text in given.warnings)

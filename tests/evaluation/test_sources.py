"""Where trajectories come from: files of each kind, and clear errors for what is none."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError, LhdmapWarning
from lhdmap.evaluation.sources import load_estimate, load_truth
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import GroundTruth, LaserScan
from lhdmap.trajectory import write_tum

from tests.evaluation.paths import straight, wandering

LINE = "ROBOTLASER1 0 -1.57 3.14 1.57 50.0 0.1 0 3 1.0 2.0 3.0 {remissions} 9 9 9 {pose} 0 0 0 0 0 {stamp} host 0.5\n"


def scan(stamp_ns: int) -> LaserScan:
    return LaserScan(stamp_ns, "lidar_front", -1.0, 0.1, 0.0, 0.1, 30.0, np.ones(21, np.float32))


def test_map_folder_gives_its_final_trajectory_or_its_odometry(tmp_path: Path) -> None:
    write_tum(tmp_path / "trajectory.tum", straight(1.0))
    write_tum(tmp_path / "odometry.tum", straight(2.0))
    assert len(load_estimate(tmp_path).stamps_ns) == 21
    assert len(load_estimate(tmp_path, odometry=True).stamps_ns) == 41
    assert len(load_truth(tmp_path).stamps_ns) == 21


def test_ground_truth_of_a_log(tmp_path: Path) -> None:
    truth = wandering(0, poses=50)
    with LogWriter(tmp_path / "drive.mcap") as log:
        for stamp, position, quaternion in zip(*truth, strict=True):
            log.write("/lidar/front/scan", scan(int(stamp)))
            log.write("/ground_truth/odometry", GroundTruth(int(stamp), position, quaternion))
    found = load_truth(tmp_path / "drive.mcap")
    assert found.stamps_ns.tolist() == truth.stamps_ns.tolist()
    assert np.array_equal(found.positions_m, truth.positions_m)
    assert np.abs(found.quaternions_xyzw - truth.quaternions_xyzw).max() < 1e-15


def test_a_log_without_truth_is_an_error(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "drive.mcap") as log:
        log.write("/lidar/front/scan", scan(10**9))
    with pytest.raises(InputError, match=r"drive.mcap: no ground truth in it; .*/ground_truth/odometry"):
        load_truth(tmp_path / "drive.mcap")


@pytest.mark.parametrize("remissions", ["0", "2 7.0 8.0"])
def test_robot_pose_and_stamp_of_a_corrected_carmen_log(tmp_path: Path, remissions: str) -> None:
    lines = "VERTEX2 0 9 9 9\n" + "".join(
        LINE.format(remissions=remissions, pose=f"{i} 2.0 0.5", stamp=f"976053557.76736{i}") for i in range(3)
    )
    with gzip.open(tmp_path / "corrected.log.gz", "wt") as file:
        file.write(lines)
    found = load_truth(tmp_path / "corrected.log.gz")
    assert found.stamps_ns.tolist() == [976053557767360000 + 1000 * i for i in range(3)]
    assert found.positions_m.tolist() == [[0, 2, 0], [1, 2, 0], [2, 2, 0]]
    assert found.quaternions_xyzw[0] == pytest.approx([0, 0, np.sin(0.25), np.cos(0.25)])


def test_poses_without_a_graph_may_be_the_wheels(tmp_path: Path) -> None:
    (tmp_path / "raw.log").write_text(LINE.format(remissions="0", pose="1.0 2.0 0.5", stamp="1.5") * 2)
    with pytest.warns(LhdmapWarning, match="may be those of the wheels"):
        assert len(load_truth(tmp_path / "raw.log").stamps_ns) == 2


def test_broken_corrected_logs_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text("PARAM x 1\nROBOTLASER1 0 -1.57 3.14 1.57 50.0 0.1 0 500 1.0 2.0\n")
    with pytest.raises(InputError, match=r"a.log, line 2: .*ROBOTLASER1"):
        load_truth(tmp_path / "a.log")
    (tmp_path / "b.log").write_text("FLASER 1 1.0 0 0 0 0 0 0 1.0 host 1.0\n")
    with pytest.raises(InputError, match="no ROBOTLASER1 line"):
        load_truth(tmp_path / "b.log")
    (tmp_path / "c.log.gz").write_bytes(b"this is not gzip")
    with pytest.raises(InputError, match=r"c.log.gz"):
        load_truth(tmp_path / "c.log.gz")


def test_missing_files_are_errors(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        load_estimate(tmp_path / "none.tum")
    with pytest.raises(InputError, match=r"trajectory.tum was wanted"):
        load_estimate(tmp_path)

"""Given poses: whatever the order of the file, by rising time, heading without jumps; clear errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.geometry import se3
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import LaserScan
from lhdmap.pipeline.given import GROUND_TRUTH, given_rows
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

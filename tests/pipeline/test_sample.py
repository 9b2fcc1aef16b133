"""The real log that ships: its map is built, its path is as long as the wheels say."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from lhdmap.logs.source import LogSource
from lhdmap.messages import WheelPose
from lhdmap.pipeline.build import BuildRequest, build_map

SAMPLES = Path(__file__).resolve().parents[2] / "datasets" / "samples"
LOG = SAMPLES / "ual_vehicle_50s.mcap"


def test_the_sample_is_small_and_the_one_described() -> None:
    assert LOG.stat().st_size < 1_000_000
    assert hashlib.sha256(LOG.read_bytes()).hexdigest() in (SAMPLES / "README.md").read_text(encoding="utf-8")


def test_its_map_is_built(tmp_path: Path) -> None:
    found = build_map(BuildRequest([LOG], tmp_path / "map"))
    with LogSource([LOG]) as source:
        poses = [m for _, m in source.messages(["wheel_odometry"]) if isinstance(m, WheelPose)]
    steps = np.hypot(np.diff([pose.x_m for pose in poses]), np.diff([pose.y_m for pose in poses]))
    assert found.summary["lost_stretches"] == 0
    assert found.summary["distance_m"] == pytest.approx(float(steps.sum()), rel=0.03)
    assert (found.folder / "cloud.ply").stat().st_size > 10_000

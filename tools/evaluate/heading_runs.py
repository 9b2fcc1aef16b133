"""Long drives (`heading_drives`) run through the pipeline once and kept: paths, key scans, what the gyroscope said."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from lhdmap.config import settings_from
from lhdmap.geometry import se3
from lhdmap.logs.source import LogSource
from lhdmap.messages import FloatArray, GroundTruth, LaserScan, PointCloud
from lhdmap.pipeline.inputs import ROLES_READ
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.mounts import machine_of
from lhdmap.pipeline.track import TrackRows, resample

from tools.evaluate.heading_drives import drive_of

_SETTINGS = {"pile.method": "off", "topology.method": "off"}


class Driven(NamedTuple):
    """What is kept of a drive: paths at the processed scans by odometry, realigned, and true, key scans, the gyroscope's turn."""

    odometry: TrackRows
    final: TrackRows
    truth: TrackRows
    keys: Any
    gyro: FloatArray


class _Pipeline(MappingPipeline):
    """The pipeline without the cloud."""

    def _hold(self, role: str, time_ns: int, sweep: LaserScan | PointCloud) -> None:
        pass


def driven(log: Path, changes: dict[str, Any] | None = None) -> Driven:
    """Run a log through the pipeline."""
    truth: list[GroundTruth] = []
    settings = settings_from(_SETTINGS | (changes or {}))
    with LogSource([log], {}) as source, _Pipeline(settings, machine_of(source, None)) as pipeline:
        for role, message in source.messages([*(r for r in ROLES_READ if r in source.roles), "ground_truth"]):
            if isinstance(message, GroundTruth):
                truth.append(message)
            else:
                pipeline.update(role, message)
        pipeline.finish()
    odometry = pipeline.track.rows()
    rpy = se3.rpy_from_quaternions(np.array([one.quaternion_xyzw for one in truth]))
    rpy[:, 2] = np.unwrap(rpy[:, 2])
    true = TrackRows(
        np.array([one.stamp_ns for one in truth], dtype=np.int64),
        np.column_stack([np.array([one.position_m for one in truth]), rpy]),
    )
    keys = [key._replace(points=key.points[:0]) for key in pipeline.evidence.smoother.keys.keys]
    times = odometry.times_ns
    return Driven(odometry, pipeline.path.final.rows(), resample(true, times), keys, pipeline.evidence.turns.at(times))


def kept(seed: int, folder: Path, length_m: float) -> Driven:
    """Return a drive, run where the folder does not have it."""
    log = drive_of(seed, folder, length_m)
    file = log.with_suffix(".pickle")
    if not file.is_file():
        file.write_bytes(pickle.dumps(driven(log)))
    found = pickle.loads(file.read_bytes())  # noqa: S301
    assert isinstance(found, Driven)
    return found

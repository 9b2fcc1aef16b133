"""References of the real logs: relations of the Freiburg benchmark, steps between corrected key scans; and what is scored."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lhdmap.config import load_settings
from lhdmap.evaluation.association import nearest_rows
from lhdmap.evaluation.relations import evaluate_relations, read_relations
from lhdmap.evaluation.sources import read_corrected_carmen
from lhdmap.geometry import se2, se3
from lhdmap.logs.source import LogSource
from lhdmap.messages import FloatArray, LaserScan, WheelPose
from lhdmap.pipeline.mapping import MappingPipeline, feed
from lhdmap.pipeline.track import TrackRows, resample, trajectory_of
from lhdmap.trajectory import Trajectory

_TOLERANCE_NS = 2_000_000


class Score(NamedTuple):
    """Mean errors of one trajectory against a reference, over `n` relations or steps."""

    translation_m: float
    rotation_deg: float
    n: int


def planar(trajectory: Trajectory) -> FloatArray:
    """Return x, y, heading (N, 3)."""
    heading = se3.rpy_from_quaternions(trajectory.quaternions_xyzw)[:, 2]
    return np.column_stack([trajectory.positions_m[:, :2], heading])


def against_relations(estimate: Trajectory, reference: Path) -> Score:
    """Score relations at most 60 s apart."""
    groups = {group.name: group for group in evaluate_relations(estimate, read_relations(reference)).groups}
    near = groups["up_to_60_s"]
    assert near.translation_m is not None
    assert near.rotation_deg is not None
    return Score(near.translation_m.mean, near.rotation_deg.mean, near.n)


def against_steps(estimate: Trajectory, reference: Path) -> Score:
    """Score the steps between consecutive corrected key scans."""
    truth = read_corrected_carmen(reference)
    rows = nearest_rows(estimate.stamps_ns, truth.stamps_ns)
    kept = np.abs(estimate.stamps_ns[rows] - truth.stamps_ns) <= _TOLERANCE_NS
    true, found = planar(truth), planar(estimate)[rows]
    errors = np.array(
        [
            se2.between(se2.between(true[k], true[k + 1]), se2.between(found[k], found[k + 1]))
            for k in range(len(true) - 1)
            if kept[k] and kept[k + 1]
        ]
    )
    degrees = np.degrees(np.abs(errors[:, 2]))
    return Score(float(np.hypot(errors[:, 0], errors[:, 1]).mean()), float(degrees.mean()), len(errors))


SCORES: dict[str, Callable[[Trajectory, Path], Score]] = {".relations": against_relations, ".log": against_steps}


def scans_alone(log: Path) -> Trajectory:
    """Return the trajectory of the pipeline that is not shown the wheels; nothing is integrated."""
    pipeline = MappingPipeline(load_settings())
    with LogSource([log]) as source:
        wanted = [role for role in ("front", "inclinometer", "tf_static") if role in source.roles]
        feed(pipeline, source.messages(wanted))
    records = pipeline.records
    rows = resample(pipeline.track.rows(), records.times_ns)
    return trajectory_of(rows, records.stamps_ns)


def wheels_alone(log: Path) -> Trajectory | None:
    """Return the wheels' own poses at the scans' stamps, or None where the log has none."""
    wheels: dict[int, tuple[float, float, float]] = {}
    stamps = []
    with LogSource([log]) as source:
        for _, message in source.messages([r for r in ("front", "wheel_odometry") if r in source.roles]):
            if isinstance(message, WheelPose):
                wheels[message.stamp_ns] = (message.x_m, message.y_m, message.heading_rad)
            elif isinstance(message, LaserScan):
                stamps.append(message.stamp_ns)
    if not wheels:
        return None
    times = np.array(sorted(wheels), dtype=np.int64)
    poses = np.array([wheels[int(t)] for t in times])
    table = np.zeros((len(times), 6))
    table[:, [0, 1]], table[:, 5] = poses[:, :2], np.unwrap(poses[:, 2])
    scans = np.array(stamps, dtype=np.int64)
    return trajectory_of(resample(TrackRows(times, table), scans), scans)

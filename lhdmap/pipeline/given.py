"""Given poses instead of the odometry's: `--poses FILE.tum`, or `--poses ground-truth` for those in the log itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from lhdmap.errors import InputError
from lhdmap.evaluation.ordering import file_in_order
from lhdmap.geometry import se3
from lhdmap.logs.source import LogSource
from lhdmap.messages import GroundTruth
from lhdmap.pipeline.track import TrackRows
from lhdmap.trajectory import Trajectory, read_tum

GROUND_TRUTH = "ground-truth"
_FARTHEST_M = 50_000.0  # the cloud is of 32-bit floats


def given_rows(poses: str, logs: Sequence[Path], topics: Mapping[str, str]) -> TrackRows:
    """Return the poses of `base_link` in `map` by rising time.

    Raises:
        InputError: the file is not usable, or the log has no ground truth.
    """
    trajectory = _ground_truth(logs, topics) if poses == GROUND_TRUTH else _of_file(Path(poses))
    farthest_m = float(np.abs(trajectory.positions_m).max(initial=0.0))
    if farthest_m > _FARTHEST_M:
        raise InputError(
            f"{poses}: positions up to {farthest_m:.0f} m from their origin; map coordinates keep millimetres up to "
            f"{_FARTHEST_M / 1e3:.0f} km: subtract an offset (of the mine's grid) first"
        )
    order = np.argsort(trajectory.stamps_ns, kind="stable")
    stamps = trajectory.stamps_ns[order]
    once = np.concatenate([[True], np.diff(stamps) > 0])
    rpy = se3.rpy_from_quaternions(trajectory.quaternions_xyzw[order][once])
    rpy[:, 2] = np.unwrap(rpy[:, 2])
    return TrackRows(stamps[once], np.column_stack([trajectory.positions_m[order][once], rpy]))


def _of_file(path: Path) -> Trajectory:
    """Return the poses of a file in any order: they are looked up by their stamps."""
    return file_in_order(read_tum(path), path).trajectory


def _ground_truth(logs: Sequence[Path], topics: Mapping[str, str]) -> Trajectory:
    with LogSource(list(logs), topics) as source:
        if "ground_truth" not in source.roles:
            raise InputError(f"{logs[0]}: --poses {GROUND_TRUTH}: no ground-truth topic in the log; --poses FILE.tum?")
        found = [message for _, message in source.messages(["ground_truth"]) if isinstance(message, GroundTruth)]
    if not found:
        raise InputError(f"{logs[0]}: --poses {GROUND_TRUTH}: the topic {source.roles['ground_truth']} is empty")
    return Trajectory(
        np.array([one.stamp_ns for one in found], dtype=np.int64),
        np.array([one.position_m for one in found]),
        np.array([one.quaternion_xyzw for one in found]),
    )

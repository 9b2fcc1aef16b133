"""Where estimates and truths come from: TUM files, map folders, logs with ground truth, corrected CARMEN logs."""

from __future__ import annotations

import bz2
import gzip
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from lhdmap.descriptions import looks_like_log
from lhdmap.errors import InputError, LhdmapWarning
from lhdmap.evaluation.ordering import file_in_order
from lhdmap.geometry.se3 import quaternions_from_rpy
from lhdmap.messages import GroundTruth
from lhdmap.trajectory import Trajectory, read_tum, seconds_to_ns

LOG_SUFFIXES = (".mcap", ".bag", ".db3")
TEXT_LOG_SUFFIXES = tuple(kind + packed for kind in (".log", ".clf") for packed in ("", ".gz", ".bz2"))
_OPENERS: Mapping[str, Callable[..., Any]] = {".gz": gzip.open, ".bz2": bz2.open}
ROBOT_POSE_FIELDS = 11
"""ROBOTLASER1 ends with laser pose (3), robot pose (3), speeds and safety margins (5), stamp, host, logger stamp."""


def load_estimate(path: Path, *, odometry: bool = False) -> Trajectory:
    """Return the trajectory of a TUM file, or another table of poses, or of a map folder (its odometry where asked for).

    A map folder's is in the order of its scans, a file's by time.

    Raises:
        InputError: there is none at `path`.
    """
    name = "odometry.tum" if odometry else "trajectory.tum"
    if path.exists() and looks_like_log(path) and not (path / name).is_file():
        raise InputError(
            f"{path}: is a log, a map folder or a TUM file was wanted; lhdmap build-map makes a map of it, then name that folder"
        )
    if path.is_dir():
        if not (path / name).is_file():
            raise InputError(f"{path}: a map folder with {name} was wanted, the folder has none")
        return read_tum(path / name)
    found, remark = file_in_order(read_tum(path), path)
    if remark:
        warnings.warn(f"{path}: {remark}", LhdmapWarning, stacklevel=2)
    return found


def load_truth(path: Path) -> Trajectory:
    """Return the true trajectory of a TUM file, a log with ground truth, a map folder or a corrected CARMEN log.

    Raises:
        InputError: there is no truth at `path`.
    """
    name = path.name.lower()
    if name.endswith(TEXT_LOG_SUFFIXES):
        return read_corrected_carmen(path)
    if name.endswith(LOG_SUFFIXES) or (path.is_dir() and not (path / "trajectory.tum").exists()):
        return ground_truth_of_log(path)
    return load_estimate(path)


def ground_truth_of_log(path: Path) -> Trajectory:
    """Return the ground truth that a log carries.

    Raises:
        InputError: the log cannot be read or has no ground truth.
    """
    from lhdmap.logs.formats import open_log

    with open_log(path) as log:
        names = [topic.name for topic in log.topics().values() if topic.type_name.endswith("/Odometry")]
        found = [record.message for record in log.records(names) if isinstance(record.message, GroundTruth)]
    if not found:
        raise InputError(f"{path}: no ground truth in it; a nav_msgs/Odometry on /ground_truth/odometry was wanted")
    return Trajectory(
        np.array([message.stamp_ns for message in found], dtype=np.int64),
        np.array([message.position_m for message in found]),
        np.array([message.quaternion_xyzw for message in found]),
    )


def read_corrected_carmen(path: Path) -> Trajectory:
    """Return the key-scan poses of a corrected CARMEN log: the robot pose of each ROBOTLASER1 line, in file order.

    Raises:
        InputError: the file is missing, has no such line, or one is broken.
    """
    stamps, poses, has_graph = [], [], False
    with _text(path) as file:
        for number, line in enumerate(file, 1):
            has_graph = has_graph or line.startswith("VERTEX2 ")
            if not line.startswith("ROBOTLASER1 "):
                continue
            stamp, *pose = _corrected_pose(path, number, line.split())
            stamps.append(int(stamp))
            poses.append(pose)
    if not poses:
        raise InputError(f"{path}: no ROBOTLASER1 line in it; a corrected CARMEN log (poses of key scans) was wanted")
    if not has_graph:
        text = f"{path}: no pose graph (VERTEX2) in it; its poses may be those of the wheels, which are no truth"
        warnings.warn(text, LhdmapWarning, stacklevel=2)
    x, y, heading = np.array(poses).T
    zero = np.zeros(len(x))
    return Trajectory(
        np.array(stamps, dtype=np.int64), np.column_stack([x, y, zero]), quaternions_from_rpy(zero, zero, heading)
    )


def _corrected_pose(path: Path, number: int, fields: list[str]) -> tuple[int, float, float, float]:
    """Return stamp (ns) and robot pose (x, y, heading) of a ROBOTLASER1 line; its beams and remissions are counted."""
    try:
        after_beams = 9 + int(fields[8])
        tail = fields[after_beams + 1 + int(fields[after_beams]) :]
        x, y, heading = (float(field) for field in tail[3:6])
        return seconds_to_ns(tail[ROBOT_POSE_FIELDS]), x, y, heading
    except (ValueError, IndexError):
        raise InputError(
            f"{path}, line {number}: the ROBOTLASER1 line is broken; beams, two poses, stamp were wanted"
        ) from None


@contextmanager
def _text(path: Path) -> Iterator[TextIO]:
    """Open a text file, plain or packed by gzip or bzip2.

    Raises:
        InputError: it is missing or not readable.
    """
    try:
        with _OPENERS.get(path.suffix.lower(), open)(path, "rt", encoding="ascii", errors="replace") as file:
            yield file
    except (OSError, EOFError) as error:
        raise InputError(f"{path}: {getattr(error, 'strerror', None) or error}") from error

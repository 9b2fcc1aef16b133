"""Relations of the Freiburg SLAM benchmark: true motions between pairs of stamps, made by hand from scans.

A line is `t1 t2 dx dy dz roll pitch yaw`: the pose at t2 seen from the pose at t1. Error of a relation: inverse(true) o
estimated, translation and rotation apart (Burgard et al., IROS 2009). Relations between close stamps test the local
odometry, those far apart loop closure and the consistency of the map, so they are reported apart.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lhdmap.errors import InputError
from lhdmap.evaluation.association import IndexArray, nearest_rows
from lhdmap.evaluation.metrics import Statistics, statistics
from lhdmap.evaluation.poses import Poses, angles, between, poses_from_quaternions, taken
from lhdmap.geometry.se3 import quaternions_from_rpy
from lhdmap.messages import FloatArray
from lhdmap.settings import figure
from lhdmap.trajectory import Trajectory, seconds_to_ns

SHORT_S, LONG_S = 5.0, 60.0
STAMP_TOLERANCE_NS = 1_000_000


class Relations(NamedTuple):
    """M true motions: stamps of both ends (M,) in nanoseconds and the poses T_first_second."""

    first_ns: IndexArray
    second_ns: IndexArray
    T_first_second: Poses


class RelationGroup(NamedTuple):
    """Errors of the relations of one span of time; None where there are none."""

    name: str
    n: int
    translation_m: Statistics | None
    rotation_deg: Statistics | None


class RelationEvaluation(NamedTuple):
    """What `evaluate_relations` found: groups `all`, `short`, `up_to_60_s`, `long`; how many had both stamps."""

    groups: tuple[RelationGroup, ...]
    matched: int
    total: int

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain values."""
        rows = []
        for group in self.groups:
            row: dict[str, Any] = {"group": group.name, "n": group.n}
            row["translation_m"] = group.translation_m._asdict() if group.translation_m else None
            row["rotation_deg"] = group.rotation_deg._asdict() if group.rotation_deg else None
            rows.append(row)
        return {"relations": rows, "matched": self.matched, "total": self.total}


def read_relations(path: Path) -> Relations:
    """Read a relations file.

    Raises:
        InputError: the file is missing or empty, or a line has not eight numbers.
    """
    try:
        lines = path.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    stamps, values = [], []
    for number, line in enumerate(lines, 1):
        fields = line.split()
        if not fields or fields[0].startswith("#"):
            continue
        try:
            stamps.append((seconds_to_ns(fields[0]), seconds_to_ns(fields[1])))
            x, y, z, roll, pitch, yaw = (float(field) for field in fields[2:])
        except (ValueError, IndexError):
            wanted = "t1 t2 dx dy dz roll pitch yaw"
            raise InputError(f"{path}, line {number}: eight numbers ({wanted}) were wanted") from None
        values.append((x, y, z, roll, pitch, yaw))
    if not values:
        raise InputError(f"{path}: no relation in it")
    return _relations(np.array(stamps, dtype=np.int64), np.array(values))


def evaluate_relations(
    estimate: Trajectory, relations: Relations, tolerance_ns: int = STAMP_TOLERANCE_NS
) -> RelationEvaluation:
    """Compare an estimate with relations; its stamps may be in any order.

    Raises:
        InputError: no relation has both its stamps in the estimate.
    """
    first, second = (nearest_rows(estimate.stamps_ns, stamps) for stamps in (relations.first_ns, relations.second_ns))
    away_ns = np.maximum(
        np.abs(estimate.stamps_ns[first] - relations.first_ns), np.abs(estimate.stamps_ns[second] - relations.second_ns)
    )
    kept = np.flatnonzero(away_ns <= tolerance_ns)
    if not len(kept):
        raise InputError(
            f"no relation has both its stamps in the estimate: {figure(tolerance_ns / 1e9)} s were allowed, the nearest are "
            f"{figure(float(away_ns.min()) / 1e9)} s off; the estimate must have one pose for each scan of the same log"
        )
    poses = poses_from_quaternions(estimate.positions_m, estimate.quaternions_xyzw)
    moved = between(taken(poses, first[kept]), taken(poses, second[kept]))
    error = between(taken(relations.T_first_second, kept), moved)
    span_s = np.abs(relations.second_ns - relations.first_ns)[kept] / 1e9
    translation, rotation = np.linalg.norm(error.positions_m, axis=1), np.degrees(angles(error.rotations))
    return RelationEvaluation(_groups(span_s, translation, rotation), len(kept), len(away_ns))


def _groups(span_s: FloatArray, translation_m: FloatArray, rotation_deg: FloatArray) -> tuple[RelationGroup, ...]:
    masks = {
        "all": np.ones(len(span_s), dtype=bool),
        "short": span_s < SHORT_S,
        "up_to_60_s": span_s <= LONG_S,
        "long": span_s > LONG_S,
    }
    return tuple(
        RelationGroup(name, int(mask.sum()), statistics(translation_m[mask]), statistics(rotation_deg[mask]))
        for name, mask in masks.items()
    )


def _relations(stamps_ns: IndexArray, values: FloatArray) -> Relations:
    poses = poses_from_quaternions(values[:, :3], quaternions_from_rpy(values[:, 3], values[:, 4], values[:, 5]))
    return Relations(stamps_ns[:, 0], stamps_ns[:, 1], poses)

"""Many sweeps at once: the interpreter is asked once a batch, not once a sweep, so it is free for the odometry."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.integration.beams import BeamTable
from lhdmap.integration.project import Limits, SweepPoints, SweepPoses, project_scan
from lhdmap.integration.self_filter import Rig
from lhdmap.messages import Float32Array, FloatArray, LaserScan, PointCloud


class BatchPoses(NamedTuple):
    """The machine at both ends of S sweeps: `T_map_base` (S, 2, 4, 4), `articulation_rad` (S, 2)."""

    T_map_base: FloatArray
    articulation_rad: FloatArray

    @classmethod
    def of(cls, poses: Sequence[SweepPoses]) -> BatchPoses:
        """Return the poses of single sweeps as one batch."""
        T = np.array([(p.T_map_base_start, p.T_map_base_end) for p in poses], dtype=np.float64)
        angles = np.array([(p.articulation_start_rad, p.articulation_end_rad) for p in poses], dtype=np.float64)
        return cls(T.reshape(-1, 2, 4, 4), angles.reshape(-1, 2))

    def at(self, place: int) -> SweepPoses:
        """Return the poses of one sweep."""
        (start, end), (angle, end_angle) = self.T_map_base[place], self.articulation_rad[place]
        return SweepPoses(start, end, float(angle), float(end_angle))

    def finite(self) -> npt.NDArray[np.bool_]:
        """Return which sweeps have poses that are numbers, shape (S,)."""
        flat = np.column_stack([self.T_map_base.reshape(-1, 32), self.articulation_rad])
        return np.isfinite(flat.sum(axis=1))


class BatchRoom(NamedTuple):
    """Room for the points of S sweeps: those of sweep k are `counts[k, 0]` rows from `starts[k]` on.

    `points_map` (P, 3), `stamps_ns` (P,), `viewpoints_map` (S, 3), `starts` (S,), `counts` (S, 4) as in `Counts`.
    """

    points_map: FloatArray
    stamps_ns: npt.NDArray[np.int64]
    viewpoints_map: FloatArray
    starts: npt.NDArray[np.int64]
    counts: npt.NDArray[np.int64]

    def of_sweep(self, place: int, size: int) -> SweepPoints:
        """Return the room of one sweep of `size` points."""
        start = int(self.starts[place])
        end = start + size
        return SweepPoints(self.points_map[start:end], self.stamps_ns[start:end], self.viewpoints_map[place])


class BatchMaker:
    """Makes rooms for batches out of one piece of memory, which grows to the largest batch seen."""

    def __init__(self) -> None:
        self._points, self._stamps = np.empty((0, 3)), np.empty(0, dtype=np.int64)

    def room(self, messages: Sequence[LaserScan | PointCloud]) -> BatchRoom:
        """Return the room for a batch; the batch before is overwritten."""
        sizes = [size_of(message) for message in messages]
        starts = np.cumsum([0, *sizes])
        if len(self._stamps) < starts[-1]:
            self._points, self._stamps = np.empty((starts[-1], 3)), np.empty(starts[-1], dtype=np.int64)
        counts = np.zeros((len(sizes), 4), dtype=np.int64)
        return BatchRoom(self._points, self._stamps, np.zeros((len(sizes), 3)), starts[:-1], counts)


def size_of(message: LaserScan | PointCloud) -> int:
    """Return how many points a message holds at most."""
    return len(message.ranges_m if isinstance(message, LaserScan) else message.points_m)


def alike(messages: Sequence[LaserScan | PointCloud], places: Sequence[int]) -> list[list[int]]:
    """Return `places` in groups: scans of one scanner together, each cloud of a 3D scanner on its own."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for place in places:
        message = messages[place]
        if isinstance(message, LaserScan):
            beams = message.angle_min_rad, message.angle_increment_rad, len(message.ranges_m)
            key: tuple[object, ...] = (message.frame_id, *beams, message.range_min_m, message.range_max_m)
        else:
            key = (message.frame_id, place)
        groups.setdefault(key, []).append(place)
    return list(groups.values())


class Scans(NamedTuple):
    """Scans of one scanner out of a batch.

    `places` (K,): their numbers in the batch; `ranges_m` (K, N); `spans_ns` (K, 2): times of first and last beam.
    """

    places: npt.NDArray[np.int64]
    ranges_m: Float32Array
    spans_ns: npt.NDArray[np.int64]


@nb.njit(cache=True, nogil=True)
def project_scans(scans: Scans, beams: BeamTable, limits: Limits, poses: BatchPoses, rig: Rig, room: BatchRoom) -> None:
    """Project scans of one scanner into the map, each as `project_scan` does; points and counts go into `room`."""
    size = scans.ranges_m.shape[1]
    for k in range(scans.places.shape[0]):
        place = scans.places[k]
        start, end = room.starts[place], room.starts[place] + size
        T, angle = poses.T_map_base[place], poses.articulation_rad[place]
        counts = project_scan(
            scans.ranges_m[k],
            beams,
            limits,
            (scans.spans_ns[k, 0], scans.spans_ns[k, 1]),
            SweepPoses(T[0], T[1], angle[0], angle[1]),
            rig,
            SweepPoints(room.points_map[start:end], room.stamps_ns[start:end], room.viewpoints_map[place]),
        )
        for i in range(4):
            room.counts[place, i] = counts[i]

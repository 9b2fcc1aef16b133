"""The machine's path while it grows: poses of processed scans in space, and any pose between them."""

from __future__ import annotations

import math
from array import array
from bisect import bisect_left, bisect_right
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.geometry import se3
from lhdmap.messages import FloatArray
from lhdmap.trajectory import Trajectory

Stamps = npt.NDArray[np.int64]
_CARRY_ON_NS = 2e8
_POSE = 6  # numbers of a pose
_NEWEST = 256  # poses of a track that is not kept: some ten seconds
_MOST_CARRIED = 3.0  # a growing track's last step goes on for up to two of its lengths


class TrackRows(NamedTuple):
    """Poses as columns: `times_ns` (N,) rising, `poses` (N, 6): x, y, z (m), roll, pitch, heading (rad, unwrapped)."""

    times_ns: Stamps
    poses: FloatArray


class Track:
    """Appends planar odometry and attitude to a path in space; height integrates along the attitude.

    A planar step is horizontal; with the machine on the floor it rises by -tan(pitch) forward and tan(roll) to the left
    (REP 103: positive pitch points down, positive roll lifts the left side). Poses are packed: a shift has a million of them.
    Not `kept`: the newest ones alone.
    """

    def __init__(self, height_lever_m: float = 0.0, *, kept: bool = True) -> None:
        self._lever_m, self._kept = height_lever_m, kept
        self._times, self._poses = array("q"), array("d")

    def __len__(self) -> int:
        return len(self._times)

    @property
    def last_ns(self) -> int | None:
        """Time of the newest pose."""
        return self._times[-1] if self._times else None

    @property
    def height_m(self) -> float:
        """Height of the newest pose, 0 at the start."""
        return self.newest[2] if self._poses else 0.0

    @property
    def newest(self) -> tuple[float, ...]:
        """The newest pose: x, y, z (m), roll, pitch, heading (rad)."""
        return tuple(self._poses[-_POSE:])

    def append(self, time_ns: int, pose_odom_base: FloatArray, roll_rad: float, pitch_rad: float) -> None:
        """Add a planar pose (3,) with its attitude; `time_ns` must rise."""
        pose = self.ahead(pose_odom_base, roll_rad, pitch_rad)
        if not self._kept and len(self._times) >= _NEWEST:
            del self._times[: _NEWEST // 2], self._poses[: _POSE * (_NEWEST // 2)]
        self._times.append(time_ns)
        self._poses.extend(pose)

    def ahead(self, pose_odom_base: FloatArray, roll_rad: float, pitch_rad: float) -> tuple[float, ...]:
        """Return the pose (x, y, z, roll, pitch, heading) that a planar pose (3,) with its attitude would add."""
        x, y, heading = (float(value) for value in pose_odom_base)
        z = 0.0
        if self._poses:
            x0, y0, z, roll0, pitch0, heading0 = self.newest
            heading = heading0 + math.remainder(heading - heading0, 2.0 * math.pi)
            middle = 0.5 * (heading + heading0)
            forward = math.cos(middle) * (x - x0) + math.sin(middle) * (y - y0)
            left = -math.sin(middle) * (x - x0) + math.cos(middle) * (y - y0)
            roll, pitch = 0.5 * (roll_rad + roll0), 0.5 * (pitch_rad + pitch0)
            z += -forward * math.tan(pitch) + left * math.tan(roll) / math.cos(pitch)
            # The slope is that of the floor between the axles: base_link, at the front, is already further up or down it.
            z -= self._lever_m * (math.tan(pitch_rad) - math.tan(pitch0))
        return x, y, z, roll_rad, pitch_rad, heading

    def extend(self, rows: TrackRows) -> None:
        """Add rows that are complete, height included; their times must rise."""
        self._times.extend(rows.times_ns.tolist())
        self._poses.extend(rows.poses.ravel().tolist())

    def rows_after(self, first: int, until_ns: int) -> TrackRows:
        """Return the poses from row `first` on that are not later than a time."""
        return self._between(first, bisect_right(self._times, until_ns))

    def append_space(self, time_ns: int, T_odom_base: FloatArray) -> None:
        """Add a pose in space (4, 4), as a 3D odometry gives it."""
        roll, pitch, heading = se3.to_rpy(T_odom_base)
        if self._poses:
            before = self.newest[5]
            heading = before + math.remainder(heading - before, 2.0 * math.pi)
        self._times.append(time_ns)
        self._poses.extend((*T_odom_base[:3, 3].tolist(), roll, pitch, heading))

    def matrices_at(self, times_ns: Stamps) -> FloatArray:
        """Return poses (N, 4, 4) near the end of the track, linear between poses and carried on after the last."""
        first = max(bisect_left(self._times, int(times_ns.min(initial=self._times[-1]))) - 1, 0)
        return _matrices(*self._between(first, len(self)), times_ns, _MOST_CARRIED)

    def rows(self) -> TrackRows:
        """Return all poses as columns."""
        return self._between(0, len(self))

    def _between(self, first: int, last: int) -> TrackRows:
        """Return the rows [first, last), copied: while an array is looked at, it cannot grow."""
        times = np.array(self._times[first:last], dtype=np.int64)
        return TrackRows(times, np.array(self._poses[_POSE * first : _POSE * last], dtype=float).reshape(-1, _POSE))


class FinalTrack:
    """A finished path: any pose by time."""

    def __init__(self, rows: TrackRows) -> None:
        self._rows = rows

    def covers(self, time_ns: int) -> bool:
        """Return whether a pose is known at this time (a fifth of a second beyond the ends counts)."""
        return bool(self._rows.times_ns[0] - _CARRY_ON_NS <= time_ns <= self._rows.times_ns[-1] + _CARRY_ON_NS)

    def matrices_at(self, times_ns: Stamps) -> FloatArray:
        """Return poses (N, 4, 4) at any times, held before the first and after the last."""
        return _matrices(self._rows.times_ns, self._rows.poses, times_ns, 1.0)


@nb.njit(cache=True, nogil=True)
def _matrices(times_ns: Stamps, poses: FloatArray, at_ns: Stamps, most_share: float) -> FloatArray:
    """Return the poses (N, 4, 4) at `at_ns` (N,) between rows (M,), (M, 6).

    The first row is held before it; the last step goes on up to `most_share` times its length.
    """
    out = np.zeros((at_ns.shape[0], 4, 4))
    for n in range(at_ns.shape[0]):
        after = min(np.searchsorted(times_ns, at_ns[n]), times_ns.shape[0] - 1)
        row = poses[after]
        if after > 0:
            share = (at_ns[n] - times_ns[after - 1]) / (times_ns[after] - times_ns[after - 1])
            row = poses[after - 1] + min(share, most_share) * (poses[after] - poses[after - 1])
        _write_pose(row, out[n])
    return out


@nb.njit(cache=True, nogil=True)
def _write_pose(row: FloatArray, out: FloatArray) -> None:
    """Write the matrix of x, y, z, roll, pitch, heading: `se3.from_rpy` for kernels."""
    cr, sr, cp, sp = math.cos(row[3]), math.sin(row[3]), math.cos(row[4]), math.sin(row[4])
    cy, sy = math.cos(row[5]), math.sin(row[5])
    out[0, 0], out[0, 1], out[0, 2], out[0, 3] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, row[0]
    out[1, 0], out[1, 1], out[1, 2], out[1, 3] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, row[1]
    out[2, 0], out[2, 1], out[2, 2], out[2, 3] = -sp, cp * sr, cp * cr, row[2]
    out[3, 3] = 1.0


def resample(rows: TrackRows, times_ns: Stamps) -> TrackRows:
    """Return poses at other times, shape (M,): linear between the rows.

    For a moment beyond them (half a sweep) the motion goes on, then the pose is held.
    """
    # differences first: stamps of today's clocks have 19 digits, a float keeps 16
    x = (rows.times_ns - rows.times_ns[0]).astype(float)
    at = (times_ns - rows.times_ns[0]).astype(float)
    poses = np.column_stack([np.interp(at, x, column) for column in rows.poses.T])
    if len(x) > 1:
        for outside, (inner, edge) in ((at < x[0], (1, 0)), (at > x[-1], (-2, -1))):
            slope = (rows.poses[edge] - rows.poses[inner]) / (x[edge] - x[inner])
            beyond = np.clip(at[outside] - x[edge], -_CARRY_ON_NS, _CARRY_ON_NS)
            poses[outside] = rows.poses[edge] + beyond[:, None] * slope
    return TrackRows(times_ns, poses)


def trajectory_of(rows: TrackRows, stamps_ns: Stamps) -> Trajectory:
    """Return the rows as a trajectory that carries the scans' own stamps (N,)."""
    quaternions = se3.quaternions_from_rpy(rows.poses[:, 3], rows.poses[:, 4], rows.poses[:, 5])
    return Trajectory(stamps_ns, rows.poses[:, :3].copy(), quaternions)

"""The machine's path while it grows: poses of processed scans in space, and any pose between them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.geometry import se3
from lhdmap.messages import FloatArray
from lhdmap.trajectory import Trajectory

Stamps = npt.NDArray[np.int64]
_CARRY_ON_NS = 2e8


class Rows(NamedTuple):
    """Poses as columns: `times_ns` (N,) rising, `poses` (N, 6): x, y, z (m), roll, pitch, heading (rad, unwrapped)."""

    times_ns: Stamps
    poses: FloatArray


class Track:
    """Appends planar odometry and attitude to a path in space; height integrates along the attitude.

    A planar step is horizontal; with the machine on the floor it rises by -tan(pitch) forward and tan(roll) to the left
    (REP 103: positive pitch points down, positive roll lifts the left side).
    """

    def __init__(self, height_lever_m: float = 0.0) -> None:
        self._lever_m = height_lever_m
        self._times: list[int] = []
        self._poses: list[tuple[float, ...]] = []

    def __len__(self) -> int:
        return len(self._times)

    @property
    def last_ns(self) -> int | None:
        """Time of the newest pose."""
        return self._times[-1] if self._times else None

    @property
    def height_m(self) -> float:
        """Height of the newest pose, 0 at the start."""
        return self._poses[-1][2] if self._poses else 0.0

    def append(self, time_ns: int, T_odom_base: FloatArray, roll_rad: float, pitch_rad: float) -> None:
        """Add a planar pose (3,) with its attitude; `time_ns` must rise."""
        x, y, heading = (float(value) for value in T_odom_base)
        z = 0.0
        if self._poses:
            x0, y0, z, roll0, pitch0, heading0 = self._poses[-1]
            heading = heading0 + math.remainder(heading - heading0, 2.0 * math.pi)
            middle = 0.5 * (heading + heading0)
            forward = math.cos(middle) * (x - x0) + math.sin(middle) * (y - y0)
            left = -math.sin(middle) * (x - x0) + math.cos(middle) * (y - y0)
            roll, pitch = 0.5 * (roll_rad + roll0), 0.5 * (pitch_rad + pitch0)
            z += -forward * math.tan(pitch) + left * math.tan(roll) / math.cos(pitch)
            # The slope is that of the floor between the axles: base_link, at the front, is already further up or down it.
            z -= self._lever_m * (math.tan(pitch_rad) - math.tan(pitch0))
        self._times.append(time_ns)
        self._poses.append((x, y, z, roll_rad, pitch_rad, heading))

    def append_space(self, time_ns: int, T_odom_base: FloatArray) -> None:
        """Add a pose in space (4, 4), as a 3D odometry gives it."""
        roll, pitch, heading = se3.to_rpy(T_odom_base)
        if self._poses:
            heading = self._poses[-1][5] + math.remainder(heading - self._poses[-1][5], 2.0 * math.pi)
        self._times.append(time_ns)
        self._poses.append((*(float(v) for v in T_odom_base[:3, 3]), roll, pitch, heading))

    def matrix_at(self, time_ns: int) -> FloatArray:
        """Return the pose (4, 4) at a time near the end of the track, linear between poses and carried on after the last."""
        k = len(self._times) - 1
        while k > 0 and self._times[k - 1] >= time_ns:
            k -= 1
        if k == 0:
            row = self._poses[0]
        else:
            before, after = np.array(self._poses[k - 1]), np.array(self._poses[k])
            span = self._times[k] - self._times[k - 1]
            share = min((time_ns - self._times[k - 1]) / span, 3.0) if span > 0 else 1.0
            row = tuple(before + share * (after - before))
        return se3.from_rpy(row[3], row[4], row[5], (row[0], row[1], row[2]))

    def rows(self) -> Rows:
        """Return all poses as columns."""
        return Rows(np.array(self._times, dtype=np.int64), np.array(self._poses, dtype=float).reshape(-1, 6))


class FinalTrack:
    """A finished path: any pose by time."""

    def __init__(self, rows: Rows) -> None:
        self._rows = rows

    def covers(self, time_ns: int) -> bool:
        """Return whether a pose is known at this time (a fifth of a second beyond the ends counts)."""
        return bool(self._rows.times_ns[0] - _CARRY_ON_NS <= time_ns <= self._rows.times_ns[-1] + _CARRY_ON_NS)

    def matrix_at(self, time_ns: int) -> FloatArray:
        """Return the pose (4, 4) at a time, held before the first and after the last."""
        row = resample_near(self._rows, time_ns)
        return se3.from_rpy(row[3], row[4], row[5], (row[0], row[1], row[2]))


def resample_near(rows: Rows, time_ns: int) -> FloatArray:
    """Return one pose (6,) at a time, linear between rows."""
    after = int(np.searchsorted(rows.times_ns, time_ns))
    if after == 0 or after == len(rows.times_ns):
        return rows.poses[min(after, len(rows.times_ns) - 1)]
    before_ns = int(rows.times_ns[after - 1])
    share = (time_ns - before_ns) / (int(rows.times_ns[after]) - before_ns)
    return rows.poses[after - 1] + share * (rows.poses[after] - rows.poses[after - 1])


def resample(rows: Rows, times_ns: Stamps) -> Rows:
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
    return Rows(times_ns, poses)


def trajectory_of(rows: Rows, stamps_ns: Stamps) -> Trajectory:
    """Return the rows as a trajectory that carries the scans' own stamps (N,)."""
    quaternions = se3.quaternions_from_rpy(rows.poses[:, 3], rows.poses[:, 4], rows.poses[:, 5])
    return Trajectory(stamps_ns, rows.poses[:, :3].copy(), quaternions)

"""A cloud as points in `base_link` with the time of each: range limits, own body and the sweep's motion taken out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray, PointCloud

_LONGEST_S = 1.0  # of a sweep: times that are farther from the stamp are in a wrong unit


class CloudSweep(NamedTuple):
    """Points (N, 3), metres, in `base_link` as it was when each was measured, `times_s` (N,) after the sweep's middle.

    `times_s` is empty where the log has no times: all points are then taken as measured at the stamp.
    """

    points_m: FloatArray
    times_s: FloatArray

    def undone(self, twist: FloatArray) -> FloatArray:
        """Return the points (N, 3) in `base_link` at the middle of a sweep during which it moved with `twist` (6,).

        The motion's series is cut after the second power of time: below 1 mm at 30 m for 0.5 rad/s and 0.1 s.
        """
        if not len(self.times_s):
            return self.points_m
        omega, speed, t = twist[:3], twist[3:], self.times_s[:, None]
        first = np.cross(omega, self.points_m) + speed
        return self.points_m + t * first + 0.5 * t * t * np.cross(omega, first)

    def smear_m(self, twist: FloatArray) -> float:
        """Return how far a velocity `twist` (6,) that is not undone smears the points, metres, turns left out."""
        return float(np.abs(twist[3:]).max() * np.ptp(self.times_s)) if len(self.times_s) else 0.0


def middle_s(cloud: PointCloud) -> float:
    """Return the mean time of the points after the stamp, seconds; zero where they have none.

    The pose at the middle of a sweep hardly depends on the velocity that undoes it; the pose at its start does, and
    with the velocity in the loop it swings up.
    """
    times = np.asarray(cloud.time_offsets_s, dtype=np.float64)
    times = times[np.isfinite(times)]
    return float(np.clip(times.mean(), -_LONGEST_S, _LONGEST_S)) if times.size else 0.0


def sweep_of(
    cloud: PointCloud, T_base_sensor: FloatArray, limits_m: tuple[float, float], boxes_m: FloatArray
) -> CloudSweep:
    """Return the points within `limits_m` (nearest, farthest) of the scanner that are not on the machine.

    `boxes_m`: (K, 6), x y z minimum and maximum of the machine's bodies in `base_link`. What is not finite is left out.
    """
    points = np.asarray(cloud.points_m, dtype=np.float64).reshape(-1, 3)
    times = np.asarray(cloud.time_offsets_s, dtype=np.float64)
    timed = len(times) == len(points)
    kept = np.abs(points).max(axis=1, initial=0.0) <= limits_m[1]  # False for what is not finite
    if timed:
        kept &= np.abs(times) <= 10.0 * _LONGEST_S
    points = points[kept]
    ranges = np.sqrt(np.einsum("ij,ij->i", points, points))
    near = (ranges >= limits_m[0]) & (ranges <= limits_m[1])
    points_base = points @ T_base_sensor[:3, :3].T + T_base_sensor[:3, 3]
    for box in boxes_m:
        near &= ~((points_base >= box[:3]) & (points_base <= box[3:])).all(axis=1)
    return CloudSweep(points_base[near], times[kept][near] - middle_s(cloud) if timed else np.zeros(0))


class SweepClock:
    """Times of the sweeps: `middle_s`, of the last one after its stamp; `runs`: there was one."""

    def __init__(self) -> None:
        self.middle_s = 0.0
        self._last_ns: int | None = None

    @property
    def runs(self) -> bool:
        """Whether a cloud has come."""
        return self._last_ns is not None

    def step(self, cloud: PointCloud) -> tuple[float, float]:
        """Return the time from stamp to stamp and from middle to middle of the sweeps, s; 0 for the first.

        A stamp that runs backwards counts as no time; a cloud without points has its middle where the last one had.
        """
        first, last_ns = self._last_ns is None, cloud.stamp_ns if self._last_ns is None else self._last_ns
        dt_s = max(cloud.stamp_ns - last_ns, 0) * 1e-9
        self._last_ns = max(cloud.stamp_ns, last_ns)
        before_s, self.middle_s = self.middle_s, middle_s(cloud) if len(cloud.points_m) else self.middle_s
        return dt_s, 0.0 if first else max(dt_s + self.middle_s - before_s, 0.0)

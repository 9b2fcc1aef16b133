"""Projection of a sweep into the map: validity, self-filter and motion compensation in one pass over the beams.

The pose of the sensor at beam i is interpolated between its poses at the ends of the sweep: position linearly, rotation
along the shortest arc. Each end is T_map_base * (T_base_rear(articulation)) * T_parent_sensor, so turning, driving,
pitching and steering within the sweep are all undone. The poses carry the attitude: nothing is assumed level here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.geometry.articulated import T_base_rear
from lhdmap.integration.beams import BeamTable
from lhdmap.integration.self_filter import Rig, body_poses, in_boxes
from lhdmap.messages import Float32Array, FloatArray


class SweepPoses(NamedTuple):
    """The machine at the ends of a sweep (`beams.sweep_stamps_ns`): poses (4, 4) of `base_link`, articulation (rad)."""

    T_map_base_start: FloatArray
    T_map_base_end: FloatArray
    articulation_start_rad: float
    articulation_end_rad: float


class SweepPoints(NamedTuple):
    """Room for the points of one sweep, filled by the kernels.

    `points_map`: shape (N, 3), metres; `stamps_ns`: shape (N,); `viewpoint_map`: shape (3,), where the sensor was at
    the start of the sweep.
    """

    points_map: FloatArray
    stamps_ns: npt.NDArray[np.int64]
    viewpoint_map: FloatArray

    @classmethod
    def of_size(cls, points: int) -> SweepPoints:
        """Return room for so many points."""
        return cls(np.empty((points, 3)), np.empty(points, dtype=np.int64), np.empty(3))


class Limits(NamedTuple):
    """Which returns are taken: ranges in [`low_m`, `high_m`] that do not stick out of the sweep.

    A return is a stray one (dust, a drop of water) where it is nearer than the two beams on each side of it by more
    than `stray_m + stray_share * range`. Infinite: none is.
    """

    low_m: float
    high_m: float
    stray_m: float = math.inf
    stray_share: float = 0.0


class BeamCounts(NamedTuple):
    """What became of a sweep's beams: kept points, no returns, returns from the machine itself, stray returns."""

    kept: int
    no_return: int
    self_hits: int
    strays: int


class _Arc(NamedTuple):
    """Motion of the sensor over a sweep: start pose, rotation axis (start frame) and angle, shift."""

    R: FloatArray
    t: FloatArray
    axis: FloatArray
    angle: float
    shift: FloatArray


@nb.njit(cache=True, nogil=True)
def sensor_pose(T_map_base: FloatArray, articulation_rad: float, rig: Rig) -> FloatArray:
    """Return T_map_sensor, shape (4, 4)."""
    if rig.on_rear:
        return T_map_base @ T_base_rear(articulation_rad, rig.L_f_m, rig.L_r_m) @ rig.T_parent_sensor
    return T_map_base @ rig.T_parent_sensor


@nb.njit(cache=True, nogil=True)
def _arc(poses: SweepPoses, rig: Rig) -> _Arc:
    A = sensor_pose(poses.T_map_base_start, poses.articulation_start_rad, rig)
    B = sensor_pose(poses.T_map_base_end, poses.articulation_end_rad, rig)
    R, t = A[:3, :3].copy(), A[:3, 3].copy()
    D = R.T @ B[:3, :3].copy()
    axis = np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]])
    length = math.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
    angle = math.atan2(length, D[0, 0] + D[1, 1] + D[2, 2] - 1.0)
    if length > 0.0:
        axis /= length
    return _Arc(R, t, axis, angle, B[:3, 3] - t)


@nb.njit(cache=True, nogil=True)
def _put(points: FloatArray, n: int, arc: _Arc, share: float, point: tuple[float, float, float]) -> None:
    """Write the sensor-frame `point`, measured at `share` (0-1) of the sweep, to points[n] in map coordinates."""
    x, y, z = point
    k = arc.axis
    a, b = math.sin(share * arc.angle), 1.0 - math.cos(share * arc.angle)
    # Rodrigues: u + sin k x u + (1 - cos) k x (k x u)
    cx, cy, cz = k[1] * z - k[2] * y, k[2] * x - k[0] * z, k[0] * y - k[1] * x
    ux = x + a * cx + b * (k[1] * cz - k[2] * cy)
    uy = y + a * cy + b * (k[2] * cx - k[0] * cz)
    uz = z + a * cz + b * (k[0] * cy - k[1] * cx)
    for row in range(3):
        points[n, row] = (
            arc.R[row, 0] * ux + arc.R[row, 1] * uy + arc.R[row, 2] * uz + arc.t[row] + share * arc.shift[row]
        )


@nb.njit(cache=True, nogil=True)
def project_scan(
    ranges_m: Float32Array,
    beams: BeamTable,
    limits: Limits,
    span_ns: tuple[int, int],
    poses: SweepPoses,
    rig: Rig,
    out: SweepPoints,
) -> BeamCounts:
    """Project a scan into the map.

    Args:
        ranges_m: shape (N,); NaN, inf and values outside the limits are no returns.
        beams: directions, each of shape (N,).
        limits: which returns are taken.
        span_ns: times of the first and of the last beam.
        poses: the machine at these times.
        rig: mount of the scanner and boxes of the bodies.
        out: room for at least N points, takes those that are kept.
    """
    arc = _arc(poses, rig)
    out.viewpoint_map[:] = arc.t
    T_front, T_rear = body_poses(rig, 0.5 * (poses.articulation_start_rad + poses.articulation_end_rad))
    n, no_return, own, strays = 0, 0, 0, 0
    step = 1.0 / max(ranges_m.shape[0] - 1, 1)
    for i in range(ranges_m.shape[0]):
        r = np.float64(ranges_m[i])
        if not (limits.low_m <= r <= limits.high_m):  # also true for NaN
            no_return += 1
            continue
        if _is_stray(ranges_m, i, limits):
            strays += 1
            continue
        x, y = r * beams.cos[i], r * beams.sin[i]
        if r < rig.reach_m and (
            in_boxes(T_front, rig.front_boxes, x, y, 0.0) or in_boxes(T_rear, rig.rear_boxes, x, y, 0.0)
        ):
            own += 1
            continue
        _put(out.points_map, n, arc, i * step, (x, y, 0.0))
        out.stamps_ns[n] = span_ns[0] + round(i * step * (span_ns[1] - span_ns[0]))
        n += 1
    return BeamCounts(n, no_return, own, strays)


@nb.njit(cache=True, nogil=True)
def _is_stray(ranges_m: Float32Array, i: int, limits: Limits) -> bool:
    """Return whether beam i is nearer than all of the four beams around it; a beam without a return counts as far."""
    if ranges_m.shape[0] < 5 or math.isinf(limits.stray_m):
        return False
    farthest = ranges_m[i] + limits.stray_m + limits.stray_share * ranges_m[i]
    for j in range(max(i - 2, 0), min(i + 3, ranges_m.shape[0])):
        if j != i and limits.low_m <= ranges_m[j] <= farthest:
            return False
    return True


@nb.njit(cache=True, nogil=True)
def project_cloud(
    points_m: Float32Array,
    offsets_s: Float32Array,
    limits: Limits,
    span_ns: tuple[int, int],
    poses: SweepPoses,
    rig: Rig,
    out: SweepPoints,
) -> BeamCounts:
    """Project a 3D scanner's points, shape (N, 3), into the map; `offsets_s` (N,) or empty; else as `project_scan`."""
    arc = _arc(poses, rig)
    out.viewpoint_map[:] = arc.t
    T_front, T_rear = body_poses(rig, 0.5 * (poses.articulation_start_rad + poses.articulation_end_rad))
    timed = offsets_s.shape[0] == points_m.shape[0] and offsets_s.shape[0] > 0
    first = np.float64(offsets_s.min()) if timed else 0.0
    span = np.float64(offsets_s.max()) - first if timed else 0.0
    n, no_return, own = 0, 0, 0
    for i in range(points_m.shape[0]):
        x, y, z = np.float64(points_m[i, 0]), np.float64(points_m[i, 1]), np.float64(points_m[i, 2])
        r = math.sqrt(x * x + y * y + z * z)
        if not (limits.low_m <= r <= limits.high_m):
            no_return += 1
            continue
        if r < rig.reach_m and (
            in_boxes(T_front, rig.front_boxes, x, y, z) or in_boxes(T_rear, rig.rear_boxes, x, y, z)
        ):
            own += 1
            continue
        share = (offsets_s[i] - first) / span if span > 0.0 else 0.0
        _put(out.points_map, n, arc, share, (x, y, z))
        out.stamps_ns[n] = span_ns[0] + round(share * (span_ns[1] - span_ns[0]))
        n += 1
    return BeamCounts(n, no_return, own, 0)

"""A scan as points in the level plane of the machine: mount and attitude applied, sweep undone, own body left out."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import Float32Array, FloatArray, LaserScan

NO_BOXES = np.zeros((0, 6))


def planar_points(
    scan: LaserScan,
    T_level_sensor: FloatArray,
    velocity: FloatArray,
    min_height_m: float = -math.inf,
    boxes_m: FloatArray = NO_BOXES,
    every: tuple[int, int] = (0, 1),
) -> FloatArray:
    """Return the hits as points, shape (N, 3), metres, in the level frame of `base_link` in the middle of the sweep.

    Args:
        scan: the scan; beams without a valid return are left out.
        T_level_sensor: pose (4, 4) of the sensor in the level frame (mount, roll and pitch applied; heading of the machine).
        velocity: forward, lateral, turning speed (3,) that undoes the sweep (beam i was measured `i * time_increment` after
            the stamp).
        min_height_m: hits below this height in the level frame are floor and left out.
        boxes_m: shape (K, 6), x y z minimum and maximum of the machine's bodies in the level frame: own hits are left out.
        every: first beam and step, to take only a part of the beams.
    """
    out = np.empty((scan.ranges_m.size, 3))
    count = _points(
        scan.ranges_m,
        (scan.angle_min_rad, scan.angle_increment_rad, scan.time_increment_s),
        (scan.range_min_m, scan.range_max_m, min_height_m),
        T_level_sensor,
        velocity,
        boxes_m,
        every,
        out,
    )
    return out[:count]


def flattened(points: FloatArray | Float32Array) -> FloatArray:
    """Return points (N, 3) at height zero: heights of two visits of a place differ by the drift of the height."""
    flat: FloatArray = points.astype(np.float64)
    flat[:, 2] = 0.0
    return flat


def half_sweep_ns(scan: LaserScan) -> int:
    """Return the time from the stamp to the middle of the sweep, nanoseconds."""
    return round(0.5e9 * scan.time_increment_s * max(scan.ranges_m.size - 1, 0))


@nb.njit(cache=True)
def _points(ranges, sweep, limits, T, velocity, boxes, every, out):  # type: ignore[no-untyped-def]
    angle_min, increment, beam_s = sweep
    middle_s = 0.5 * beam_s * max(ranges.size - 1, 0)
    count = 0
    for i in range(every[0], ranges.size, every[1]):
        r = ranges[i]
        if not (limits[0] <= r <= limits[1]) or r == np.inf or r <= 0.0:
            continue
        a = angle_min + i * increment
        x_s, y_s = r * math.cos(a), r * math.sin(a)
        x = T[0, 0] * x_s + T[0, 1] * y_s + T[0, 3]
        y = T[1, 0] * x_s + T[1, 1] * y_s + T[1, 3]
        z = T[2, 0] * x_s + T[2, 1] * y_s + T[2, 3]
        if z < limits[2] or _inside(x, y, z, boxes):
            continue
        after = i * beam_s - middle_s
        turn = velocity[2] * after
        c, s = math.cos(turn), math.sin(turn)
        ch, sh = math.cos(0.5 * turn), math.sin(0.5 * turn)
        out[count, 0] = c * x - s * y + (ch * velocity[0] - sh * velocity[1]) * after
        out[count, 1] = s * x + c * y + (sh * velocity[0] + ch * velocity[1]) * after
        out[count, 2] = z
        count += 1
    return count


@nb.njit(cache=True)
def _inside(x, y, z, boxes):  # type: ignore[no-untyped-def]
    for k in range(boxes.shape[0]):
        b = boxes[k]
        if b[0] <= x <= b[3] and b[1] <= y <= b[4] and b[2] <= z <= b[5]:
            return True
    return False

"""A simulated 2D scanner: rays from the machine's pose at each beam's own time, then what spoils a range."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.machine import Machine, SensorMount
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.simulation.driving import TABLE_RATE_HZ
from lhdmap.simulation.scenario import ScannerSettings


class Beams(NamedTuple):
    """The beams of one sweep, from right to left: angles (N,) rad and times after the stamp (N,) s."""

    angles_rad: FloatArray
    times_s: FloatArray

    @property
    def increment_rad(self) -> float:
        """Angle from beam to beam."""
        return float(self.angles_rad[1] - self.angles_rad[0])

    @property
    def time_increment_s(self) -> float:
        """Time from beam to beam; zero where all beams are measured at the stamp."""
        return float(self.times_s[1] - self.times_s[0])


def beams_of(settings: ScannerSettings) -> Beams:
    """Return the beams of a scanner: the mirror turns once a sweep, the field of view is a part of that turn."""
    half = math.radians(0.5 * settings.field_of_view_deg)
    angles = np.linspace(-half, half, settings.beams)
    increment_s = (angles[1] - angles[0]) / (2 * math.pi * settings.rate_hz) if settings.sweep else 0.0
    return Beams(angles, increment_s * np.arange(settings.beams))


class Rig(NamedTuple):
    """Geometry that the ray kernel needs: mount (4, 4), whether on the rear body, joint lengths (m), boxes of the bodies."""

    T_parent_sensor: FloatArray
    on_rear: bool
    joint_m: FloatArray
    front_boxes_m: FloatArray
    rear_boxes_m: FloatArray


def rig_of(machine: Machine, mount: SensorMount, *, occlusion: bool) -> Rig:
    """Return the rig of a scanner on a machine; without `occlusion` the bodies are transparent."""
    size = machine.dimensions
    none = np.empty((0, 2, 3))
    front, rear = (machine.boxes("base_link"), machine.boxes("rear_link")) if occlusion else (none, none)
    joint = np.array([size.joint_to_front_axle_m, size.joint_to_rear_axle_m])
    return Rig(mount.T_parent_sensor, mount.parent == "rear_link", joint, front, rear)


@nb.njit(cache=True)
def _base_pose(table: FloatArray, time_s: float) -> tuple[FloatArray, FloatArray, float]:
    """Return rotation (3, 3), position (3,) and articulation of `base_link` at a time."""
    position = min(max(time_s * TABLE_RATE_HZ, 0.0), table.shape[0] - 1.0)
    i = min(int(position), table.shape[0] - 2)
    share = position - i
    row = table[i] * (1.0 - share) + table[i + 1] * share
    cr, sr, cp, sp = math.cos(row[3]), math.sin(row[3]), math.cos(row[4]), math.sin(row[4])
    cy, sy = math.cos(row[5]), math.sin(row[5])
    R = np.empty((3, 3))
    R[0, 0], R[0, 1], R[0, 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    R[1, 0], R[1, 1], R[1, 2] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    R[2, 0], R[2, 1], R[2, 2] = -sp, cp * sr, cp * cr
    return R, row[:3].copy(), row[6]


@nb.njit(cache=True)
def _rear_in_base(bend: float, joint: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return rotation (3, 3) and position (3,) of `rear_link` in `base_link`."""
    c, s = math.cos(bend), math.sin(bend)
    R = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return R, np.array([-joint[0] - joint[1] * c, joint[1] * s, 0.0])


@nb.njit(cache=True)
def _into_boxes(start: FloatArray, direction: FloatArray, boxes: FloatArray) -> float:
    """Return the range at which a ray enters the nearest box, inf for none; a box that holds the start is passed over."""
    nearest = math.inf
    for box in boxes:
        enter, leave = -math.inf, math.inf
        for axis in range(3):
            inverse = 1.0 / direction[axis] if direction[axis] != 0.0 else 1e30
            a, b = (box[0, axis] - start[axis]) * inverse, (box[1, axis] - start[axis]) * inverse
            enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
        if 0.0 < enter <= leave:
            nearest = min(nearest, enter)
    return nearest


@nb.njit(cache=True, nogil=True)
def _fill_rays(table, stamps_s, beams, rig, origin, rays, blocked):  # type: ignore[no-untyped-def]
    """Fill `rays` (S·N, 6) in the frame at `origin` and `blocked` (S·N,), the range to the machine's own body."""
    T, on_rear, joint, front_boxes, rear_boxes = rig
    angles, times = beams
    count = angles.size
    R_ms, p_ms, R_bs, p_bs = T[:3, :3].copy(), T[:3, 3].copy(), T[:3, :3].copy(), T[:3, 3].copy()
    R_wb, p_wb, bend = _base_pose(table, stamps_s[0])
    R_br, p_br = _rear_in_base(bend, joint)
    for k in range(stamps_s.size):
        for i in range(count):
            if i == 0 or times[i] != times[i - 1]:
                R_wb, p_wb, bend = _base_pose(table, stamps_s[k] + times[i])
                R_br, p_br = _rear_in_base(bend, joint)
                if on_rear:
                    R_bs, p_bs = R_br @ R_ms, R_br @ p_ms + p_br
            beam = np.array([math.cos(angles[i]), math.sin(angles[i]), 0.0])
            direction_b = R_bs @ beam
            row = k * count + i
            rays[row, :3] = R_wb @ p_bs + p_wb - origin
            rays[row, 3:] = R_wb @ direction_b
            own = _into_boxes(p_bs, direction_b, front_boxes)
            if rear_boxes.shape[0] > 0:
                own = min(own, _into_boxes(R_br.T @ (p_bs - p_br), R_br.T @ direction_b, rear_boxes))
            blocked[row] = own


def rays_of(
    table: FloatArray, stamps_s: FloatArray, beams: Beams, rig: Rig, origin_m: FloatArray
) -> tuple[Float32Array, Float32Array]:
    """Return rays (S·N, 6), origin less `origin_m` and unit direction in `map`, and ranges to the own body (S·N,).

    `table` is a motion's (`lhdmap.simulation.driving.Motion`), `stamps_s` (S,) the times of the first beams.
    """
    rays = np.empty((stamps_s.size * beams.angles_rad.size, 6), dtype=np.float32)
    blocked = np.empty(len(rays), dtype=np.float32)
    _fill_rays(table, stamps_s, tuple(beams), tuple(rig), origin_m, rays, blocked)
    return rays, blocked


def measured(
    exact_m: Float32Array, settings: ScannerSettings, dust: FloatArray, rng: np.random.Generator
) -> Float32Array:
    """Return what the scanner reports for exact ranges (S, N): mixed pixels, dust, noise, drop-outs, range limits.

    `dust` (S,) is the share of beams that dust returns in each sweep.
    """
    ranges = exact_m.astype(float)
    if settings.mixed_pixel_share > 0.0:
        ranges = _mixed(ranges, settings.mixed_pixel_share, rng)
    if settings.dust_share > 0.0:
        near = 0.5 + rng.exponential(3.0, ranges.shape)
        ranges = np.where((rng.random(ranges.shape) < dust[:, None]) & (near < ranges), near, ranges)
    if settings.noise_m > 0.0:
        ranges += settings.noise_m * rng.standard_normal(ranges.shape)
    if settings.drop_out_share > 0.0:
        ranges[rng.random(ranges.shape) < settings.drop_out_share] = np.inf
    ranges[(ranges > settings.max_range_m) | (ranges < settings.min_range_m)] = np.inf
    return ranges.astype(np.float32)


def _mixed(ranges: FloatArray, share: float, rng: np.random.Generator) -> FloatArray:
    """Return ranges (S, N) in which a share of the beams beside a depth edge lies between its two surfaces."""
    seen = np.where(np.isfinite(ranges), ranges, 1e9)
    step = np.diff(seen, axis=1, append=seen[:, -1:])
    edge = (np.abs(step) > 0.3) & (np.abs(step) < 1e6) & (rng.random(ranges.shape) < share)
    return np.where(edge, ranges + rng.random(ranges.shape) * np.where(edge, step, 0.0), ranges)

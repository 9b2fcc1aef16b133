"""Scanners on the machine: rays from its pose at each beam's own time, then what spoils the ranges of a 2D scanner."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.machine import Machine, SensorMount
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.simulation.history import History
from lhdmap.simulation.ray_kernel import fill_rays
from lhdmap.simulation.sensing.sections import ScannerSettings
from lhdmap.simulation.surroundings import SurroundingsView

_PERSON_M = 1.2  # how near a person stands
_EDGE_M, _EDGE_OVER_NEIGHBOURS = (
    0.3,
    3.0,
)  # a depth edge is a step this large, and this much larger than those beside it
_NO_RETURN_M = 1e6


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
    angles: FloatArray = np.linspace(-half, half, settings.beams, dtype=float)
    increment_s = (angles[1] - angles[0]) / (2 * math.pi * settings.rate_hz) if settings.sweep else 0.0
    return Beams(angles, increment_s * np.arange(settings.beams, dtype=float))


class Rig(NamedTuple):
    """What the ray kernel needs: mount (4, 4), whether on the rear body, joint lengths (m), boxes of the bodies."""

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


class Sweep(NamedTuple):
    """The rays of one turn of a scanner: directions in its frame, shape (N, 3), and times after the stamp (N,), s, rising."""

    directions: FloatArray
    times_s: FloatArray


def sweep_of(beams: Beams) -> Sweep:
    """Return the rays of a 2D scanner."""
    angles = beams.angles_rad
    return Sweep(np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1), beams.times_s)


def sweep_ns(times_s: FloatArray) -> int:
    """Return when the last of the beams is measured for sure, ns after the stamp."""
    return math.floor(float(times_s[-1]) * 1e9) + 1 if times_s[-1] > 0.0 else 0


def rays_of(
    history: History, stamp_ns: int, sweep: Sweep, rig: Rig, origin_m: FloatArray
) -> tuple[Float32Array, Float32Array]:
    """Return rays (N, 6), origin less `origin_m` and unit direction in `map`, and ranges to the own body (N,)."""
    rays = np.empty((sweep.times_s.size, 6), dtype=np.float32)
    blocked = np.empty(len(rays), dtype=np.float32)
    parts = (rig.T_parent_sensor, rig.on_rear, rig.joint_m, rig.front_boxes_m, rig.rear_boxes_m)
    beams = (sweep.directions, sweep.times_s)
    fill_rays(history.rows, history.split(stamp_ns), history.rate_hz, beams, parts, origin_m, rays, blocked)
    return rays, blocked


def exact_ranges(history: History, world: SurroundingsView, stamp_ns: int, sweep: Sweep, rig: Rig) -> Float32Array:
    """Return exact ranges (N,), metres, inf for none, of the sweep that begins at a stamp."""
    surface = world.near(history.state(stamp_ns)[:3])
    rays, blocked = rays_of(history, stamp_ns, sweep, rig, surface.origin_m)
    return np.minimum(surface.cast(rays), blocked)


def obstructed(exact_m: Float32Array, time_s: FloatArray, settings: ScannerSettings) -> Float32Array:
    """Return exact ranges (S, N) as a person near by and blackouts leave them; `time_s` (S,) after the log's start."""
    ranges = exact_m.copy()
    for start_s, duration_s, share in settings.person:
        during = (time_s >= start_s) & (time_s < start_s + duration_s)
        beams = slice(0, round(share * ranges.shape[1]))
        ranges[during, beams] = np.minimum(ranges[during, beams], np.float32(_PERSON_M))
    for start_s, duration_s in settings.blackouts:
        ranges[(time_s >= start_s) & (time_s < start_s + duration_s)] = np.inf
    return ranges


def measured(
    exact_m: Float32Array, settings: ScannerSettings, dust: FloatArray, rng: np.random.Generator
) -> Float32Array:
    """Return what the scanner reports for exact ranges (S, N): mixed pixels, dust, noise, drop-outs, range limits.

    `dust` (S,) is the share of beams that dust returns in each sweep.
    """
    ranges = exact_m.astype(float)
    if settings.mixed_pixel_share > 0.0:
        ranges = _mixed(ranges, settings.mixed_pixel_share, rng)
    if dust.any():
        near = 0.5 + rng.exponential(3.0, ranges.shape)
        ranges = np.where((rng.random(ranges.shape) < dust[:, None]) & (near < ranges), near, ranges)
    if settings.noise_m > 0.0:
        ranges += settings.noise_m * rng.standard_normal(ranges.shape)
    if settings.drop_out_share > 0.0:
        ranges[rng.random(ranges.shape) < settings.drop_out_share] = np.inf
    ranges[(ranges > settings.max_range_m) | (ranges < settings.min_range_m)] = np.inf
    return ranges.astype(np.float32)


def _mixed(ranges: FloatArray, share: float, rng: np.random.Generator) -> FloatArray:
    """Return ranges (S, N) in which a share of the depth edges have a beam, on a random side, between their two surfaces."""
    seen = np.where(np.isfinite(ranges), ranges, 1e9)
    step = np.diff(seen, axis=1)
    mixed = _edges(np.abs(step)) & (rng.random(step.shape) < share)
    first = rng.random(step.shape) < 0.5
    between = seen[:, :-1] + rng.random(step.shape) * step
    out = ranges.copy()
    out[:, :-1] = np.where(mixed & first, between, out[:, :-1])
    out[:, 1:] = np.where(mixed & ~first, between, out[:, 1:])
    return out


def _edges(step_m: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which steps between beams, sizes (S, N - 1), are depth edges; on a grazed wall the steps beside are large, too."""
    padded = np.pad(step_m, ((0, 0), (1, 1)))
    beside = np.maximum(padded[:, :-2], padded[:, 2:])
    edges: npt.NDArray[np.bool_] = (
        (step_m > _EDGE_M) & (step_m > _EDGE_OVER_NEIGHBOURS * beside) & (step_m < _NO_RETURN_M)
    )
    return edges

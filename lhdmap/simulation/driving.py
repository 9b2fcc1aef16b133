"""The machine on the floor of the drift: its states over time (`lhdmap.simulation.history`); the truth of a simulated log.

The front axle follows its path without side slip, the rear follows by Eq. (1). Roll and pitch are those of the plane
through both front wheels' contacts and the middle of the rear axle (which swings, so that four wheels touch).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.kinematics import articulation_along_path
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.mine.centre_line import STEP_M, CentreLine, beside
from lhdmap.simulation.drift import Drift
from lhdmap.simulation.history import Column
from lhdmap.simulation.noise_field import Scales, noise_field
from lhdmap.simulation.sections import DriveSettings
from lhdmap.simulation.sensing.sections import WheelSettings
from lhdmap.simulation.timetable import Timetable

TABLE_RATE_HZ = 1000.0
BOOM_RAD, BUCKET_RAD = 0.0, 0.0
"""Tramming posture: boom down, bucket rolled back."""
_GRAVITY_MPS2, _ROLLING_RESISTANCE_MPS2 = 9.81, 0.3
_EVERY = 4  # of the path's samples the floor is asked for: 4 cm, far below a footprint
_FOOTPRINT_M = 0.25  # half length and width of the patch under a tyre that carries it


def drive_path(drift: Drift, settings: DriveSettings, rng: np.random.Generator) -> CentreLine:
    """Return the path of the front axle: the centre line with some slow wandering to either side."""
    line = drift.line
    field = noise_field(rng, Scales(2, 9.0, 0.4), (0.0, line.length_m), (0.0, 1.0))
    field.normalise(line.s_m[::50], np.zeros(1), settings.wander_m)
    return beside(line, field.grid(line.s_m, np.zeros(1))[:, 0])


class Plan(NamedTuple):
    """Where and when to drive: path of the front axle, place on it where the drive starts (m), timetable."""

    path: CentreLine
    start_m: float
    timetable: Timetable


def simulate_motion(drift: Drift, plan: Plan, machine: Machine, shaking: Shaking) -> FloatArray:
    """Return the motion of `machine` over the floor of `drift` as planned: rows (N, 20) of a history at `TABLE_RATE_HZ`.

    The wheels do not slip: their speed is that of the machine.
    """
    path, timetable = plan.path, plan.timetable
    time_s = np.arange(int(timetable.duration_s * TABLE_RATE_HZ) + 1) / TABLE_RATE_HZ
    on_path = _poses_on_path(drift, path, machine)
    way_m = np.concatenate([[0.0], np.cumsum(np.hypot(STEP_M, np.diff(on_path[:, 2])))])
    way_m -= np.interp(plan.start_m, path.s_m, way_m)
    driven_m, speed_mps = timetable.at(time_s)
    s_m = np.interp(driven_m, way_m, path.s_m)
    rows = np.zeros((len(time_s), len(Column)))
    for column, values in enumerate(on_path.T):
        rows[:, column] = np.interp(s_m, path.s_m, values)
    rows[:, Column.ROLL : Column.PITCH + 1] += shaking.angles(len(time_s))
    rows[:, Column.SPEED] = rows[:, Column.WHEEL_SPEED] = speed_mps
    rows[:, Column.ARTICULATION_RATE] = np.gradient(rows[:, Column.ARTICULATION]) * TABLE_RATE_HZ
    rows[:, Column.BOOM], rows[:, Column.BUCKET] = BOOM_RAD, BUCKET_RAD
    rows[:, Column.TRACTION] = _traction(speed_mps, rows[:, Column.PITCH])
    return rows


def _traction(speed_mps: FloatArray, pitch_rad: FloatArray) -> FloatArray:
    """Return what the wheels give (m/s²): speeding up, climbing and rolling resistance; at rest the brakes hold."""
    needed = np.gradient(speed_mps) * TABLE_RATE_HZ - _GRAVITY_MPS2 * np.sin(pitch_rad)
    direction = np.sign(speed_mps)
    return (needed + _ROLLING_RESISTANCE_MPS2 * direction) * np.abs(direction)


def slip_factors(settings: WheelSettings, time_s: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the speed of the drive line over that of the machine, shape (N,): more than one in bursts, where wanted."""
    factors = np.ones(len(time_s))
    for start_s in _slip_bursts(settings, float(time_s[-1]), rng):
        factors[(time_s >= start_s) & (time_s < start_s + settings.slip_burst_s)] += settings.slip_size
    return factors


def _slip_bursts(settings: WheelSettings, duration_s: float, rng: np.random.Generator) -> list[float]:
    """Return the starts (s) of the slip bursts: at chance, never overlapping, at least one where slip is wanted."""
    if not settings.slip:
        return []
    starts, at = [], rng.uniform(0.2, 0.8) * min(settings.slip_every_s, duration_s)
    while at < duration_s:
        starts.append(at)
        at += settings.slip_burst_s + rng.exponential(max(settings.slip_every_s - settings.slip_burst_s, 0.1))
    return starts


class Shaking(NamedTuple):
    """Vibration of the front body by engine and road: standard deviation (rad) and its source of chance."""

    size_rad: float
    rng: np.random.Generator

    def angles(self, count: int) -> FloatArray:
        """Return roll and pitch, shape (count, 2), rad, at `TABLE_RATE_HZ`: noise around 6 Hz."""
        if self.size_rad == 0.0:
            return np.zeros((count, 2))
        from scipy.signal import butter, sosfilt

        white = self.rng.standard_normal((count + 2000, 2))
        band = sosfilt(butter(2, (4.0, 9.0), "bandpass", fs=TABLE_RATE_HZ, output="sos"), white, axis=0)[2000:]
        return self.size_rad * band / band.std(axis=0)


def _poses_on_path(drift: Drift, path: CentreLine, machine: Machine) -> FloatArray:
    """Return x, y, z, roll, pitch, yaw, articulation, shape (N, 7), for the front axle at each sample of the path."""
    size = machine.dimensions
    bend = articulation_along_path(path.curvature_pm, STEP_M, size.joint_to_front_axle_m, size.joint_to_rear_axle_m)
    rear_x = -size.joint_to_front_axle_m - size.joint_to_rear_axle_m * np.cos(bend)
    rear_y = size.joint_to_rear_axle_m * np.sin(bend)
    half, sine, cosine = 0.5 * size.track_m, np.sin(bend), np.cos(bend)
    ground = _Ground(drift, path)
    left, right = ground.height(0.0 * bend, 0.0 * bend + half), ground.height(0.0 * bend, 0.0 * bend - half)
    rear = 0.5 * (
        ground.height(rear_x + half * sine, rear_y + half * cosine)
        + ground.height(rear_x - half * sine, rear_y - half * cosine)
    )
    z, cross_slope = 0.5 * (left + right), (left - right) / size.track_m
    slope = (rear - z - cross_slope * rear_y) / rear_x
    pitch = -np.arctan(slope)
    roll = np.arctan(cross_slope * np.cos(pitch))
    return np.stack([path.x_m, path.y_m, z, roll, pitch, path.heading_rad, bend], axis=1)


class _Ground:
    """Height of the floor under points that are given in the (level) frame of the front axle along a path."""

    def __init__(self, drift: Drift, path: CentreLine) -> None:
        self._drift, self._path = drift, path
        self._picked = np.append(np.arange(0, len(path.s_m) - 1, _EVERY), len(path.s_m) - 1)

    def height(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Return the floor's height (m), averaged over a tyre's footprint, for a point per sample of the path."""
        path, picked = self._path, self._picked
        c, s = np.cos(path.heading_rad[picked]), np.sin(path.heading_rad[picked])
        x, y = x_m[picked], y_m[picked]
        place, lateral = self._project(
            path.x_m[picked] + c * x - s * y, path.y_m[picked] + s * x + c * y, path.s_m[picked] + x
        )
        line_z = np.interp(place, self._drift.line.s_m, self._drift.line.z_m)
        offsets = np.array([-1.0, 0.0, 1.0]) * _FOOTPRINT_M
        patch = [self._drift.floor_offset(place + along, lateral + across) for along in offsets for across in offsets]
        return np.interp(path.s_m, path.s_m[picked], line_z + np.mean(patch, axis=0))

    def _project(self, x_m: FloatArray, y_m: FloatArray, guess_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return arc length and lateral offset on the drift's centre line, by a few Newton steps from `guess_m`."""
        line, place = self._drift.line, guess_m.copy()
        for _ in range(6):
            at = line.at(place)
            place = place + (x_m - at[:, 0]) * np.cos(at[:, 3]) + (y_m - at[:, 1]) * np.sin(at[:, 3])
        at = line.at(place)
        return place, (y_m - at[:, 1]) * np.cos(at[:, 3]) - (x_m - at[:, 0]) * np.sin(at[:, 3])

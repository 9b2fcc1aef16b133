"""The inclinometer of the front body, and the inertial sensors beside it."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.geometry import se3
from lhdmap.machine import SensorMount
from lhdmap.messages import FloatArray, Inclination, Record
from lhdmap.roles import ROLES
from lhdmap.simulation.history import SECOND_NS, Column, History
from lhdmap.simulation.sensing.chance import Chance
from lhdmap.simulation.sensing.sections import ImuSettings, InclinometerSettings
from lhdmap.simulation.sensing.sensor import Beat
from lhdmap.simulation.surroundings import SurroundingsView

_GRAVITY_MPS2 = 9.81
_GYRO_NS, _ACCELEROMETER_NS = 10_000_000, 20_000_000
_ANGLES = slice(Column.ROLL, Column.PITCH + 1)


class Inclinometer:
    """Roll and pitch of the front body, late, noisy and biased; angular velocity and acceleration where wanted.

    The gyroscope gives the mean over the 10 ms before the stamp; the accelerometer the mean over the 40 ms before it, most of
    it from their middle. Both are in the sensor's frame, the acceleration with gravity (9.81 m/s² upwards at rest).
    """

    def __init__(self, settings: InclinometerSettings, imu: ImuSettings, mount: SensorMount, seed: int) -> None:
        self.name, self.topic = "inclinometer", ROLES["inclinometer"].topic
        self._settings, self._imu, self._beat = settings, imu, Beat(settings.rate_hz)
        self._chance, self._lag = Chance(seed, self.name), _lag_of(settings)
        self._bias = np.radians([settings.bias_roll_deg, settings.bias_pitch_deg])
        self._T_base_sensor = mount.T_parent_sensor
        first = Chance(seed, "imu").once().standard_normal((2, 3))
        self._gyro_bias = math.radians(imu.gyro_bias_dps) * first[0]
        self._acceleration_bias = imu.acceleration_bias_mps2 * first[1]

    @property
    def next_ns(self) -> int:
        """Log time of the next reading."""
        return self._beat.stamp_ns

    def read(self, history: History, world: SurroundingsView) -> list[Record]:
        """Return the reading that is due."""
        stamp_ns, rng = self._beat.stamp_ns, self._chance.of(self._beat.index)
        noise = math.radians(self._settings.noise_deg) * rng.standard_normal(2)
        roll, pitch = (self._lag.at(history, stamp_ns) + self._bias + noise).tolist()
        rate = self._angular_velocity(history, stamp_ns, rng) if self._imu.gyro else None
        acceleration = self._acceleration(history, stamp_ns, rng) if self._imu.accelerometer else None
        self._beat.advance()
        return [Record(self.topic, stamp_ns, Inclination(stamp_ns, self.name, roll, pitch, rate, acceleration))]

    def _angular_velocity(self, history: History, stamp_ns: int, rng: np.random.Generator) -> FloatArray:
        imu, draws = self._imu, rng.standard_normal((2, 3))
        before, now = history.state(stamp_ns - _GYRO_NS)[3:6], history.state(stamp_ns)[3:6]
        true = _body_rates(0.5 * (before + now), (now - before) * (SECOND_NS / _GYRO_NS))
        self._gyro_bias = self._gyro_bias + self._step(imu.gyro_walk_dps) * np.radians(draws[0])
        measured: FloatArray = self._T_base_sensor[:3, :3].T @ true + self._gyro_bias
        return measured + math.radians(imu.gyro_noise_dps) * draws[1]

    def _acceleration(self, history: History, stamp_ns: int, rng: np.random.Generator) -> FloatArray:
        imu, draws = self._imu, rng.standard_normal((2, 3))
        states = [history.state(stamp_ns - back * _ACCELEROMETER_NS) for back in (2, 1, 0)]
        poses = [se3.from_rpy(s[3], s[4], s[5], (s[0], s[1], s[2])) @ self._T_base_sensor for s in states]
        first, middle, last = (pose[:3, 3] for pose in poses)
        felt = (last - 2.0 * middle + first) / (_ACCELEROMETER_NS / SECOND_NS) ** 2 + [0.0, 0.0, _GRAVITY_MPS2]
        self._acceleration_bias = self._acceleration_bias + self._step(imu.acceleration_walk_mps2) * draws[0]
        shaking = imu.vibration_mps2 + imu.road_mps2 * abs(float(states[2][Column.SPEED]))
        measured: FloatArray = poses[1][:3, :3].T @ felt + self._acceleration_bias
        return measured + math.hypot(imu.acceleration_noise_mps2, shaking) * draws[1]

    def _step(self, walk: float) -> float:
        """Return the standard deviation of a step of a random walk from reading to reading."""
        return walk / math.sqrt(self._beat.rate_hz)


def _body_rates(rpy_rad: FloatArray, rpy_rate_rps: FloatArray) -> FloatArray:
    """Return the angular velocity in the body's frame, shape (3,), rad/s."""
    (roll, pitch, _), (p, q, r) = rpy_rad.tolist(), rpy_rate_rps.tolist()
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    return np.array([p - sp * r, cr * q + sr * cp * r, -sr * q + cr * cp * r])


class _Delay:
    """Angles as they were a while ago."""

    def __init__(self, lag_s: float) -> None:
        self._lag_ns = round(lag_s * SECOND_NS)

    def at(self, history: History, stamp_ns: int) -> FloatArray:
        """Return roll and pitch that show at a stamp, shape (2,)."""
        return history.state(stamp_ns - self._lag_ns)[_ANGLES]


class _FirstOrder:
    """A low pass of first order, exact for angles that are linear between the rows; it goes through the rows one by one."""

    def __init__(self, lag_s: float) -> None:
        self._lag_s, self._next = lag_s, 0  # index of the next row, from the start of the clock
        self._filtered = np.zeros((2, 2))  # at the last row but one, and at the last

    def at(self, history: History, stamp_ns: int) -> FloatArray:
        """Return roll and pitch that show at a stamp, shape (2,); stamps must rise."""
        index, share = history.split(stamp_ns)
        rows, first = history.rows, history.first_index
        if self._next == 0:
            self._filtered[:] = rows[0, _ANGLES]
            self._next = 1
        upto = first + index + (1 if share > 0.0 else 0)
        if upto >= self._next:
            if self._next <= first:
                raise ValueError("a filter was not read for longer than the history lasts: keep_s must be larger")
            step = 1.0 / (history.rate_hz * self._lag_s)
            keep = math.exp(-step)
            now = 1.0 - (1.0 - keep) / step
            _follow(rows, self._next - first, upto - first, (keep, 1.0 - keep - now, now), self._filtered)
            self._next = upto + 1
        return (
            self._filtered[0] * (1.0 - share) + self._filtered[1] * share if share > 0.0 else self._filtered[1].copy()
        )


@nb.njit(cache=True, nogil=True)
def _follow(rows: FloatArray, first: int, last: int, weights: tuple[float, float, float], filtered: FloatArray) -> None:
    """Filter roll and pitch of rows `first` to `last`: `filtered` (2, 2) has the two last results."""
    keep, before, now = weights
    for k in range(first, last + 1):
        for axis in range(2):
            value = keep * filtered[1, axis] + before * rows[k - 1, 3 + axis] + now * rows[k, 3 + axis]
            filtered[0, axis], filtered[1, axis] = filtered[1, axis], value


def _lag_of(settings: InclinometerSettings) -> _Delay | _FirstOrder:
    if settings.lag_kind == "delay" or settings.lag_s == 0.0:
        return _Delay(settings.lag_s)
    return _FirstOrder(settings.lag_s)

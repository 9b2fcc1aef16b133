"""The other sensors of the machine: inclinometer, joint encoders, tachometer, transmission pressure, operation mode."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray, Inclination, Joints, Pressure, Record, Tachometer, Text
from lhdmap.roles import recorded
from lhdmap.simulation.driving import TABLE_RATE_HZ, Motion, interpolated
from lhdmap.simulation.sections import InclinometerSettings, WheelSettings

BOOM_LIFT_RAD, BUCKET_TILT_RAD = -0.35, 0.6  # tramming posture: boom down, bucket rolled back
_PRESSURE_RATE_HZ = 20.0
_IDLE_PA, _PER_ACCELERATION_PA, _GRAVITY_MPS2 = 6.0e6, 8.0e6, 9.81
_ROLLING_RESISTANCE_MPS2 = 0.3


class Clock(NamedTuple):
    """Stamps of a sensor: the log's first stamp (ns) and, of each reading, the time after it."""

    start_ns: int

    def stamps_ns(self, duration_s: float, rate_hz: float, offset_s: float = 0.0) -> npt.NDArray[np.int64]:
        """Return stamps, shape (N,), at `rate_hz` over `duration_s`, the first after `offset_s`."""
        count = max(int((duration_s - offset_s) * rate_hz + 1e-6) + 1, 0)
        times_ns = np.rint((offset_s + np.arange(count) / rate_hz) * 1e9).astype(np.int64)
        return self.start_ns + times_ns

    def seconds(self, stamps_ns: npt.NDArray[np.int64]) -> FloatArray:
        """Return seconds after the log's start."""
        return (stamps_ns - self.start_ns).astype(np.float64) * 1e-9


def inclinations(
    settings: InclinometerSettings, motion: Motion, clock: Clock, rng: np.random.Generator
) -> Iterator[Record]:
    """Yield the inclinometer's readings: lagging behind the truth, noisy, biased."""
    stamps_ns = clock.stamps_ns(motion.duration_s, settings.rate_hz)
    angles = lagging(motion.table[:, 3:5], settings, clock.seconds(stamps_ns))
    angles += np.radians([settings.bias_roll_deg, settings.bias_pitch_deg])
    angles += math.radians(settings.noise_deg) * rng.standard_normal(angles.shape)
    for stamp, (roll, pitch) in zip(stamps_ns.tolist(), angles.tolist(), strict=True):
        yield recorded("inclinometer", stamp, Inclination(stamp, "inclinometer", roll, pitch, None, None))


def lagging(angles_rad: FloatArray, settings: InclinometerSettings, time_s: FloatArray) -> FloatArray:
    """Return angles (M, 2) at `time_s` as a lagging sensor shows them; `angles_rad` (N, 2) at the table's rate."""
    if settings.lag_kind == "delay" or settings.lag_s == 0.0:
        return interpolated(angles_rad, time_s - settings.lag_s)
    from scipy.signal import lfilter

    keep = math.exp(-1.0 / (TABLE_RATE_HZ * settings.lag_s))
    filtered, _ = lfilter([1.0 - keep], [1.0, -keep], angles_rad, axis=0, zi=keep * angles_rad[:1])
    return interpolated(filtered, time_s)


def joint_readings(settings: WheelSettings, motion: Motion, clock: Clock, rng: np.random.Generator) -> Iterator[Record]:
    """Yield the joint encoders' readings; boom and bucket rest in the tramming posture."""
    stamps_ns = clock.stamps_ns(motion.duration_s, settings.rate_hz)
    time_s = clock.seconds(stamps_ns)
    noise = math.radians(settings.articulation_noise_deg)
    bend = motion.at(time_s)[:, 6] + noise * rng.standard_normal(len(time_s))
    rate = interpolated(np.gradient(motion.table[:, 6]) * TABLE_RATE_HZ, time_s)
    rate = rate + 2.0 * noise * rng.standard_normal(len(time_s))
    arm = np.array([BOOM_LIFT_RAD, BUCKET_TILT_RAD]) + noise * rng.standard_normal((len(time_s), 2))
    for stamp, angle, speed, (boom, bucket) in zip(
        stamps_ns.tolist(), bend.tolist(), rate.tolist(), arm.tolist(), strict=True
    ):
        positions = {"articulation": angle, "boom_lift": boom, "bucket_tilt": bucket}
        speeds = {"articulation": speed, "boom_lift": 0.0, "bucket_tilt": 0.0}
        yield recorded("joints", stamp, Joints(stamp, positions, speeds))


def tachometer_readings(
    settings: WheelSettings, motion: Motion, clock: Clock, rng: np.random.Generator
) -> Iterator[Record]:
    """Yield the tachometer's readings: drive-line speed with a scale error, noise and, where wanted, slip bursts."""
    stamps_ns = clock.stamps_ns(motion.duration_s, settings.rate_hz, offset_s=0.003)
    time_s = clock.seconds(stamps_ns)
    scale = 1.0 + settings.scale_error * (1.0 if rng.random() < 0.5 else -1.0)
    speed = interpolated(motion.speed_mps, time_s) * scale
    for start_s in slip_bursts(settings, motion.duration_s, rng):
        speed[(time_s >= start_s) & (time_s < start_s + settings.slip_burst_s)] *= 1.0 + settings.slip_size
    moving = np.abs(speed) > 0.0
    speed = speed + settings.noise_mps * rng.standard_normal(len(time_s)) * moving
    for stamp, value in zip(stamps_ns.tolist(), speed.tolist(), strict=True):
        yield recorded("tachometer", stamp, Tachometer(stamp, value))


def slip_bursts(settings: WheelSettings, duration_s: float, rng: np.random.Generator) -> list[float]:
    """Return the starts (s) of the slip bursts: at chance, never overlapping, at least one where slip is wanted."""
    if not settings.slip:
        return []
    starts, at = [], rng.uniform(0.2, 0.8) * min(settings.slip_every_s, duration_s)
    while at < duration_s:
        starts.append(at)
        at += settings.slip_burst_s + rng.exponential(max(settings.slip_every_s - settings.slip_burst_s, 0.1))
    return starts


def pressure_readings(motion: Motion, clock: Clock, rng: np.random.Generator) -> Iterator[Record]:
    """Yield the transmission's pressure: idle, plus what acceleration, grade and rolling resistance ask for."""
    stamps_ns = clock.stamps_ns(motion.duration_s, _PRESSURE_RATE_HZ, offset_s=0.007)
    time_s = clock.seconds(stamps_ns)
    acceleration = interpolated(np.gradient(motion.speed_mps) * TABLE_RATE_HZ, time_s)
    direction = np.sign(interpolated(motion.speed_mps, time_s))
    climb = -_GRAVITY_MPS2 * np.sin(motion.at(time_s)[:, 4])
    demand = np.maximum(direction * (acceleration + climb) + _ROLLING_RESISTANCE_MPS2 * np.abs(direction), 0.0)
    pressure = _IDLE_PA + _PER_ACCELERATION_PA * demand + 2.0e5 * rng.standard_normal(len(time_s))
    for stamp, value in zip(stamps_ns.tolist(), pressure.tolist(), strict=True):
        yield recorded("transmission_pressure", stamp, Pressure(stamp, value))


def mode_messages(motion: Motion, clock: Clock) -> Iterator[Record]:
    """Yield the operation mode once a second: a person drives."""
    for stamp in clock.stamps_ns(motion.duration_s, 1.0).tolist():
        yield recorded("mode", stamp, Text(stamp, "manual"))

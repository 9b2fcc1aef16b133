"""How far the machine has come at what time: legs between stops, each with start and stop ramps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.simulation.sections import DriveSettings

_STEP_M = 0.01


class Timetable(NamedTuple):
    """Nodes of the motion, all shape (N,): between two nodes the acceleration is constant.

    `time_s` from the log's start; `way_m` along the floor (it falls in reverse); `speed_mps` signed.
    """

    time_s: FloatArray
    way_m: FloatArray
    speed_mps: FloatArray

    @property
    def duration_s(self) -> float:
        """Time of the last node, seconds."""
        return float(self.time_s[-1])

    def at(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the way (m) and the signed speed (m/s) at the given times; at rest before and after."""
        index = np.clip(np.searchsorted(self.time_s, time_s, side="right") - 1, 0, len(self.time_s) - 2)
        span = self.time_s[index + 1] - self.time_s[index]
        passed = np.clip(time_s - self.time_s[index], 0.0, span)
        start, end = self.speed_mps[index], self.speed_mps[index + 1]
        acceleration = np.divide(end - start, span, out=np.zeros_like(span), where=span > 0)
        return self.way_m[index] + passed * (start + 0.5 * acceleration * passed), start + acceleration * passed


def timetable(settings: DriveSettings, rng: np.random.Generator) -> Timetable:
    """Return the motion of a drive: legs between stops and turning points."""
    times, places, speeds = [np.zeros(1)], [np.zeros(1)], [np.zeros(1)]
    phase = rng.uniform(0.0, 2 * np.pi, 3)
    clock, place = settings.standstill_s, 0.0
    for target, rest_s in _targets(settings):
        time_s, way_m, speed_mps = _leg(settings, place, target, phase)
        times.append(clock + time_s)
        places.append(way_m)
        speeds.append(speed_mps)
        clock, place = clock + float(time_s[-1]) + rest_s, target
    times.append(np.array([clock]))
    places.append(np.array([place]))
    speeds.append(np.zeros(1))
    return Timetable(np.concatenate(times), np.concatenate(places), np.concatenate(speeds))


def _targets(settings: DriveSettings) -> list[tuple[float, float]]:
    """Return the places (m) where the machine comes to rest, in the order of the drive, and for how long (s)."""
    pause = 1.0
    events = [(at, [(at, rest)]) for at, rest in settings.stops]
    events += [(at, [(at, pause), (max(at - back, 0.0), pause)]) for at, back in settings.reversals]
    inside = [(at, places) for at, places in sorted(events, key=lambda event: event[0]) if 0 < at < settings.distance_m]
    stops = [place for _, places in inside for place in places]
    return [*stops, (settings.distance_m, settings.standstill_s)]


def _leg(settings: DriveSettings, start_m: float, end_m: float, phase: FloatArray) -> tuple[FloatArray, ...]:
    """Return times (from zero), places and signed speeds of one leg from rest to rest."""
    length = abs(end_m - start_m)
    count = max(int(np.ceil(length / _STEP_M)), 2)
    way = np.linspace(0.0, length, count + 1)
    waves = sum(
        np.sin(2 * np.pi * way / period + shift) for period, shift in zip((31.0, 17.0, 7.3), phase, strict=True)
    )
    wanted = settings.speed_kmh / 3.6 * (1.0 + settings.speed_variation * waves / np.sqrt(1.5))
    ramp = np.sqrt(2.0 * settings.acceleration_mps2 * np.minimum(way, length - way))
    speed = np.minimum(wanted, ramp)
    steps = 2.0 * np.diff(way) / (speed[1:] + speed[:-1])  # exact where the acceleration is constant
    sign = 1.0 if end_m >= start_m else -1.0
    return np.concatenate([[0.0], np.cumsum(steps)]), start_m + sign * way, sign * speed

"""The 2D scanners of the machine, and its 3D scanner."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import Float32Array, LaserScan, PointCloud, Record
from lhdmap.roles import ROLES
from lhdmap.simulation.history import SECOND_NS, START_NS, History
from lhdmap.simulation.scanner import Rig, Sweep, beams_of, exact_ranges, measured, obstructed, sweep_ns, sweep_of
from lhdmap.simulation.sensing.chance import Chance
from lhdmap.simulation.sensing.sections import CloudSettings, ScannerSettings
from lhdmap.simulation.sensing.sensor import Beat
from lhdmap.simulation.surroundings import SurroundingsView


class Scanner:
    """A 2D scanner: a scan is complete when its last beam is measured."""

    def __init__(self, name: str, settings: ScannerSettings, rig: Rig, seed: int, *, phase: float = 0.0) -> None:
        """`name` is that of its role; its sweeps begin a share `phase` of a sweep after the start."""
        self.name, self.topic, self.frame_id = name, ROLES[name].topic, f"lidar_{name}"
        self.beams, self.rig = beams_of(settings), rig
        self.beat = Beat(settings.rate_hz, phase / settings.rate_hz)
        self.sweep_ns = sweep_ns(self.beams.times_s)
        self._settings, self._sweep, self._chance = settings, sweep_of(self.beams), Chance(seed, name)
        self._dust = Dust(settings.dust_share, seed)

    @property
    def next_ns(self) -> int:
        """Log time of the next scan."""
        return self.beat.stamp_ns + self.sweep_ns

    def read(self, history: History, world: SurroundingsView) -> list[Record]:
        """Return the scan that is due."""
        stamp_ns, due_ns = self.beat.stamp_ns, self.next_ns
        time_s = np.array([(stamp_ns - START_NS) / SECOND_NS])
        exact = obstructed(self.exact_m(history, world, stamp_ns)[None], time_s, self._settings)
        hanging = world.dust(history.state(stamp_ns)[:3])
        dust = np.array([max(self._dust.share(float(time_s[0])), hanging)])
        ranges = measured(exact, self._settings, dust, self._chance.of(self.beat.index))[0]
        self.beat.advance()
        return [Record(self.topic, due_ns, self._scan(stamp_ns, ranges))]

    def exact_m(self, history: History, world: SurroundingsView, stamp_ns: int) -> Float32Array:
        """Return exact ranges, shape (N,), metres, inf for none, of a scan."""
        return exact_ranges(history, world, stamp_ns, self._sweep, self.rig)

    def _scan(self, stamp_ns: int, ranges_m: Float32Array) -> LaserScan:
        beams, settings = self.beams, self._settings
        first, step, pause_s = float(beams.angles_rad[0]), beams.increment_rad, beams.time_increment_s
        low_m, high_m = settings.min_range_m, settings.max_range_m
        return LaserScan(stamp_ns, self.frame_id, first, step, pause_s, low_m, high_m, ranges_m)


class Dust:
    """Clouds of dust that come and go in seconds, the same for all scanners of a machine."""

    def __init__(self, mean_share: float, seed: int) -> None:
        self._mean = mean_share
        self._phases = Chance(seed, "dust").once().uniform(0.0, 2 * math.pi, 2).tolist()

    def share(self, time_s: float) -> float:
        """Return the share of beams that dust returns at a time."""
        slow, fast = self._phases
        wave = 0.6 * math.sin(2 * math.pi * time_s / 7.0 + slow) + 0.4 * math.sin(2 * math.pi * time_s / 2.3 + fast)
        return min(max(self._mean * (1.0 + wave), 0.0), 1.0)


class CloudScanner:
    """A spinning 3D scanner: all rings of a column at once, columns one after the other; the cloud has the hits only."""

    def __init__(self, settings: CloudSettings, rig: Rig, seed: int) -> None:
        self.name, self.topic = "points", ROLES["points"].topic
        self._settings, self._rig, self._chance = settings, rig, Chance(seed, self.name)
        self._sweep, self._beat = turn_of(settings), Beat(settings.rate_hz)
        self._sweep_ns = sweep_ns(self._sweep.times_s)

    @property
    def next_ns(self) -> int:
        """Log time of the next cloud."""
        return self._beat.stamp_ns + self._sweep_ns

    def read(self, history: History, world: SurroundingsView) -> list[Record]:
        """Return the cloud that is due."""
        stamp_ns, due_ns, settings = self._beat.stamp_ns, self.next_ns, self._settings
        rng = self._chance.of(self._beat.index)
        ranges = exact_ranges(history, world, stamp_ns, self._sweep, self._rig).astype(float)
        ranges += settings.noise_m * rng.standard_normal(ranges.size)
        seen = (ranges >= settings.min_range_m) & (ranges <= settings.max_range_m)
        seen &= rng.random(ranges.size) >= settings.drop_out_share
        self._beat.advance()
        points = (self._sweep.directions[seen] * ranges[seen, None]).astype(np.float32)
        times = self._sweep.times_s[seen].astype(np.float32)
        return [Record(self.topic, due_ns, PointCloud(stamp_ns, "lidar_points", points, times))]


def turn_of(settings: CloudSettings) -> Sweep:
    """Return the rays of a turn, from straight behind to the left, as most drivers cut it."""
    rise = np.radians(np.linspace(settings.lowest_deg, settings.highest_deg, settings.rings))
    share = np.repeat(np.arange(settings.columns) / settings.columns, settings.rings)
    azimuth, height = 2 * np.pi * share - np.pi, np.tile(rise, settings.columns)
    level = np.cos(height)
    directions = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(height)], axis=1)
    return Sweep(np.ascontiguousarray(directions), share / settings.rate_hz)

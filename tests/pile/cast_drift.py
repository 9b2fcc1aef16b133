"""A drift made of planes, driven through by a machine with a tilted plane scanner: each hit is computed, nothing is meshed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from lhdmap.geometry.se3 import from_rpy
from lhdmap.messages import FloatArray
from lhdmap.pile.face import FaceRegistration
from lhdmap.pile.result import PileReport, Snapshot
from lhdmap.pile.settings import PileSettings
from lhdmap.pile.stage import PileStage, ScanHits

TOE_M = 36.0
STEP_M = 0.1
SCANNER_M = (1.5, 0.0, 1.8)
TILT_RAD = math.radians(2.5)
BEAMS_RAD = np.radians(np.arange(-95.0, 95.01, 0.5))
REACH_M = 45.0
EXACT = FaceRegistration(2e-4, math.radians(0.05))
Segments = tuple[tuple[float, float, float, float], ...]


@dataclass(frozen=True)
class Box:
    """A rock: lower and upper corner (m, the drift's frame)."""

    lower_m: tuple[float, float, float]
    upper_m: tuple[float, float, float]

    def ranges(self, origin: FloatArray, rays: FloatArray) -> FloatArray:
        """Return the range of each ray (N, 3) to the box, infinite where it misses."""
        with np.errstate(divide="ignore", invalid="ignore"):
            first, second = ((np.array(corner) - origin) / rays for corner in (self.lower_m, self.upper_m))
        enter, leave = np.minimum(first, second).max(axis=1), np.maximum(first, second).min(axis=1)
        return np.where((enter < leave) & (enter > 0.0), enter, np.inf)


@dataclass(frozen=True)
class CastDrift:
    """Walls at y = +-width/2 along x, floor z = grade x, a face that rises from a toe at x = 36 m; `slope_deg` None: none.

    `walls`: other walls instead, rows x, y, x, y. `turn_rad`, `shift_m`: where the whole lies in the map. `wave_rad`: how far the
    machine pitches as it drives. `tilt_error_rad`: how much lower the scanner looks than the hits are computed with.
    """

    slope_deg: float | None = 45.0
    width_m: float = 4.0
    grade: float = 0.0
    turn_rad: float = 0.0
    shift_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wave_rad: float = math.radians(0.6)
    noise_m: float = 0.01
    tilt_error_rad: float = 0.0
    offset_m: float = 0.2
    rocks: tuple[Box, ...] = ()
    walls: Segments = field(default=())

    def scans(self, from_m: float = 0.0, to_m: float = 28.0) -> Iterator[ScanHits]:
        """Yield the scans of a drive from x to x."""
        rng = np.random.default_rng(3)
        T = from_rpy(0.0, 0.0, self.turn_rad)
        T[:3, 3] = self.shift_m
        for number, x in enumerate(np.arange(from_m, to_m, STEP_M)):
            pitch = self.wave_rad * math.sin(2.0 * math.pi * x / 7.0)
            hits = self._hits(float(x), pitch, rng) @ T[:3, :3].T + T[:3, 3]
            base = T[:3, :3] @ np.array([x, self.offset_m, self.grade * x]) + T[:3, 3]
            yield ScanHits(number * 100_000_000, hits, np.array([*base, self.turn_rad]))

    def in_drift(self, point_map: FloatArray) -> FloatArray:
        """Return a point (3,) of the map in the drift's frame."""
        turned: FloatArray = from_rpy(0.0, 0.0, -self.turn_rad)[:3, :3] @ (point_map - np.array(self.shift_m))
        return turned

    def _hits(self, x: float, pitch: float, rng: np.random.Generator) -> FloatArray:
        """Return the hits of a scan (N, 3), placed with the tilt that is believed; rays that meet nothing are left out."""
        down = TILT_RAD + pitch - math.atan(self.grade)
        base = np.array([x, self.offset_m, self.grade * x])
        true, believed = (_pose(base, angle, pitch) for angle in (down + self.tilt_error_rad, down))
        beams = np.column_stack([np.cos(BEAMS_RAD), np.sin(BEAMS_RAD), np.zeros(len(BEAMS_RAD))])
        ranges = self._ranges(true[:3, 3], beams @ true[:3, :3].T) + rng.normal(0.0, self.noise_m, len(beams))
        seen = ranges < REACH_M
        placed: FloatArray = (beams[seen] * ranges[seen, None]) @ believed[:3, :3].T + believed[:3, 3]
        return placed

    def _ranges(self, origin: FloatArray, rays: FloatArray) -> FloatArray:
        half = self.width_m / 2
        sides = self.walls or ((-20.0, half, 300.0, half), (-20.0, -half, 300.0, -half))
        found = [_to_plane(origin, rays, np.array([-self.grade, 0.0, 1.0]), 0.0)]
        found += [_to_segment(origin, rays, side) for side in sides]
        found += [rock.ranges(origin, rays) for rock in self.rocks]
        if self.slope_deg is not None:
            slope = math.radians(self.slope_deg)
            normal = np.array([math.sin(slope), 0.0, -math.cos(slope)])
            foot = np.array([TOE_M, 0.0, self.grade * TOE_M])
            found.append(_to_plane(origin, rays, normal, float(normal @ foot)))
        nearest: FloatArray = np.min(found, axis=0)
        return nearest


def drive(drift: CastDrift, to_m: float = 28.0, registration: FaceRegistration = EXACT) -> PileReport:
    """Return what the stage says at the end of a drive."""
    stage = PileStage(PileSettings(), registration)
    for scan in drift.scans(to_m=to_m):
        stage.update(scan)
    return stage.report()


def last_of(report: PileReport) -> Snapshot:
    """Return the last estimate of a report that has one."""
    assert report.last is not None
    return report.last


def _pose(base: FloatArray, down_rad: float, pitch_rad: float) -> FloatArray:
    """Return the scanner's pose (4, 4): its place pitches with the machine, its plane looks down."""
    T = from_rpy(0.0, down_rad, 0.0)
    T[:3, 3] = base + from_rpy(0.0, pitch_rad, 0.0)[:3, :3] @ np.array(SCANNER_M)
    return T


def _to_plane(origin: FloatArray, rays: FloatArray, normal: FloatArray, offset: float) -> FloatArray:
    """Return the range of each ray (N, 3) to the plane normal . p = offset."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = (offset - normal @ origin) / (rays @ normal)
    return np.where(ranges > 0.0, ranges, np.inf)


def _to_segment(origin: FloatArray, rays: FloatArray, segment: tuple[float, float, float, float]) -> FloatArray:
    """Return the range of each ray to an upright wall over the segment."""
    start, stop = np.array(segment[:2]), np.array(segment[2:])
    along = stop - start
    normal = np.array([-along[1], along[0], 0.0])
    ranges = _to_plane(origin, rays, normal, float(normal[:2] @ start))
    with np.errstate(invalid="ignore"):
        share = ((origin[:2] + ranges[:, None] * rays[:, :2]) - start) @ along / (along @ along)
    return np.where((share >= 0.0) & (share <= 1.0), ranges, np.inf)

"""Planar worlds: a drift with rough walls as line segments, ray cast exactly; truth for the planar odometry.

The walls are the drift's half width plus a sum of smooth random functions of the arc length, one an octave.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from lhdmap.messages import FloatArray, LaserScan

CELL_M = 0.5


@dataclass(frozen=True, slots=True)
class PlanarScanner:
    """A 2D scanner at the origin of its frame; angles in degrees as data sheets give them."""

    field_of_view_deg: float = 190.0
    step_deg: float = 0.5
    noise_m: float = 0.012
    max_range_m: float = 80.0

    @property
    def angles_rad(self) -> FloatArray:
        """Beam angles, shape (N,), radians, from right to left."""
        beams = round(self.field_of_view_deg / self.step_deg) + 1
        return np.radians(-0.5 * self.field_of_view_deg + self.step_deg * np.arange(beams))


@dataclass(frozen=True, slots=True)
class PlanarWorld:
    """Wall segments, shape (M, 4) as x0 y0 x1 y1, and the grid of `CELL_M` that finds those near a ray."""

    segments_m: FloatArray
    origin_m: FloatArray
    shape: tuple[int, int]
    starts: npt.NDArray[np.int64]
    members: npt.NDArray[np.int64]
    centre_line_m: FloatArray

    def ranges(self, pose_world_scanner: FloatArray, angles_rad: FloatArray, max_range_m: float) -> FloatArray:
        """Return exact ranges, shape (N,), metres (inf = none): pose (3,) for all beams or (N, 3), one for each."""
        poses = np.broadcast_to(np.asarray(pose_world_scanner, dtype=float), (angles_rad.size, 3))
        return _cast(
            np.ascontiguousarray(poses),
            angles_rad,
            max_range_m,
            self.segments_m,
            self.origin_m,
            self.shape,
            self.starts,
            self.members,
        )


def rough_profile(
    rng: np.random.Generator, length_m: float, rms_m: float, octaves: int = 6, persistence: float = 0.75
) -> CubicSpline:
    """Return a random smooth function of arc length with the given rms over `octaves` from 4 m down by halves."""
    s = np.arange(-5.0, length_m + 5.0, 0.02)
    total = np.zeros_like(s)
    for octave in range(octaves):
        spacing = 2.0 / 2**octave
        knots = np.arange(s[0] - 2 * spacing, s[-1] + 3 * spacing, spacing)
        total += persistence**octave * CubicSpline(knots, rng.standard_normal(knots.size))(s)
    total -= total.mean()
    return CubicSpline(s, total * rms_m / total.std())


def centre_line(pieces: tuple[tuple[float, float], ...], step_m: float = 0.02) -> FloatArray:
    """Return x, y, heading, shape (N, 3), along pieces of (length m, turn rad); each piece is straight or an arc."""
    headings, h = [np.zeros(1)], 0.0
    for length, turn in pieces:
        n = max(round(length / step_m), 1)
        headings.append(h + turn * (np.arange(n) + 1) / n)
        h += turn
    heading = np.concatenate(headings)
    middle = 0.5 * (heading[1:] + heading[:-1])
    xy = np.concatenate([np.zeros((1, 2)), np.cumsum(step_m * np.stack([np.cos(middle), np.sin(middle)], 1), axis=0)])
    return np.column_stack([xy, heading])


def drift_world(
    seed: int,
    *,
    rms_m: float = 0.12,
    half_width_m: float = 2.0,
    pieces: tuple[tuple[float, float], ...] | None = None,
    cross_drift_at_m: float | None = 45.0,
    octaves: int = 6,
    persistence: float = 0.75,
) -> PlanarWorld:
    """Build a closed drift: straights, bends of 12 m and 9 m radius, a cross drift on the left; about 180 m.

    `octaves`, `persistence`: of the walls' roughness, see `rough_profile`.
    """
    rng = np.random.default_rng(seed)
    if pieces is None:
        r12, r9 = math.pi / 3, math.pi / 2
        pieces = ((60.0, 0.0), (12.0 * r12, r12), (40.0, 0.0), (9.0 * r9, -r9), (53.3, 0.0))
    line = centre_line(pieces)
    length = 0.02 * (len(line) - 1)
    profiles = [rough_profile(rng, length, rms_m, octaves, persistence) for _ in range(2)]
    walls = [_wall(line, side * half_width_m, profile) for side, profile in zip((1.0, -1.0), profiles, strict=True)]
    parts = [walls[1]]
    if cross_drift_at_m is None:
        parts.append(walls[0])
    else:
        parts += _with_opening(rng, walls[0], line, cross_drift_at_m, rms_m)
    parts += [_cap(walls[0][0], walls[1][0], rng, rms_m), _cap(walls[0][-1], walls[1][-1], rng, rms_m)]
    return world_from_polylines(parts, line)


def world_from_polylines(polylines: list[FloatArray], line: FloatArray) -> PlanarWorld:
    """Index polylines, each (N, 2), as a world."""
    segments = np.concatenate([np.column_stack([p[:-1], p[1:]]) for p in polylines])
    low = np.minimum(segments[:, :2], segments[:, 2:]).min(0) - CELL_M
    high = np.maximum(segments[:, :2], segments[:, 2:]).max(0) + CELL_M
    shape = (int((high[0] - low[0]) / CELL_M) + 1, int((high[1] - low[1]) / CELL_M) + 1)
    first = np.floor((np.minimum(segments[:, :2], segments[:, 2:]) - low) / CELL_M).astype(np.int64)
    last = np.floor((np.maximum(segments[:, :2], segments[:, 2:]) - low) / CELL_M).astype(np.int64)
    cells, owners = [], []
    for dx in range(int((last - first)[:, 0].max()) + 1):
        for dy in range(int((last - first)[:, 1].max()) + 1):
            inside = (first[:, 0] + dx <= last[:, 0]) & (first[:, 1] + dy <= last[:, 1])
            cells.append((first[inside, 0] + dx) * shape[1] + first[inside, 1] + dy)
            owners.append(np.flatnonzero(inside))
    cell, owner = np.concatenate(cells), np.concatenate(owners)
    order = np.argsort(cell, kind="stable")
    starts = np.searchsorted(cell[order], np.arange(shape[0] * shape[1] + 1))
    return PlanarWorld(segments, low, shape, starts, owner[order], line)


def drive_along(
    line: FloatArray, speed_mps: float, rate_hz: float, start_m: float = 5.0, end_m: float = 8.0
) -> FloatArray:
    """Return poses x, y, heading, shape (N, 3), at the scan rate along the centre line at constant speed."""
    return poses_along(line, np.arange(start_m, 0.02 * (len(line) - 1) - end_m, speed_mps / rate_hz))


def poses_along(line: FloatArray, way_m: FloatArray) -> FloatArray:
    """Return poses x, y, heading, shape (N, 3), at places (N,) along the centre line."""
    grid = 0.02 * np.arange(len(line))
    # A machine cannot jump in curvature: its heading is the line's, averaged over 2 m.
    kernel = np.hanning(101) / np.hanning(101).sum()
    smooth = np.column_stack(
        [np.convolve(np.pad(column, 50, mode="reflect", reflect_type="odd"), kernel, "valid") for column in line.T]
    )
    splines = [CubicSpline(grid, column) for column in smooth[:, :2].T]
    tangent = [spline(way_m, 1) for spline in splines]
    return np.column_stack([*(spline(way_m) for spline in splines), np.unwrap(np.arctan2(tangent[1], tangent[0]))])


def way_from_rest(speed_mps: float, rate_hz: float, length_m: float, acceleration_mps2: float = 0.6) -> FloatArray:
    """Return the places (m) at the scan rate of a drive of `length_m`: at rest for a second, then up to the speed."""
    ramp_s = speed_mps / acceleration_mps2
    since = np.maximum(np.arange(0.0, 2.0 + ramp_s + length_m / speed_mps, 1.0 / rate_hz) - 1.0, 0.0)
    ramp = 0.5 * acceleration_mps2 * np.minimum(since, ramp_s) ** 2
    way = ramp + speed_mps * np.maximum(since - ramp_s, 0.0)
    return way[way < length_m]


def simulate_scans(
    world: PlanarWorld, poses: FloatArray, scanner: PlanarScanner, rate_hz: float, seed: int, *, sweep: bool = False
) -> list[LaserScan]:
    """Return noisy scans at `poses` (N, 3); with `sweep` each beam is cast from the pose at its own time (360° a period)."""
    rng = np.random.default_rng(seed)
    angles = scanner.angles_rad
    increment_s = math.radians(scanner.step_deg) / (2 * math.pi) / rate_hz if sweep else 0.0
    velocity = np.gradient(poses, axis=0) * rate_hz
    scans = []
    for k, pose in enumerate(poses):
        offsets = np.arange(angles.size) * increment_s
        ranges = world.ranges(pose + offsets[:, None] * velocity[k], angles, scanner.max_range_m)
        noisy = (ranges + scanner.noise_m * rng.standard_normal(ranges.size)).astype(np.float32)
        noisy[noisy > scanner.max_range_m] = np.inf
        scans.append(
            LaserScan(
                round((100.0 + k / rate_hz) * 1e9),
                "laser",
                float(angles[0]),
                math.radians(scanner.step_deg),
                increment_s,
                0.05,
                scanner.max_range_m,
                noisy,
            )
        )
    return scans


def _wall(line: FloatArray, offset_m: float, profile: CubicSpline) -> FloatArray:
    s = 0.02 * np.arange(len(line))
    shift = offset_m + profile(s)
    return line[:, :2] + shift[:, None] * np.column_stack([-np.sin(line[:, 2]), np.cos(line[:, 2])])


def _with_opening(
    rng: np.random.Generator, wall: FloatArray, line: FloatArray, at_m: float, rms_m: float
) -> list[FloatArray]:
    """Cut a 4 m opening into the wall and add a dead-end cross drift of 15 m behind it."""
    a, b = round(at_m / 0.02), round((at_m + 4.0) / 0.02)
    heading = line[a, 2] + math.pi / 2
    depth = np.arange(0, 15.0, 0.02)
    direction, normal = (
        np.array([math.cos(heading), math.sin(heading)]),
        np.array([-math.sin(heading), math.cos(heading)]),
    )
    sides = []
    for corner in (wall[a], wall[b]):
        rough = rough_profile(rng, 15.0, rms_m)(depth)
        rough -= rough[0]
        sides.append(corner + depth[:, None] * direction + rough[:, None] * normal)
    return [wall[: a + 1], wall[b:], *sides, _cap(sides[0][-1], sides[1][-1], rng, rms_m)]


def _cap(start: FloatArray, end: FloatArray, rng: np.random.Generator, rms_m: float) -> FloatArray:
    """Close the drift from one wall end to the other by a rough face."""
    t = np.linspace(0.0, 1.0, 201)
    along = end - start
    normal = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    bump = rough_profile(rng, 4.0, rms_m)(4.0 * t) * np.sin(math.pi * t)
    return start + t[:, None] * along + bump[:, None] * normal


@nb.njit(cache=True, nogil=True)
def _cast(poses, angles, max_range, segments, origin, shape, starts, members):  # type: ignore[no-untyped-def]
    """Walk each ray through the grid cell by cell; the nearest hit in a cell ends it."""
    out = np.full(angles.size, np.inf)
    for i in range(angles.size):
        x, y = poses[i, 0], poses[i, 1]
        dx, dy = math.cos(poses[i, 2] + angles[i]), math.sin(poses[i, 2] + angles[i])
        out[i] = _first_hit(x, y, dx, dy, max_range, segments, origin, shape, starts, members)
    return out


@nb.njit(cache=True, nogil=True)
def _first_hit(x, y, dx, dy, max_range, segments, origin, shape, starts, members):  # type: ignore[no-untyped-def]
    ix, iy = int((x - origin[0]) / CELL_M), int((y - origin[1]) / CELL_M)
    step_x, step_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    tx = ((ix + (dx > 0)) * CELL_M + origin[0] - x) / dx if dx != 0 else np.inf
    ty = ((iy + (dy > 0)) * CELL_M + origin[1] - y) / dy if dy != 0 else np.inf
    delta_x = CELL_M / abs(dx) if dx != 0 else np.inf
    delta_y = CELL_M / abs(dy) if dy != 0 else np.inf
    entered = 0.0
    while 0 <= ix < shape[0] and 0 <= iy < shape[1] and entered < max_range:
        best = np.inf
        cell = ix * shape[1] + iy
        for k in range(starts[cell], starts[cell + 1]):
            best = min(best, _hit(x, y, dx, dy, segments[members[k]]))
        leave = min(tx, ty)
        if best <= leave + 1e-9:
            return best if best <= max_range else np.inf
        if tx < ty:
            ix += step_x
            tx += delta_x
        else:
            iy += step_y
            ty += delta_y
        entered = leave
    return np.inf


@nb.njit(cache=True, nogil=True)
def _hit(x, y, dx, dy, segment):  # type: ignore[no-untyped-def]
    ex, ey = segment[2] - segment[0], segment[3] - segment[1]
    det = dx * ey - dy * ex
    if abs(det) < 1e-15:
        return np.inf
    rx, ry = segment[0] - x, segment[1] - y
    t = (rx * ey - ry * ex) / det
    u = (rx * dy - ry * dx) / det
    return t if t > 0 and -1e-9 <= u <= 1 + 1e-9 else np.inf

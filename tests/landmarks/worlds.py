"""Tunnels whose walls are known, and drives in them: two scanners, rays cast by an angular z-buffer of our own."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np
from lhdmap.geometry import se2
from lhdmap.landmarks.scans import NodeScan
from lhdmap.messages import FloatArray

STEP_M = 0.04
SCANNERS = (np.array([0.8, 0.0, 0.0]), np.array([-6.4, 0.0, math.pi]))
"""Mounts of the two scanners on `base_link`, as the machine that ships has them."""
BEYOND_M = 34.0  # a tunnel goes on beyond both ends, out of sight
HALF_WIDTH_M = 2.2
ROUGH, MODERATE, SMOOTH = 0.12, 0.03, 0.005


@dataclass(frozen=True)
class TunnelWorld:
    """Wall segments (M, 4), the centre line (N, 3) at each `STEP_M` of the tunnel from 0 to `length_m`."""

    segments_m: FloatArray
    line: FloatArray
    length_m: float

    def pose(self, at_m: float, lateral_m: float = 0.0, turn_rad: float = 0.0) -> FloatArray:
        """Return the pose (3,) of `base_link` at a distance along the tunnel, to the left of its centre line."""
        row = (at_m + BEYOND_M) / STEP_M
        x, y, h = (float(np.interp(row, np.arange(len(self.line)), column)) for column in self.line.T)
        return np.array([x - lateral_m * math.sin(h), y + lateral_m * math.cos(h), h + turn_rad])

    def frame(self) -> FloatArray:
        """Return pose_map_node (4,): at the tunnel's start, x along it."""
        x, y, h = self.pose(0.0)
        return np.array([x, y, 0.0, h])


def tunnel(
    seed: int,
    rms_m: float,
    length_m: float = 60.0,
    *,
    bends: bool = False,
    niches: bool = False,
    width_m: float | None = None,
) -> TunnelWorld:
    """Return a tunnel; `bends`: 15 to 25 m of radius, `niches`: 1.5 to 3 m deep, each 12 to 25 m; `width_m`: slow changes, rms."""
    rng = np.random.default_rng(seed)
    n = round((length_m + 2 * BEYOND_M) / STEP_M) + 1
    line = _line(rng, n, bends)
    slow = 0.0 if rms_m == SMOOTH else 0.1
    walls = []
    for side in (1.0, -1.0):
        offset = HALF_WIDTH_M + rms_m * noise(rng, n) + (slow if width_m is None else width_m) * _octave(rng, n, 30.0)
        if niches:
            offset = offset + _niches(rng, n)
        normal = np.column_stack([-np.sin(line[:, 2]), np.cos(line[:, 2])])
        walls.append(line[:, :2] + side * offset[:, None] * normal)
    segments = np.concatenate([np.column_stack([wall[:-1], wall[1:]]) for wall in walls])
    return TunnelWorld(segments, line, length_m)


def noise(rng: np.random.Generator, n: int) -> FloatArray:
    """Return unit noise (n,) along a wall: six octaves from 8 m down."""
    total = np.sum([0.75**k * _octave(rng, n, 8.0 / 2**k) for k in range(6)], axis=0)
    scaled: FloatArray = (total - total.mean()) / total.std()
    return scaled


def _octave(rng: np.random.Generator, n: int, spacing_m: float) -> FloatArray:
    """Return smooth noise: random knots, cosines between them."""
    at = np.arange(n) * STEP_M / spacing_m
    knots = rng.standard_normal(int(at[-1]) + 3)
    k = at.astype(int)
    blend = 0.5 - 0.5 * np.cos(math.pi * (at - k))
    mixed: FloatArray = knots[k] * (1.0 - blend) + knots[k + 1] * blend
    return mixed


def _line(rng: np.random.Generator, n: int, bends: bool) -> FloatArray:
    turn = np.zeros(n)
    at = BEYOND_M + 10.0
    while bends and at < n * STEP_M - BEYOND_M - 15.0:
        radius, length = rng.uniform(15.0, 25.0), rng.uniform(6.0, 14.0)
        a, b = round(at / STEP_M), round((at + length) / STEP_M)
        turn[a:b] = rng.choice([-1.0, 1.0]) * STEP_M / radius
        at += length + rng.uniform(10.0, 25.0)
    heading = np.cumsum(turn)
    xy = np.cumsum(STEP_M * np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    return np.column_stack([xy, heading])


def _niches(rng: np.random.Generator, n: int) -> FloatArray:
    depth, at = np.zeros(n), BEYOND_M + rng.uniform(2.0, 14.0)
    while at < n * STEP_M - BEYOND_M - 5.0:
        a, b = round(at / STEP_M), round((at + rng.uniform(1.5, 4.0)) / STEP_M)
        depth[a:b] = rng.uniform(1.5, 3.0)
        at += rng.uniform(12.0, 25.0)
    return depth


def seen(world: TunnelWorld, pose_map_base: FloatArray, rng: np.random.Generator, range_m: float = 30.0) -> FloatArray:
    """Return the hits (N, 2) of both scanners in the base frame: 190 degrees, a beam each half degree, 12 mm of noise."""
    angles = np.radians(np.arange(-95.0, 95.01, 0.5))
    parts = []
    for mount in SCANNERS:
        at = se2.compose(pose_map_base, mount)
        ranges = np.full(angles.size, np.inf)
        _rasterise(world.segments_m, at, angles[0], angles[1] - angles[0], range_m, ranges)
        hit = np.isfinite(ranges)
        r = ranges[hit] + 0.012 * rng.standard_normal(int(hit.sum()))
        local = np.column_stack([r * np.cos(angles[hit]), r * np.sin(angles[hit])])
        parts.append(se2.transform(mount, local))
    return np.concatenate(parts)


@nb.njit(cache=True)
def _rasterise(segments, at, first, step, range_m, ranges):  # type: ignore[no-untyped-def]
    """Lower the range of each beam that a segment crosses."""
    c, s = math.cos(at[2]), math.sin(at[2])
    for k in range(segments.shape[0]):
        ax, ay = segments[k, 0] - at[0], segments[k, 1] - at[1]
        if ax * ax + ay * ay > range_m * range_m:
            continue
        bx, by = segments[k, 2] - at[0], segments[k, 3] - at[1]
        ax, ay, bx, by = c * ax + s * ay, c * ay - s * ax, c * bx + s * by, c * by - s * bx
        low, high = math.atan2(ay, ax), math.atan2(by, bx)
        if low > high:
            low, high = high, low
        if high - low > math.pi:  # across the back, which no beam of 190 degrees sees but at its edge
            continue
        cross = ax * (by - ay) - ay * (bx - ax)
        for beam in range(
            max(math.ceil((low - first) / step), 0), min(math.floor((high - first) / step), ranges.size - 1) + 1
        ):
            angle = first + beam * step
            across = math.cos(angle) * (by - ay) - math.sin(angle) * (bx - ax)
            if abs(across) > 1e-12 and 0.0 < cross / across < ranges[beam]:
                ranges[beam] = cross / across


def drive(
    world: TunnelWorld,
    seed: int,
    node: str = "t",
    *,
    every_m: float = 1.0,
    offset_m: float = 0.0,
    scale: float = 1.0,
    back: bool = False,
) -> list[NodeScan]:
    """Return the scans of a drive in the middle, 0.15 m of weave about an offset; `back`: facing the tunnel's start.

    `scale`: poses and places are stretched by it along the tunnel, as by an odometry that is off (straight tunnels only).
    """
    rng = np.random.default_rng(seed)
    scans = []
    for at in np.arange(0.0, world.length_m + 0.01, every_m):
        lateral = offset_m + 0.15 * math.sin(at / 7.0 + seed)
        turn = 0.005 * rng.standard_normal() + (math.pi if back else 0.0)
        true = world.pose(float(at), lateral, turn)
        said = true if scale == 1.0 else np.array([scale * true[0], *true[1:]])
        scans.append(NodeScan(node, scale * float(at), said, seen(world, true, rng)))
    return scans

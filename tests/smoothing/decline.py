"""A zig-zag decline: equal legs joined by U-bends, with equal stubs; driven down and half of it again."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.scan_matching.scan_points import planar_points
from lhdmap.scan_matching.step_error import StepError
from lhdmap.simulation.planar import PlanarScanner, PlanarWorld, rough_profile, simulate_scans, world_from_polylines

Return = Literal["turned", "reverse"]
LEGS, LEG_M, HALF_M = 6, 60.0, 2.25
_STUBS = ((14.0, 1.0), (34.0, -1.0))  # where along a leg, and on which side: no two of neighbouring legs meet
_STUB_M, _STUB_DEPTH_M = 4.0, 5.0
_GRADE = 1.0 / 7.0
_POINT_M = 0.08
_SCANNER = PlanarScanner(field_of_view_deg=190.0, max_range_m=30.0)
_SIGMAS = np.array([0.01, 0.005, math.radians(0.03)])  # of a metre of odometry


class Decline(NamedTuple):
    """Where the centre line is at each metre (N, 3), how low (N,), and what is seen from there."""

    line: FloatArray
    heights_m: FloatArray
    part: list[int]
    worlds: list[PlanarWorld]


class Drive(NamedTuple):
    """A drive: true poses (K, 3) and heights (K,), the keys with their odometry's drift, and from which key on it goes back."""

    true: FloatArray
    heights_m: FloatArray
    keys: list[KeyScan]
    turn: int


def decline(seed: int, rough_m: float, apart_m: float = 14.0, *, stacked: bool = False, legs: int = LEGS) -> Decline:
    """Return a decline whose legs are `apart_m` from each other; `stacked`: every second one lies under the first."""
    rng = np.random.default_rng(seed)
    line, parts, sides = _unrolled(apart_m, legs, stacked=stacked)
    walls = [_rough(wall, rng, rough_m) for wall in sides]
    worlds = []
    for part in range(parts[-1] + 1):
        rows = np.flatnonzero(np.abs(np.array(parts) - part) <= 1)
        polylines = [wall[(wall[:, 2] >= rows[0]) & (wall[:, 2] <= rows[-1]), :2] for wall in walls]
        worlds.append(world_from_polylines(polylines, line[rows]))
    return Decline(line, -_GRADE * np.arange(len(line), dtype=np.float64), parts, worlds)


def _unrolled(apart_m: float, legs: int, *, stacked: bool) -> tuple[FloatArray, list[int], list[FloatArray]]:
    """Return the centre line each metre, the part (leg, bend, leg, ...) of each, and both walls (M, 3: x, y, metre)."""
    pose, line, parts, sides = np.zeros(3), [np.zeros(3)], [0], ([], [])  # type: ignore[var-annotated]
    bend_m = 0.5 * math.pi * apart_m
    for leg in range(legs):
        way = len(line) - 1.0
        for wall, side in zip(sides, (1.0, -1.0), strict=True):
            wall += [(*se2.transform(pose, np.array([[x, y]]))[0], way + x) for x, y in _leg(side)]
        for _ in range(round(LEG_M)):
            line.append(se2.compose(line[-1], np.array([1.0, 0.0, 0.0])))
            parts.append(2 * leg)
        pose = line[-1]
        if leg == legs - 1:
            break
        turn = 1.0 if stacked or leg % 2 == 0 else -1.0
        centre, steps = se2.compose(pose, np.array([0.0, turn * apart_m / 2, 0.0])), round(bend_m)
        for angle in np.linspace(0.0, math.pi, 60)[1:-1]:
            for wall, side in zip(sides, (1.0, -1.0), strict=True):
                radius = apart_m / 2 - side * turn * HALF_M
                at = se2.transform(centre, radius * np.array([[math.sin(angle), -turn * math.cos(angle)]]))[0]
                wall.append((*at, len(line) - 1.0 + steps * angle / math.pi))
        for angle in np.linspace(0.0, math.pi, steps + 1)[1:]:
            at = se2.transform(centre, apart_m / 2 * np.array([[math.sin(angle), -turn * math.cos(angle)]]))[0]
            line.append(np.array([*at, se2.wrap(pose[2] + turn * angle)]))
            parts.append(2 * leg + 1)
        pose = line[-1]
    return np.array(line), parts, [np.array(wall) for wall in sides]


def _leg(side: float) -> list[tuple[float, float]]:
    """Return one wall of a leg along x."""
    points, wall = [(0.0, side * HALF_M)], side * HALF_M
    for at, where in _STUBS:
        if where == side:
            deep = wall + side * _STUB_DEPTH_M
            points += [(at, wall), (at, deep), (at + _STUB_M, deep), (at + _STUB_M, wall)]
    return [*points, (LEG_M, wall)]


def _rough(wall: FloatArray, rng: np.random.Generator, rms_m: float) -> FloatArray:
    """Return the wall (M, 3) with points each few centimetres, put in and out at random."""
    pieces = [
        np.linspace(a, b, max(round(float(np.hypot(*(b - a)[:2])) / _POINT_M), 1), endpoint=False)
        for a, b in pairwise(wall)
    ]
    points = np.concatenate([*pieces, wall[-1:]])
    if rms_m == 0.0:
        return points
    along = np.gradient(points[:, :2], axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))])
    points[:, :2] += rough_profile(rng, float(way[-1]), rms_m)(way)[:, None] * along[:, ::-1] * [-1.0, 1.0]
    return points


def driven(mine: Decline, seed: int, back: Return, *, scale: float = 0.0, heights: bool = True) -> Drive:
    """Drive down, then half of it up again, turned round or in reverse gear, a key scan each metre.

    The odometry wanders, and reads `scale` of the way too much; its keys say how far both may go.
    """
    rng = np.random.default_rng(1000 + seed)
    down, up = np.arange(len(mine.line)), np.arange(len(mine.line) - 2, len(mine.line) // 2, -1)
    rows = np.concatenate([down, up])
    true = mine.line[rows]
    if back == "turned":
        true[len(down) :, 2] += math.pi
    aside = rng.normal(0.0, 0.15, len(rows))
    true = np.array([se2.compose(pose, np.array([0.0, off, 0.0])) for pose, off in zip(true, aside, strict=True)])
    poses = [true[0]]
    for before, after in pairwise(true):
        step = se2.between(before, after) * [1.0 + scale, 1.0, 1.0]
        poses.append(se2.compose(poses[-1], step + rng.normal(0.0, _SIGMAS)))
    walk, keys = StepError(np.diag(_SIGMAS**2), np.array([scale, 0.0, 0.0]), np.zeros((3, 3))), []
    for k, (row, pose) in enumerate(zip(rows.tolist(), poses, strict=True)):
        world = mine.worlds[mine.part[row]]
        scan = simulate_scans(world, true[k : k + 1].repeat(2, axis=0), _SCANNER, 1.0, seed * 10_000 + k)[0]
        points = planar_points(scan, np.eye(4), np.zeros(3)).astype(np.float32)
        points[:, 2] = mine.heights_m[row] if heights else 0.0
        keys.append(KeyScan(k * 1_000_000_000, pose, float(k), points, walk))
    return Drive(true, mine.heights_m[rows], keys, len(down))

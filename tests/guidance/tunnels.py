"""Tunnels in plan: a centre line, walls as points, the least room beside the swept bodies known."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from lhdmap.driving.bodies import bodies_of
from lhdmap.driving.lead import lead_of
from lhdmap.driving.model import drive_model
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.noise_field import Scales, noise_field

MACHINE = Machine()
MODEL, BODIES = drive_model(MACHINE), bodies_of(MACHINE)
STEP_M = 0.1
_SPREAD = 15  # steps over which the swept width is held
_DENSE = 3  # wall points of a step


def line_of(curvature: npt.NDArray[np.floating[Any]]) -> FloatArray:
    """A line (N, 2) of curvatures (N,) each 0.1 m, smoothed by 4 m of clothoid."""
    ramp = np.convolve(np.pad(curvature, 20, mode="edge"), np.ones(41) / 41.0, mode="valid")
    heading: FloatArray = np.concatenate([[0.0], np.cumsum(STEP_M * ramp[:-1])])
    return np.column_stack([np.cumsum(STEP_M * np.cos(heading)), np.cumsum(STEP_M * np.sin(heading))])


def bend_line(radius_m: float, turn_deg: float, before_m: float = 22.0, after_m: float = 25.0) -> FloatArray:
    """Straight, arc, straight."""
    arc = math.radians(abs(turn_deg)) * radius_m
    s = np.arange(0.0, before_m + arc + after_m, STEP_M)
    bent: FloatArray = ((s >= before_m) & (s < before_m + arc)).astype(np.float64)
    return line_of(math.copysign(1.0 / radius_m, turn_deg) * bent)


def winding_line(
    seed: int, radii_m: tuple[float, float] = (5.5, 15.0), length_m: float = 70.0, ends_m: float = 18.0
) -> FloatArray:
    """Bends of radii drawn log-uniformly, 20 to 90 degrees, some metres apart; straight ends."""
    rng = np.random.default_rng([seed, 77])
    parts, turned = [np.zeros(round(ends_m / STEP_M))], 0.0
    while sum(map(len, parts)) * STEP_M < ends_m + length_m:
        radius = math.exp(rng.uniform(*np.log(radii_m)))
        turn = math.radians(rng.uniform(20.0, 90.0))
        side = -math.copysign(1.0, turned) if abs(turned) > 0.8 else float(rng.choice([-1.0, 1.0]))
        turned += side * turn
        parts += [
            np.full(round(turn * radius / STEP_M), side / radius),
            np.zeros(round(rng.uniform(5.0, 10.0) / STEP_M)),
        ]
    return line_of(np.concatenate([*parts, np.zeros(round(ends_m / STEP_M))]))


def swept_half_widths(line: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How far (N,) the bodies reach to the left and right of a line that the front axle follows."""
    lead = lead_of(1, MODEL, BODIES)
    heading = headings(line)
    bend = np.zeros(len(line))
    for k in range(len(line) - 1):
        curvature = (heading[k + 1] - heading[k]) / STEP_M
        slope = curvature * (lead.lead_m * math.cos(bend[k]) + lead.trail_m) - math.sin(bend[k])
        bend[k + 1] = bend[k] + STEP_M * slope / lead.trail_m
    left, right = np.full(len(line), 1.225), np.full(len(line), 1.225)
    for k in range(0, len(line), 2):
        outlines = placed(np.array([*line[k], heading[k], bend[k]]))
        around = np.arange(max(k - 110, 0), min(k + 60, len(line)), 2)
        apart = around[np.linalg.norm(outlines[:, None] - line[None, around], axis=2).argmin(axis=1)]
        normal = np.column_stack([-np.sin(heading[apart]), np.cos(heading[apart])])
        off = ((outlines - line[apart]) * normal).sum(axis=1)
        np.maximum.at(left, apart, off)
        np.maximum.at(right, apart, -off)
    return _held(left), _held(right)


def _held(values: FloatArray) -> FloatArray:
    return np.array([values[max(k - _SPREAD, 0) : k + _SPREAD + 1].max() for k in range(len(values))])


def headings(line: FloatArray) -> FloatArray:
    """Headings (N,) of a line."""
    heading: FloatArray = np.unwrap(np.arctan2(np.gradient(line[:, 1]), np.gradient(line[:, 0])))
    return heading


def placed(state: FloatArray) -> FloatArray:
    """Outline points (N, 2) of both bodies of a front axle's state (x, y, heading, bend)."""
    front, rear = frames(state)
    return np.vstack([_moved(front, BODIES.front_m), _moved(rear, BODIES.rear_m)])


def room(state: FloatArray, walls: FloatArray) -> float:
    """The least signed distance of wall points (M, 2) from both rectangles; below zero where one is inside."""
    least = math.inf
    for pose, box in zip(frames(state), (BODIES.front_box_m, BODIES.rear_box_m), strict=True):
        c, s = math.cos(pose[2]), math.sin(pose[2])
        local = (walls - pose[:2]) @ np.array([[c, -s], [s, c]])
        over = np.abs(local - box.mean(axis=0)) - 0.5 * np.ptp(box, axis=0)
        outside = np.hypot(*np.maximum(over, 0.0).T) + np.minimum(over.max(axis=1), 0.0)
        least = min(least, float(outside.min()))
    return least


def frames(state: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Poses (3,) of `base_link` and `rear_link` of a front axle's state."""
    x, y, heading, bend = state[:4].tolist()
    back = heading - bend
    rx = x - MODEL.front_m * math.cos(heading) - MODEL.rear_m * math.cos(back)
    ry = y - MODEL.front_m * math.sin(heading) - MODEL.rear_m * math.sin(back)
    return np.array([x, y, heading]), np.array([rx, ry, back])


def _moved(pose: FloatArray, points: FloatArray) -> FloatArray:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return pose[:2] + points @ np.array([[c, s], [-s, c]])


def walls_beside(
    line: FloatArray, c_m: float, seed: int = 0, rms_m: float = 0.05, opening_at_m: float | None = None
) -> FloatArray:
    """Wall points (M, 2) with `c_m` of least room beside the swept bodies, rough outward; an opening of 5 m to the left."""
    left, right = swept_half_widths(line)
    at = np.arange(len(line), dtype=np.float64) * STEP_M
    heading = headings(line)
    normal = np.column_stack([-np.sin(heading), np.cos(heading)])
    walls = []
    for k, (half, side) in enumerate(((left, 1.0), (right, -1.0))):
        rough = noise_field(np.random.default_rng([seed, k]), Scales(4, 8.0, 0.6), (0.0, 400.0), (0.0, 1.0))
        rough.normalise(at, np.zeros(1), rms_m)
        out = rough.grid(at, np.zeros(1))[:, 0]
        wall = line + side * (half + c_m + out - out.min())[:, None] * normal
        keep = np.ones(len(line), bool)
        if opening_at_m is not None and side > 0.0:
            keep = np.abs(at - opening_at_m) > 2.5
            edges = [int(np.flatnonzero(~keep)[n]) for n in (0, -1)]
            out_m = np.linspace(0.0, 8.0, 160)[:, None]
            walls += [wall[edge] + out_m * normal[edges].mean(axis=0) for edge in edges]
        walls.append(_dense(wall)[np.repeat(keep, _DENSE)[: (len(line) - 1) * _DENSE + 1]])
    return np.vstack(walls)


def least_room_m(line: FloatArray, walls: FloatArray) -> float:
    """The least room beside the bodies where the front axle follows the line."""
    heading, lead = headings(line), lead_of(1, MODEL, BODIES)
    bend, least = 0.0, math.inf
    for k in range(len(line) - 1):
        curvature = (heading[k + 1] - heading[k]) / STEP_M
        bend += STEP_M * (curvature * (lead.lead_m * math.cos(bend) + lead.trail_m) - math.sin(bend)) / lead.trail_m
        if k % 2 == 0:
            near = walls[np.hypot(*(walls - line[k]).T) < 9.0]
            least = min(least, room(np.array([*line[k], heading[k + 1], bend]), near))
    return least


def tunnel(
    seed: int, c_m: float, radii_m: tuple[float, float] = (5.5, 15.0), length_m: float = 70.0, rms_m: float = 0.10
) -> tuple[FloatArray, FloatArray]:
    """A winding line and rough walls with an opening, the least room along the line as measured."""
    line = winding_line(seed, radii_m, length_m)
    c, opening_m = c_m, opening_of(seed, line)
    for _ in range(3):
        walls = walls_beside(line, c, seed, rms_m, opening_m)
        c += c_m - least_room_m(line, walls)
    return line, walls


def opening_of(seed: int, line: FloatArray) -> float:
    """Where the opening of a tunnel is along its line."""
    return float(np.random.default_rng([seed, 5]).uniform(25.0, len(line) * STEP_M - 25.0))


def route_of(seed: int, line: FloatArray, weight: float, about_m: float) -> FloatArray:
    """The route's weights (N,) along a tunnel's line: navigation knows the opening, and gives more in it and about it."""
    off = np.abs(np.arange(len(line)) * STEP_M - opening_of(seed, line))
    return np.where(off < 2.5 + about_m, weight, 1.0)


def _dense(wall: FloatArray) -> FloatArray:
    at, fine = np.arange(len(wall)), np.arange((len(wall) - 1) * _DENSE + 1) / _DENSE
    return np.column_stack([np.interp(fine, at, wall[:, n]) for n in range(2)])


def narrow(
    radius_m: float, turn_deg: float, c_m: float, seed: int = 0, rms_m: float = 0.05
) -> tuple[FloatArray, FloatArray]:
    """A bend's line and walls with `c_m` of least room beside the swept bodies."""
    line = bend_line(radius_m, turn_deg)
    return line, walls_beside(line, c_m, seed, rms_m)

"""The way of the leading axle along a route: legs from stop to stop, smooth, and laid so that the swept bodies are centred."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lhdmap.kinematics import articulation_along_path
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.mine.network import Network
from lhdmap.mine.runs import Run
from lhdmap.mine.stands import overhang_m

STEP_M = 0.05
_SMOOTH_M = 2.0  # curvature changes over about this way, as steering does
_OFFSET_OVER_M = 3.0
_SEARCHED_M = 15.0
_BEYOND_M = 5.0


class Leg(NamedTuple):
    """A way in one gear, from a stop to the next, of the axle that leads: front forwards, rear in reverse.

    All arrays (N,), a sample each `STEP_M`: `heading_rad` is that of the motion, `articulation_rad` the joint's angle there
    in the sense of the motion (positive bends the leading body to its left). `stop` names the place at the end, if it is one.
    """

    gear: int
    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    heading_rad: FloatArray
    curvature_pm: FloatArray
    articulation_rad: FloatArray
    stop: str = ""

    @property
    def length_m(self) -> float:
        """Length, metres."""
        return STEP_M * (len(self.x_m) - 1)


def legs_of(
    network: Network,
    runs: list[Run],
    machine: Machine,
    *,
    start: FloatArray | None = None,
    wander: FloatArray | None = None,
) -> list[Leg]:
    """Return the legs of a route.

    `start` is x, y, z, heading (4,) of the machine's `base_link` before; `wander` (N, 2) a lateral offset (m, m) by driven
    way that is added. After a change of gear the other axle leads, which stands a wheelbase back on the way that it came.
    """
    legs, driven_m = [], 0.0
    wheelbase_m = machine.dimensions.wheelbase_m
    at = None if start is None else _axles(start, wheelbase_m)
    for group in _groups(runs):
        points = _points(network, group)
        if points is not None and at is not None:
            points = _from(points, at[0] if group[0].gear > 0 else at[1])
        if points is None or len(points) < 3:
            continue
        at = _ends(points, group[0].gear, wheelbase_m)
        leg = _leg(points, group[0].gear, machine, group[-1].stop, wander, driven_m)
        legs.append(leg)
        driven_m += leg.length_m
    return legs


def _axles(pose: FloatArray, wheelbase_m: float) -> tuple[FloatArray, FloatArray]:
    """Return where front and rear axle of a straight machine are, both (2,)."""
    return pose[:2], pose[:2] - wheelbase_m * np.array([math.cos(pose[3]), math.sin(pose[3])])


def _ends(points: FloatArray, gear: int, wheelbase_m: float) -> tuple[FloatArray, FloatArray]:
    """Return where front and rear axle are at the end of a way of the leading one."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))])
    before = way[-1] - wheelbase_m
    trailing = np.array([np.interp(before, way, column) for column in points[:, :2].T])
    if before < 0.0:
        back = points[0, :2] - points[1, :2]
        trailing = points[0, :2] - before * back / np.hypot(*back)
    return (points[-1, :2], trailing) if gear > 0 else (trailing, points[-1, :2])


def _from(points: FloatArray, place_m: FloatArray) -> FloatArray:
    """Return a way from where it is nearest to a place (2,)."""
    near = np.hypot(*(points[: round(_SEARCHED_M / STEP_M), :2] - place_m).T)
    return points[int(np.argmin(near)) :]


def _groups(runs: list[Run]) -> Iterator[list[Run]]:
    """Yield the runs from stop to stop."""
    group: list[Run] = []
    for run in runs:
        if group and (group[-1].gear != run.gear or group[-1].stop):
            yield group
            group = []
        group.append(run)
    if group:
        yield group


def _points(network: Network, runs: list[Run]) -> FloatArray | None:
    """Return the centre lines of runs, shape (N, 3), a point about each `STEP_M`; None where they have no length."""
    parts = []
    for run in runs:
        length = abs(run.to_m - run.from_m)
        if length < 0.01:
            continue
        s = np.linspace(run.from_m, run.to_m, max(round(length / STEP_M), 1) + 1)
        parts.append(network.tubes[run.tube].line.at(s)[:, :3])
    if not parts:
        return None
    points = np.concatenate(parts)
    apart = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)
    return points[np.concatenate([[True], apart > 0.2 * STEP_M])] if len(points) > 1 else None


def _leg(points: FloatArray, gear: int, machine: Machine, stop: str, wander: FloatArray | None, driven_m: float) -> Leg:
    points = _resampled(points)
    count, more = len(points), round(_BEYOND_M / STEP_M)
    points = _smoothed(_extended(points, more), _SMOOTH_M)
    heading, curvature = _direction(points)
    offset = _smooth_values(_swing_out(curvature, machine, gear), _OFFSET_OVER_M)
    if wander is not None:
        way = STEP_M * (np.arange(len(points)) - more)
        ends = np.clip(np.minimum(way, STEP_M * count - way) / 5.0, 0.0, 1.0)
        offset = offset + np.interp(driven_m + way, *wander.T) * ends
    points[:, 0] -= offset * np.sin(heading)
    points[:, 1] += offset * np.cos(heading)
    points = _resampled(points[more : more + count])
    heading, curvature = _direction(points)
    front, rear = machine.dimensions.joint_to_front_axle_m, machine.dimensions.joint_to_rear_axle_m
    lead, trail = (front, rear) if gear > 0 else (rear, front)
    bend = articulation_along_path(curvature, STEP_M, lead, trail)
    return Leg(gear, points[:, 0], points[:, 1], points[:, 2], heading, curvature, bend, stop)


def _extended(points: FloatArray, more: int) -> FloatArray:
    """Return a way that goes on at both ends, by `more` steps, as it bends there: what is smoothed keeps its bend."""
    after = _arc_on(points, more)
    before = _arc_on(points[::-1], more)
    return np.concatenate([before[::-1], points, after])


def _arc_on(points: FloatArray, more: int) -> FloatArray:
    """Return the next steps of a way, shape (more, 3), by the bend and the grade of its last metre."""
    last = points[-min(len(points), round(1.0 / STEP_M) + 1) :]
    steps = np.diff(last[:, :2], axis=0)
    headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    turn = float(np.polyfit(np.arange(len(headings)), headings, 1)[0]) if len(headings) > 2 else 0.0
    heading = float(headings[-1]) + turn * np.arange(1, more + 1)
    length = float(np.hypot(*steps[-1]))
    climb = float(last[-1, 2] - last[0, 2]) / max(len(last) - 1, 1)
    ahead = np.stack([length * np.cos(heading), length * np.sin(heading), np.full(more, climb)], axis=1)
    return points[-1] + np.cumsum(ahead, axis=0)


def _swing_out(curvature_pm: FloatArray, machine: Machine, gear: int) -> FloatArray:
    """Return the offset to the inside of bends (m, left positive) at which both sides of the swept band are as far away.

    On a circle of radius R the leading corner runs at √((R + w)² + o²), with half width w and overhang o, the inner side at
    R - w.
    """
    half, over = 0.5 * machine.dimensions.width_m, overhang_m(machine, gear)
    radius = 1.0 / np.maximum(np.abs(curvature_pm), 1e-4)
    outer = np.hypot(radius + half, over) - radius
    return np.sign(curvature_pm) * 0.5 * (outer - half)


def _resampled(points: FloatArray) -> FloatArray:
    """Return points (N, 3) at `STEP_M` of their way in plan."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))])
    at = np.arange(0.0, way[-1] + 0.5 * STEP_M, STEP_M)
    return np.stack([np.interp(at, way, column) for column in points.T], axis=1)


def _smoothed(points: FloatArray, over_m: float) -> FloatArray:
    return np.stack([_smooth_values(column, over_m) for column in points.T], axis=1)


def _smooth_values(values: FloatArray, over_m: float) -> FloatArray:
    """Return values (N,) as moving means, twice over half the way: the ends stay, and go on straight beyond."""
    for _ in range(2):
        half = min(round(0.25 * over_m / STEP_M), (len(values) - 1) // 2)
        if half < 1:
            return values
        before = 2.0 * values[0] - values[half:0:-1]
        after = 2.0 * values[-1] - values[-2 : -half - 2 : -1]
        total = np.cumsum(np.concatenate([[0.0], before, values, after]))
        values = (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)
    return values


def _direction(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return heading (rad, continuous) and curvature (1/m) of points at `STEP_M`, both (N,)."""
    if len(points) < 3:
        way = points[-1] - points[0]
        return np.full(len(points), math.atan2(way[1], way[0])), np.zeros(len(points))
    slope = np.gradient(points[:, :2], axis=0)
    heading = np.unwrap(np.arctan2(slope[:, 1], slope[:, 0]))
    return heading, _smooth_values(np.gradient(heading, STEP_M), 0.6)

"""The guard's own mathematics: poses along a braking path, and points against both bodies on the way.

It shares nothing with guidance, nor with the executor's prediction: an error in one of them is not one in all.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray

WAY, REACH, FRONT, REAR = 0, 1, 2, 6
"""Columns of a pose: way (m), how far a point of a body has moved at most (m); x, y, cos, sin of both axles in `base_link`."""
_LEAVES, _LEFT_M = 0.3, 0.3  # what touches must get farther by so much per way, over this way
_SETTLES_S = 0.2  # time in which the joint gets to where it is to be
_MOST = 4000
LEAST_BRAKE_MPS2 = 0.2
"""By so much a full brake is stronger than gravity, however steep it is."""

Shape = tuple[float, float, float, float, float]
"""Joint to front and rear axle (m), largest angle and rate of the joint (rad, rad/s), how far a body reaches from its axle (m)."""
Timing = tuple[float, float, float, float]
"""Seconds until the brake comes, full brake (m/s2), its ramp (s), gravity along the motion (m/s2, not negative)."""
Margins = tuple[float, float, float]
"""Margin (m), its growth with the way, depth of returns of the machine itself (m)."""


@nb.njit(cache=True, nogil=True)
def braking_path(
    motion: tuple[float, float, float], shape: Shape, timing: Timing, plan: FloatArray, held_s: float
) -> FloatArray:
    """Return poses (K, 10) until standstill. `motion`: speed of the front axle, joint, its rate.

    The rate is held for `held_s`, then the joint goes where `plan` (N, 2), way and angle, has it; without a plan it is held.
    """
    front_m, rear_m, most_bend, most_rate, far_m = shape
    late_s, brake, ramp_s, pull = timing
    speed, bend, rate = motion
    x, y, heading, way, reach, time = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    gear = 1.0 if speed >= 0.0 else -1.0
    pace = abs(speed)
    out = np.empty((_MOST, 10))
    _note(out[0], way, reach, x, y, heading, bend, front_m, rear_m)
    count = 1
    while pace > 0.0 and count < _MOST:
        step = min(0.02, 0.04 / pace)
        if time >= held_s:
            rate = 0.0
            if len(plan) > 0:
                wanted = np.interp(way + pace * _SETTLES_S, plan[:, 0], plan[:, 1])
                rate = min(max((wanted - bend) / _SETTLES_S, -most_rate), most_rate)
        after = min(max(bend + rate * step, -most_bend), most_bend)
        since = time + 0.5 * step - late_s
        if since > 0.0:  # the drive lets go when the brake comes
            later = max(pace + (pull - max(brake, pull + LEAST_BRAKE_MPS2) * min(since / ramp_s, 1.0)) * step, 0.0)
        else:
            later = pace
        gone = 0.5 * (pace + later) * step
        middle = 0.5 * (bend + after)
        turn = (gear * gone * math.sin(middle) + rear_m * (after - bend)) / (front_m * math.cos(middle) + rear_m)
        half = heading + 0.5 * turn
        x, y, heading = x + gear * gone * math.cos(half), y + gear * gone * math.sin(half), heading + turn
        # the rear axle goes no faster than joint and turn let it
        swing = abs(turn) + abs(after - bend)
        reach += gone + abs(turn) * far_m + swing * (far_m + front_m + rear_m)
        way, bend, pace, time = way + gone, after, later, time + step
        _note(out[count], way, reach, x, y, heading, bend, front_m, rear_m)
        count += 1
    return out[:count]


@nb.njit(cache=True, nogil=True)
def _note(
    row: FloatArray,
    way: float,
    reach: float,
    x: float,
    y: float,
    heading: float,
    bend: float,
    front_m: float,
    rear_m: float,
) -> None:
    c, s = math.cos(heading), math.sin(heading)
    back_c, back_s = math.cos(heading - bend), math.sin(heading - bend)
    row[WAY], row[REACH] = way, reach
    row[2], row[3], row[4], row[5] = x, y, c, s
    row[6], row[7] = x - front_m * c - rear_m * back_c, y - front_m * s - rear_m * back_s
    row[8], row[9] = back_c, back_s


@nb.njit(cache=True, nogil=True)
def apart(pose: FloatArray, at: int, box: FloatArray, x: float, y: float) -> float:
    """Return the distance of a point from the rectangle `box` (2, 2) of the axle in columns `at`; inside it is negative."""
    dx, dy, c, s = x - pose[at], y - pose[at + 1], pose[at + 2], pose[at + 3]
    u, w = dx * c + dy * s, dy * c - dx * s
    over_x, over_y = max(box[0, 0] - u, u - box[1, 0]), max(box[0, 1] - w, w - box[1, 1])
    if over_x <= 0.0 or over_y <= 0.0:
        return max(over_x, over_y)
    return math.sqrt(over_x * over_x + over_y * over_y)


@nb.njit(cache=True, nogil=True)
def first_contact(
    path: FloatArray, points: FloatArray, front: FloatArray, rear: FloatArray, margins: Margins
) -> tuple[int, float, int]:
    """Return the point (N, 2) that a body meets first, -1 for none, the way until then, and how many are the machine itself.

    What is beside the machine must not hold it for ever, what is in its way must: where something is nearer than the
    margin already, half of that is the margin; what touches must get farther.
    """
    margin, growth, own_m = margins
    found, free, own, beside = -1, math.inf, 0, margin
    starts = np.empty(len(points))
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        starts[i] = min(apart(path[0], FRONT, front, x, y), apart(path[0], REAR, rear, x, y))
        if starts[i] < -own_m:
            own += 1
        else:
            beside = min(beside, starts[i])
    wanted = (margin, growth) if beside >= margin else (0.5 * max(beside, 0.0), 0.0)
    for i in range(len(points)):
        if starts[i] >= -own_m:
            way = _met(path, points[i], starts[i], front, rear, wanted, free)
            if way < free:
                found, free = i, way
    return found, free, own


@nb.njit(cache=True, nogil=True)
def _met(
    path: FloatArray,
    point: FloatArray,
    start: float,
    front: FloatArray,
    rear: FloatArray,
    wanted: tuple[float, float],
    before: float,
) -> float:
    """Return the way after which a body comes too near to a point, infinite where it does not `before` a way."""
    last, (margin, growth) = len(path) - 1, wanted
    widest = margin + growth * path[last, WAY]
    k, now = 0, start
    if start - path[last, REACH] > widest:
        return math.inf
    while k < last and path[k, WAY] < before:
        to = path[k, REACH] + now - widest  # nothing can come near before the bodies have moved so far
        k += 1
        while k < last and path[k, REACH] < to:
            k += 1
        now = min(apart(path[k], FRONT, front, point[0], point[1]), apart(path[k], REAR, rear, point[0], point[1]))
        way = path[k, WAY]
        least = margin + growth * way if start > 0.0 else start + _LEAVES * min(way, _LEFT_M)
        if now < least:
            return way
    return math.inf

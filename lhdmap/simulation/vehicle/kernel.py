"""A step of the machine in sub-steps, on flat arrays: joints, drive, motion on the floor; and the pose on the floor.

A row has the columns of a history up to `CURL`, and after them the brake. The floor under the machine is taken for a plane
during a step, the one on which its wheels stood before.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.simulation.history import Column
from lhdmap.simulation.vehicle.plant import GRAVITY_MPS2, Plant
from lhdmap.simulation.vehicle.propulsion import braked, driven

PROPEL, STEERING, TILT, LIFT, FULL_RPM, BRAKING = range(6)  # columns of a command
BRAKE = int(Column.CURL) + 1
FOOTPRINT_M = 0.25  # half length and width of the patch under a tyre that carries it
_PATCH = 9  # points of a footprint
_EPS_S = 1e-9

_X, _Y, _Z = int(Column.X), int(Column.Y), int(Column.Z)
_ROLL, _PITCH, _YAW = int(Column.ROLL), int(Column.PITCH), int(Column.YAW)
_BEND, _BEND_RATE = int(Column.ARTICULATION), int(Column.ARTICULATION_RATE)
_SPEED, _WHEEL, _TRACTION = int(Column.SPEED), int(Column.WHEEL_SPEED), int(Column.TRACTION)
_BOOM, _BOOM_RATE = int(Column.BOOM), int(Column.BOOM_RATE)
_BUCKET, _BUCKET_RATE, _CURL = int(Column.BUCKET), int(Column.BUCKET_RATE), int(Column.CURL)


@nb.njit(cache=True, nogil=True)
def advance(
    row: FloatArray, plant: Plant, commands: FloatArray, since_s: FloatArray, steps: int, step_s: float, friction: float
) -> FloatArray:
    """Move `row` (18,) on by `steps` sub-steps and return the points (36, 3) at which it asks for the floor.

    `commands` (K, 6) count from `since_s` (K,) after the start of the step, the first from before.
    """
    rise = _rise(row)
    k = 0
    for i in range(steps):
        while k + 1 < len(since_s) and since_s[k + 1] <= i * step_s + _EPS_S:
            k += 1
        command = commands[k]
        before, bend = row[_SPEED], row[_BEND]
        _steer(row, plant, command[STEERING], step_s)
        _lift_and_tilt(row, plant, command, step_s)
        _drive(row, plant, command, rise, friction, step_s)
        _move(row, plant, rise, 0.5 * (before + row[_SPEED]), bend, step_s)
    return wheel_points(row, plant, rise)


@nb.njit(cache=True, nogil=True)
def carry(
    row: FloatArray, plant: Plant, steering_rps: float, before_mps: float, steps: int, step_s: float
) -> FloatArray:
    """Move the pose of `row` (18,) on as `advance` does, by a speed that another model reckons: from `before_mps` to the row's.

    Returns the points (36, 3) at which it asks for the floor.
    """
    rise, after = _rise(row), row[_SPEED]
    for i in range(steps):
        bend, middle = row[_BEND], before_mps + (i + 0.5) / steps * (after - before_mps)
        _steer(row, plant, steering_rps, step_s)
        _move(row, plant, rise, middle, bend, step_s)
    return wheel_points(row, plant, rise)


@nb.njit(cache=True, nogil=True)
def _rise(row: FloatArray) -> tuple[float, float]:
    """Return how the plane under the machine rises along x and y of `map`, m/m."""
    along = -math.tan(row[_PITCH])
    across = math.tan(row[_ROLL]) / math.cos(row[_PITCH])
    c, s = math.cos(row[_YAW]), math.sin(row[_YAW])
    return along * c - across * s, along * s + across * c


@nb.njit(cache=True, nogil=True)
def _first_order(angle: float, rate: float, wanted: float, lag_s: float, step_s: float) -> tuple[float, float]:
    """Return angle and rate of a joint whose rate goes to `wanted` with a time constant: exact."""
    gone = -math.expm1(-step_s / lag_s)
    return angle + wanted * step_s + (rate - wanted) * lag_s * gone, rate + (wanted - rate) * gone


@nb.njit(cache=True, nogil=True)
def _stopped(angle: float, rate: float, low: float, high: float) -> tuple[float, float]:
    """Return angle and rate of a joint within its hard stops; at a stop it stands, and leaves it at once."""
    if angle >= high:
        return high, min(rate, 0.0)
    return (low, max(rate, 0.0)) if angle <= low else (angle, rate)


@nb.njit(cache=True, nogil=True)
def _steer(row: FloatArray, plant: Plant, command_rps: float, step_s: float) -> None:
    wanted = 0.0 if abs(command_rps) <= plant.steering_dead_zone_rps else command_rps * plant.steering_gain
    wanted = min(max(wanted, -plant.max_bend_rate_rps), plant.max_bend_rate_rps)
    angle, rate = _first_order(row[_BEND], row[_BEND_RATE], wanted, plant.steering_lag_s, step_s)
    row[_BEND], row[_BEND_RATE] = _stopped(angle, rate, -plant.max_bend_rad, plant.max_bend_rad)


@nb.njit(cache=True, nogil=True)
def _lift_and_tilt(row: FloatArray, plant: Plant, command: FloatArray, step_s: float) -> None:
    """Move boom and bucket; where the bucket is pressed against a stop, the cylinder works (`curl`)."""
    tilt, lift = command[TILT], command[LIFT]
    share = 1.0 if command[FULL_RPM] > 0.5 else plant.idle_share
    if tilt != 0.0 and lift != 0.0:
        share *= plant.shared
    lag = plant.linkage_lag_s
    angle, rate = _first_order(row[_BOOM], row[_BOOM_RATE], share * lift * plant.lift_rate_rps, lag, step_s)
    row[_BOOM], row[_BOOM_RATE] = _stopped(angle, rate, plant.boom_min_rad, plant.boom_max_rad)
    angle, rate = _first_order(row[_BUCKET], row[_BUCKET_RATE], share * tilt * plant.tilt_rate_rps, lag, step_s)
    angle, rate = _stopped(angle, rate, plant.bucket_min_rad, plant.bucket_max_rad)
    row[_BUCKET], row[_BUCKET_RATE] = angle, rate
    pressed = (tilt > 0.0 and angle >= plant.bucket_max_rad) or (tilt < 0.0 and angle <= plant.bucket_min_rad)
    row[_CURL] += ((abs(tilt) if pressed else 0.0) - row[_CURL]) * -math.expm1(-step_s / lag)


@nb.njit(cache=True, nogil=True)
def _drive(
    row: FloatArray, plant: Plant, command: FloatArray, rise: tuple[float, float], friction: float, step_s: float
) -> None:
    """Move speeds, brake and traction on."""
    along = rise[0] * math.cos(row[_YAW]) + rise[1] * math.sin(row[_YAW])
    gravity = plant.mass_kg * GRAVITY_MPS2
    pull = -gravity * along / math.sqrt(1.0 + along * along)
    weight = gravity / math.sqrt(1.0 + rise[0] * rise[0] + rise[1] * rise[1])
    on = command[BRAKING] > 0.5
    most = step_s / plant.brake_ramp_s
    change = min(max((1.0 if on else 0.0) - row[BRAKE], -most), most)
    middle = row[BRAKE] + 0.5 * change
    row[BRAKE] = min(max(row[BRAKE] + change, 0.0), 1.0)
    grip = friction * weight
    if on:
        speed, wheel, force = braked(plant, row[_SPEED], middle, grip, weight, pull, step_s)
    else:
        speeds = (row[_SPEED], row[_WHEEL])
        speed, wheel, force = driven(plant, speeds, command[PROPEL], middle, grip, weight, pull, step_s)
    row[_SPEED], row[_WHEEL], row[_TRACTION] = speed, wheel, force / plant.mass_kg


@nb.njit(cache=True, nogil=True)
def _move(
    row: FloatArray, plant: Plant, rise: tuple[float, float], speed_mps: float, bend_before: float, step_s: float
) -> None:
    """Move the front axle on by Eq. (1) in the plane of the floor: the middle of the sub-step stands for it."""
    bend, bend_rate = 0.5 * (bend_before + row[_BEND]), (row[_BEND] - bend_before) / step_s
    turn = (speed_mps * math.sin(bend) + plant.rear_m * bend_rate) / (plant.front_m * math.cos(bend) + plant.rear_m)
    yaw = row[_YAW]
    for share in (0.5, 1.0):
        along = rise[0] * math.cos(yaw) + rise[1] * math.sin(yaw)
        level = 1.0 / math.sqrt(1.0 + along * along)  # cosine of the pitch
        upright = 1.0 / (
            level * level * math.sqrt(1.0 + rise[0] * rise[0] + rise[1] * rise[1])
        )  # cos(roll) / cos(pitch)
        if share == 1.0:
            way = speed_mps * step_s * level
            row[_X] += way * math.cos(yaw)
            row[_Y] += way * math.sin(yaw)
            row[_Z] += way * along
        yaw = row[_YAW] + share * step_s * turn * upright
    row[_YAW] = yaw


@nb.njit(cache=True, nogil=True)
def wheel_points(row: FloatArray, plant: Plant, rise: tuple[float, float]) -> FloatArray:
    """Return the footprints of the wheels front left, front right, rear left, rear right, shape (36, 3), on the plane.

    The rear axle is where it would be on a level floor; x and y are what counts, z says which level of the mine.
    """
    points = np.empty((4 * _PATCH, 3))
    bend, n = row[_BEND], 0
    for wheel in range(4):
        side = plant.half_track_m if wheel % 2 == 0 else -plant.half_track_m
        ahead, left, yaw = 0.0, side, row[_YAW]
        if wheel >= 2:
            ahead = -plant.front_m - plant.rear_m * math.cos(bend) + side * math.sin(bend)
            left = plant.rear_m * math.sin(bend) + side * math.cos(bend)
        base_x = row[_X] + ahead * math.cos(yaw) - left * math.sin(yaw)
        base_y = row[_Y] + ahead * math.sin(yaw) + left * math.cos(yaw)
        c, s = (math.cos(yaw), math.sin(yaw)) if wheel < 2 else (math.cos(yaw - bend), math.sin(yaw - bend))
        for i in range(3):
            for j in range(3):
                u, w = (i - 1) * FOOTPRINT_M, (j - 1) * FOOTPRINT_M
                x, y = base_x + c * u - s * w, base_y + s * u + c * w
                points[n, 0], points[n, 1] = x, y
                points[n, 2] = row[_Z] + rise[0] * (x - row[_X]) + rise[1] * (y - row[_Y])
                n += 1
    return points


@nb.njit(cache=True, nogil=True)
def points_at_rest(row: FloatArray, plant: Plant) -> FloatArray:
    """Return the points (36, 3) at which a standing machine asks for the floor."""
    return wheel_points(row, plant, _rise(row))


@nb.njit(cache=True, nogil=True)
def stand(row: FloatArray, plant: Plant, points: FloatArray, heights: FloatArray) -> None:
    """Put the machine on the floor: the plane through both front wheels and the middle of the rear axle, which swings.

    `heights` (36,) are the floor's at `points`; where there is none the floor goes on as it was.
    """
    wheels = np.zeros(4)
    for n in range(4 * _PATCH):
        height = heights[n] if math.isfinite(heights[n]) else points[n, 2]
        wheels[n // _PATCH] += height / _PATCH
    bend = row[_BEND]
    rear_x = -plant.front_m - plant.rear_m * math.cos(bend)
    rear_y = plant.rear_m * math.sin(bend)
    z = 0.5 * (wheels[0] + wheels[1])
    cross = (wheels[0] - wheels[1]) / (2.0 * plant.half_track_m)
    slope = (0.5 * (wheels[2] + wheels[3]) - z - cross * rear_y) / rear_x
    row[_Z], row[_PITCH] = z, -math.atan(slope)
    row[_ROLL] = math.atan(cross * math.cos(row[_PITCH]))

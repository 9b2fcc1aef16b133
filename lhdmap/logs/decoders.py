"""Bytes of a message to `lhdmap.messages`: one small function for each type of the contract, for CDR and ROS 1 alike.

Every function reads through `Cursor`, which checks lengths, and raises InputError for what is no such message.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from lhdmap.errors import InputError
from lhdmap.geometry import se3
from lhdmap.logs.cursor import FLOAT64, Cursor, FieldLayout
from lhdmap.logs.pointcloud import point_cloud
from lhdmap.messages import (
    Command,
    GroundTruth,
    Inclination,
    Joints,
    LaserScan,
    Message,
    Mount,
    PointCloud,
    Pressure,
    Tachometer,
    Text,
    WheelPose,
)
from lhdmap.roles import OLD_TRANSFORMS, ROLES, TEXT, TRANSFORMS, messages_of

Decoder = Callable[[Cursor], tuple[Message, ...]]

_SCAN_NUMBERS = FieldLayout("7f", 4)
_VECTOR = FieldLayout("3d", 8)
_IMU = FieldLayout(
    "37d", 8
)  # quaternion, angular velocity, acceleration, each with a covariance of nine numbers behind it
_POSE = FieldLayout("7d", 8)
_COMMAND = FieldLayout("4d2B", 8)
_MAX_METRES = 1e9


def scan_numbers(cursor: Cursor) -> tuple[int, str, tuple[float, ...]]:
    """Return stamp, frame, and angle min, max, increment, time increment, scan time, range min, max of a LaserScan."""
    stamp, frame = cursor.header()
    return stamp, frame, cursor.numbers(_SCAN_NUMBERS)


def _laser_scan(cursor: Cursor) -> tuple[Message, ...]:
    stamp, frame, numbers = scan_numbers(cursor)
    angle_min, _, increment, time_increment, _, range_min, range_max = numbers
    ranges = cursor.floats32()
    cursor.skip_floats32()  # intensities
    if not (math.isfinite(angle_min) and math.isfinite(increment)):
        raise InputError("angles that are not finite")
    if not math.isfinite(time_increment):
        time_increment = 0.0
    return (LaserScan(stamp, frame, angle_min, increment, time_increment, range_min, range_max, ranges),)


def _imu(cursor: Cursor) -> tuple[Message, ...]:
    stamp, frame = cursor.header()
    numbers = cursor.numbers(_IMU)
    quaternion, covariance = numbers[:4], numbers[4]
    if covariance == -1.0 or not 0.5 < sum([value * value for value in quaternion]) < 2.0:
        raise InputError("no orientation in an Imu message")
    roll, pitch = se3.roll_pitch(*quaternion)
    rate, std = numbers[13:17], _deviation(numbers[16:25:4])
    return (Inclination(stamp, frame, roll, pitch, _measured(rate), _measured(numbers[25:29]), std),)


def _deviation(variances: tuple[float, ...]) -> float | None:
    """Return the largest standard deviation of variances, None where they are not known: zeros."""
    largest = max(variances)
    return math.sqrt(largest) if math.isfinite(largest) and largest > 0.0 else None


def _measured(numbers: tuple[float, ...]) -> np.ndarray[tuple[int], np.dtype[np.float64]] | None:
    """Return a vector with its covariance behind it; None where the first covariance says that it is not measured."""
    x, y, z, covariance = numbers
    return None if covariance == -1.0 or not math.isfinite(x + y + z) else np.array((x, y, z))


def _odometry(cursor: Cursor) -> tuple[Message, ...]:
    stamp, x, y, _, qx, qy, qz, qw = _pose(cursor)
    heading = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    return (WheelPose(int(stamp), x, y, heading),)


def ground_truth(cursor: Cursor) -> tuple[Message, ...]:
    """Decode a nav_msgs/Odometry of a ground-truth topic."""
    stamp, *pose = _pose(cursor)
    return (GroundTruth(int(stamp), np.array(pose[:3]), np.array(pose[3:])),)


def _pose(cursor: Cursor) -> tuple[float, ...]:
    stamp, _ = cursor.header()
    cursor.text()
    pose = cursor.numbers(_POSE)
    if not all(abs(value) < _MAX_METRES for value in pose):
        raise InputError("a pose that is not finite")
    return (stamp, *pose)


def _joints(cursor: Cursor) -> tuple[Message, ...]:
    stamp, _ = cursor.header()
    names = cursor.texts()
    positions, velocities = cursor.floats64(), cursor.floats64()
    if positions and len(positions) != len(names):
        raise InputError(f"{len(names)} joint names and {len(positions)} positions")
    return (Joints(stamp, dict(zip(names, positions, strict=False)), dict(zip(names, velocities, strict=False))),)


def _tachometer(cursor: Cursor) -> tuple[Message, ...]:
    stamp, _ = cursor.header()
    speed = float(cursor.numbers(_VECTOR)[0])
    if not math.isfinite(speed):
        raise InputError("a speed that is not finite")
    return (Tachometer(stamp, speed),)


def _pressure(cursor: Cursor) -> tuple[Message, ...]:
    stamp, _ = cursor.header()
    return (Pressure(stamp, float(cursor.numbers(FLOAT64)[0])),)


def _command(cursor: Cursor) -> tuple[Message, ...]:
    stamp, _ = cursor.header()
    propel, steering_rate, tilt, lift, full_rpm, brake = cursor.numbers(_COMMAND)
    return (Command(stamp, propel, steering_rate, tilt, lift, bool(full_rpm), bool(brake)),)


def _text(cursor: Cursor) -> tuple[Message, ...]:
    return (Text(0, cursor.text()),)


def transforms(cursor: Cursor) -> tuple[Message, ...]:
    """Decode a TFMessage; a transform that is no pose has NaN in it: those beside it in the message are right."""
    return tuple(_transform(cursor) for _ in range(cursor.count(least_bytes=64)))


def _transform(cursor: Cursor) -> Mount:
    stamp, parent = cursor.header()
    child = cursor.text()
    pose = np.array(cursor.numbers(_POSE))
    named = bool(parent and child.lstrip("/"))
    is_pose = (np.abs(pose) < _MAX_METRES).all() and 0.5 < float(pose[3:] @ pose[3:]) < 2.0
    T = se3.from_quaternion(pose[3:], pose[:3]) if named and is_pose else np.full((4, 4), math.nan)
    return Mount(stamp, parent, child.lstrip("/"), T)


_BY_MESSAGE: dict[type[Any], Decoder] = {
    LaserScan: _laser_scan,
    PointCloud: point_cloud,
    Inclination: _imu,
    Joints: _joints,
    Pressure: _pressure,
    Tachometer: _tachometer,
    WheelPose: _odometry,
    GroundTruth: ground_truth,
    Command: _command,
    Text: _text,
    Mount: transforms,
}
# Odometry is that of the wheels, unless the topic is one of ground truth: the first role of a type decodes it.
DECODERS: dict[str, Decoder] = {
    role.type_name: _BY_MESSAGE[next(iter(messages_of(role.type_name)))] for role in ROLES.values()
} | {OLD_TRANSFORMS: transforms}
# Types whose messages carry no stamp of their own, or one that says nothing about a measurement.
UNSTAMPED_TYPES = frozenset({TEXT, TRANSFORMS, OLD_TRANSFORMS})

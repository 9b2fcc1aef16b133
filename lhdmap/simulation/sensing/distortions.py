"""What faults do to the figures of a message, by its type."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from lhdmap.messages import (
    Float32Array,
    FloatArray,
    Inclination,
    Joints,
    LaserScan,
    Message,
    PointCloud,
    Pressure,
    Tachometer,
    WheelPose,
)

MEASURED = (LaserScan, PointCloud, Inclination, Joints, Tachometer, WheelPose, Pressure)
"""Messages with figures that can be wrong."""
Change = Callable[[FloatArray], FloatArray]


def shifted(message: Message, size: float) -> Message:
    """Return a message with `size` added to each of its figures: ranges and places (m), angles (rad), speed (m/s), pressure."""
    return _changed(message, lambda values: values + size)


def with_noise(message: Message, size: float, rng: np.random.Generator) -> Message:
    """Return a message with white noise of the standard deviation `size` on each of its figures."""
    return _changed(message, lambda values: values + size * rng.standard_normal(values.shape))


def unreadable(message: Message) -> Message:
    """Return a message whose figures are not numbers."""
    return _changed(message, lambda values: np.full(values.shape, math.nan))


def _changed(message: Message, change: Change) -> Message:
    match message:
        case LaserScan():
            return message._replace(ranges_m=change(message.ranges_m.astype(float)).astype(np.float32))
        case PointCloud():
            return message._replace(points_m=_along_rays(message.points_m, change))
        case Inclination():
            roll, pitch = change(np.array([message.roll_rad, message.pitch_rad])).tolist()
            return message._replace(roll_rad=roll, pitch_rad=pitch)
        case Joints():
            angles = change(np.array(list(message.positions_rad.values()))).tolist()
            return message._replace(positions_rad=dict(zip(message.positions_rad, angles, strict=True)))
        case Tachometer():
            return message._replace(speed_mps=float(change(np.array(message.speed_mps))))
        case WheelPose():
            x, y = change(np.array([message.x_m, message.y_m])).tolist()
            return message._replace(x_m=x, y_m=y)
        case Pressure():
            return message._replace(pressure_pa=float(change(np.array(message.pressure_pa))))
    return message


def _along_rays(points_m: Float32Array, change: Change) -> Float32Array:
    """Return points whose ranges are changed."""
    ranges = np.linalg.norm(points_m.astype(float), axis=1)
    scaled: Float32Array = (points_m * (change(ranges) / np.maximum(ranges, 1e-6))[:, None]).astype(np.float32)
    return scaled

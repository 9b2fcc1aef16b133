"""The stages run once on a made-up drive before the first message: kernels are loaded, or compiled, while nobody waits."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from lhdmap.config import Settings
from lhdmap.geometry import se3
from lhdmap.machine import Machine
from lhdmap.messages import Inclination, Joints, LaserScan, Message, Mount, Tachometer
from lhdmap.pipeline.mapping import MappingPipeline, feed

_SCANS, _PERIOD_NS, _SPEED_MPS = 90, 40_000_000, 2.0
_JUMP_AT, _JUMP_RAD = 80, 0.35
_HALF_WIDTH_M, _BEAMS, _FOV_RAD = 2.2, 181, math.pi


def warm_up(settings: Settings, machine: Machine | None) -> None:
    """Send seven metres of a drift with two scanners, and a jump at its end, through the mapping stages, and forget them."""
    feed(MappingPipeline(settings, machine or Machine()), _drive())


def _drive() -> Iterator[tuple[str, Message]]:
    start_ns = 1_000_000_000
    yield "tf_static", Mount(start_ns, "base_link", "front", se3.from_rpy(0.0, 0.1, 0.0, (0.0, 0.0, 2.0)))
    yield "tf_static", Mount(start_ns, "rear_link", "rear", se3.from_rpy(0.0, 0.1, math.pi, (-1.0, 0.0, 2.0)))
    for k in range(_SCANS):
        at_ns = start_ns + k * _PERIOD_NS
        x_m = _SPEED_MPS * k * _PERIOD_NS * 1e-9
        yield "inclinometer", Inclination(at_ns, "base_link", 0.0, 0.001 * math.sin(k), np.zeros(3), None)
        yield "joints", Joints(at_ns, {"articulation": 0.0}, {"articulation": 0.0})
        yield "tachometer", Tachometer(at_ns, _SPEED_MPS)
        turned_rad = _JUMP_RAD if k > _JUMP_AT else 0.0  # as after a hole in the link: the pose is searched for
        yield "front", _scan("front", at_ns + 1, x_m, 1.0, turned_rad)
        yield "rear", _scan("rear", at_ns + 2, x_m - 1.0, -1.0, turned_rad)


def _scan(frame: str, stamp_ns: int, x_m: float, ahead: float, turned_rad: float) -> LaserScan:
    """Return what a scanner sees between two wavy walls; `ahead`: 1 where it looks along x, -1 where it looks back."""
    angles = np.linspace(-0.5 * _FOV_RAD, 0.5 * _FOV_RAD, _BEAMS)
    seen_at = angles + turned_rad
    flat_m = _HALF_WIDTH_M / np.maximum(np.abs(np.sin(seen_at)), 0.08)
    ranges_m = flat_m * (1.0 + 0.06 * np.sin(1.3 * (x_m + ahead * flat_m * np.cos(seen_at))))
    increment, step_s = float(angles[1] - angles[0]), 0.5 * _PERIOD_NS * 1e-9 / _BEAMS
    return LaserScan(stamp_ns, frame, float(angles[0]), increment, step_s, 0.1, 40.0, ranges_m.astype(np.float32))

"""Heights that close, on floors whose heights are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.smoothing.closures import Closure
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.space import InSpace, smoothed_in_space

COVARIANCE = np.diag([1e-4, 1e-4, 1e-6])
NO_POINTS = np.zeros((1, 3), np.float32)


def keys_at(poses: FloatArray) -> list[KeyScan]:
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])
    return [KeyScan(k, pose, float(way[k]), NO_POINTS) for k, pose in enumerate(poses)]


def closed(keys: list[KeyScan], told: FloatArray, closures: list[Closure]) -> InSpace:
    """Solve the graph of keys on a floor whose heights were told; the body pitches as they say."""
    way = np.array([key.travelled_m for key in keys])
    pitch = -np.arctan(np.gradient(told, way))
    return smoothed_in_space(keys, np.column_stack([told, np.zeros(len(keys)), pitch]), closures, SmoothingSettings())


def closed_heights(keys: list[KeyScan], told: FloatArray, closures: list[Closure]) -> FloatArray:
    return closed(keys, told, closures).raised_m


def ring(count: int = 120) -> FloatArray:
    """Poses each metre of one and a half laps."""
    angle = np.arange(count) / (2 * count / 3) * 2.0 * np.pi
    radius = 2 * count / 3 / (2.0 * np.pi)
    return np.column_stack([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), angle])


def closures_of(poses: FloatArray, pairs: list[tuple[int, int]]) -> list[Closure]:
    return [Closure(i, j, se2.between(poses[i], poses[j]), COVARIANCE) for i, j in pairs]


def test_a_biased_inclinometer_closes_to_centimetres() -> None:
    """Half a degree: after a lap of 80 m the floor is told 0.7 m too high."""
    poses, lap = ring(), 80
    way = np.arange(len(poses), dtype=float)
    told = 0.5 * np.sin(2.0 * np.pi * way / lap) + math.radians(0.5) * way
    raised = closed_heights(keys_at(poses), told, closures_of(poses, [(k, k + lap) for k in range(0, 40, 2)]))
    heights = told + raised
    assert abs(told[lap] - told[0]) == pytest.approx(0.698, abs=0.01)
    apart = np.abs(heights[lap:] - heights[:40])
    assert apart.mean() < 0.03
    assert apart.max() < 0.07
    assert raised[0] == pytest.approx(0.0, abs=1e-3)
    assert np.abs(np.diff(raised)).max() < 0.02  # the error is shared out along the way


def test_a_slope_between_both_visits_is_respected() -> None:
    """On a ramp of 1:8 the second visit is a metre farther up: it is 12.5 cm higher, not at the same height."""
    there = np.column_stack([np.arange(0.0, 41.0), np.zeros(41), np.zeros(41)])
    back = np.column_stack([np.arange(40.0, -0.5, -1.0) + 0.0, np.full(41, 0.3), np.zeros(41)])
    poses = np.vstack([there, back])
    told = poses[:, 0] / 8.0
    pairs = [(k - 1, len(poses) - 1 - k) for k in range(2, 30)]  # each a metre ahead of the earlier key
    raised = closed_heights(keys_at(poses), told, closures_of(poses, pairs))
    assert np.abs(raised).max() < 1e-6


def test_an_outlier_weighs_little() -> None:
    poses, lap = ring(), 80
    told = np.where(np.arange(len(poses)) < 50, 0.0, 0.1 * (np.arange(len(poses)) - 50.0))
    told[80:] = 0.0  # a hump of 3 m: a closure from its foot to its top asks for as much
    right = closures_of(poses, [(k, k + lap) for k in range(0, 40, 2)])
    clean, with_lie = (
        closed_heights(keys_at(poses), told, right),
        closed_heights(keys_at(poses), told, [*right, *closures_of(poses, [(20, 79)])]),
    )
    assert np.abs(with_lie - clean).max() < 0.1


def test_where_heights_agree_nothing_is_raised() -> None:
    poses = ring()
    told = np.sin(2.0 * np.pi * np.arange(len(poses)) / 80)
    raised = closed_heights(keys_at(poses), told, closures_of(poses, [(k, k + 80) for k in range(0, 40, 4)]))
    assert np.abs(raised).max() < 1e-6

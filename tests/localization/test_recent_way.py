"""The walls of the last metres: their profile is that of the tunnel, whichever way the machine goes along it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.localization.recent_way import RecentWay
from lhdmap.messages import FloatArray

SETTINGS = LandmarkSettings()
HALF_M = 2.0


def wall_m(x: FloatArray) -> FloatArray:
    """Return how far the left wall bulges out at places along the tunnel."""
    return 0.1 * np.sin(2.0 * x)


def hits(pose: FloatArray) -> FloatArray:
    """Return hits (N, 2) on both walls of a straight tunnel along x, in the machine's frame."""
    x = pose[0] + np.linspace(-8.0, 8.0, 161)
    walls = [np.column_stack([x, HALF_M + wall_m(x)]), np.column_stack([x, np.full(len(x), -HALF_M)])]
    seen: FloatArray = se2.transform(se2.inverse(pose), np.vstack(walls))
    return seen


def drive(way: RecentWay, places: FloatArray, lateral_m: float = 0.0, turn_rad: float = 0.0) -> None:
    for x in places:
        pose = np.array([x, lateral_m, turn_rad])
        way.add(pose, hits(pose))


def test_its_profile_is_that_of_the_walls() -> None:
    way = RecentWay(40.0, SETTINGS)
    drive(way, np.arange(0.0, 20.0, 0.2), 0.4)
    live = way.snapshot().profile(SETTINGS, 1.0)
    inner = (live.line[:, 0] > 3.0) & (live.line[:, 0] < 16.0)
    assert way.length_m == pytest.approx(19.8, abs=0.21)
    assert (live.values[0] + live.values[1])[inner] == pytest.approx(2 * HALF_M + wall_m(live.line[inner, 0]), abs=0.03)
    assert np.nanmax(np.abs(live.values[2][inner])) < 0.02
    assert live.line[0, 0] < -3.0  # what the rear scanner sees
    assert live.line[-1, 0] > 21.0


def test_going_back_along_the_way_adds_nothing() -> None:
    way = RecentWay(40.0, SETTINGS)
    drive(way, np.arange(0.0, 10.0, 0.2))
    drive(way, np.arange(10.0, 4.0, -0.2))
    assert way.length_m == pytest.approx(10.0, abs=0.3)
    drive(way, np.arange(4.0, -5.0, -0.2))
    assert way.length_m == pytest.approx(15.0, abs=0.4)


def test_in_reverse_gear_it_is_the_other_way_round() -> None:
    way = RecentWay(40.0, SETTINGS)
    drive(way, np.arange(20.0, 0.0, -0.2))  # facing +x, going to -x
    live = way.snapshot().profile(SETTINGS, 1.0)
    assert live.line[-1, 0] > live.line[0, 0]  # its profile runs as the machine faces


def test_another_way_is_not_the_former_one() -> None:
    way = RecentWay(40.0, SETTINGS)
    drive(way, np.arange(0.0, 10.0, 0.2))
    drive(way, np.arange(10.0, 5.0, -0.2))
    for k in range(20):  # off to the left, on a circle
        turn = 0.1 * k
        way.add(np.array([5.0 + 2.0 * math.sin(turn), 2.0 - 2.0 * math.cos(turn), turn]), np.zeros((0, 2)))
    line = way.snapshot().way
    assert line[:, 0].max() < 9.0  # what lay ahead on the former way is forgotten
    assert line[-1, 1] > 2.0


def test_memory_ends_with_the_window() -> None:
    way = RecentWay(15.0, SETTINGS)
    drive(way, np.arange(0.0, 60.0, 0.2))
    assert way.length_m <= 15.0
    points, counts = way.cells()
    assert len(points) == len(counts)
    assert points[:, 0].min() > 60.0 - 15.0 - 4.0 - 10.0
    assert way.snapshot(6.0).length_m <= 6.0

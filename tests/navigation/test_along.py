"""Where a place is on a path that passes it more than once: levels above each other, loops, crossings."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.guidance.directive import WAY, path_of
from lhdmap.messages import FloatArray
from lhdmap.navigation.along import along_m
from lhdmap.navigation.leg import Leg
from lhdmap.navigation.progress import LegProgress

TURN_M = 2.0 * math.pi * 20.0


def helix(turns: float = 3.0) -> FloatArray:
    """Return the path of a ramp that winds up over itself, in plan."""
    t = np.linspace(0.0, turns * 2.0 * math.pi, 1200)
    return path_of(20.0 * np.column_stack([np.cos(t), np.sin(t)]), 2.0)


def at(path: FloatArray, way_m: float) -> tuple[float, float]:
    x, y = (float(np.interp(way_m, path[:, WAY], path[:, k])) for k in (0, 1))
    return x, y


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_a_machine_on_a_ramp_stays_on_its_turn(turn: int) -> None:
    path = helix()
    begin = float(path[0, WAY])
    for way_m in np.arange(begin + turn * TURN_M + 5.0, begin + (turn + 0.9) * TURN_M, 1.5):
        assert along_m(path, *at(path, way_m), way_m - 1.5) == pytest.approx(way_m, abs=0.15)


def test_at_the_begin_it_is_the_first_turn() -> None:
    path = helix()
    assert along_m(path, *at(path, float(path[0, WAY]) + 2.0 * TURN_M + 9.0)) == pytest.approx(
        path[0, WAY] + 9.0, abs=0.2
    )


def test_a_place_that_has_jumped_is_found_again() -> None:
    line = path_of(np.column_stack([np.arange(0.0, 80.0, 0.25), np.zeros(320)]), 2.0)
    assert along_m(line, 60.0, 0.4, 10.0) == pytest.approx(60.0, abs=0.05)
    assert along_m(line, 12.0, 0.4, 10.0) == pytest.approx(12.0, abs=0.05)


def test_a_leg_is_begun_anew_and_not_where_the_one_before_ended() -> None:
    """What was: on the lower level under its goal a machine took its place for one on the level above, 300 m ahead."""
    path, progress = helix(), LegProgress()
    progress.begin([Leg(1, path, float(path[-1, WAY]), float(path[-1, WAY]), (), inversion=False)] * 2)
    begin = float(path[0, WAY])
    for way_m in np.arange(begin + 1.0, begin + 2.5 * TURN_M, 1.0):
        progress.place(path, *at(path, way_m))
        assert progress.at_m == pytest.approx(way_m, abs=0.15)
    assert progress.begun_m == pytest.approx(begin + 1.0, abs=0.1)
    progress.stopped()
    progress.place(path, *at(path, begin + 2.0))
    assert progress.at_m == pytest.approx(begin + 2.0, abs=0.1)

"""What the wheels' turn is off by is learned from turns that are known, and stands in where nothing is seen."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.settings import OdometrySettings
from lhdmap.odometry.steps import WheelStep
from lhdmap.odometry.wheels.stretch import Compared, WheelStretch
from lhdmap.odometry.wheels.turn import WheelTurn

from tests.odometry.planar_drives import LEVEL, RATE_HZ, drive

STEP_M = 0.1
SIGMA_RAD = math.radians(0.2)


def _turns(count: int, seed: int = 0) -> FloatArray:
    """Turns (rad) of a drive through bends to both sides, at steps of 0.1 m."""
    rng = np.random.default_rng(seed)
    return np.repeat(rng.uniform(-0.02, 0.02, -(-count // 25)), 25)[:count]


def _driven(turn: WheelTurn, true_rad: FloatArray, wheels_rad: FloatArray) -> WheelTurn:
    pose, stretch = np.zeros(3), WheelStretch()
    stretch.matched(pose)
    for true, wheels in zip(true_rad, wheels_rad, strict=True):
        pose = se2.compose(pose, np.array([STEP_M, 0.0, true]))
        stretch.measured(STEP_M, float(wheels), SIGMA_RAD)
        compared = stretch.matched(pose)
        if compared is not None:
            turn.learn(compared)
    return turn


@settings(max_examples=30, deadline=None)
@given(st.floats(0.92, 1.08), st.floats(-0.08, 0.08), st.integers(0, 100))
def test_scale_and_curvature_are_learned(scale: float, curvature: float, seed: int) -> None:
    true = _turns(3000, seed)
    noise = SIGMA_RAD * np.random.default_rng(seed).standard_normal(len(true))
    turn = _driven(WheelTurn(0.05, 0.05), true, scale * true + curvature * STEP_M + noise)
    sigmas = np.sqrt(np.diag(turn._P))
    assert sigmas[0] < 0.015  # it began with 0.05 for both
    assert sigmas[1] < 0.002
    assert np.all(np.abs(turn.state - [scale, curvature]) < 3.0 * sigmas)
    right, sigma_rad = turn.corrected(scale * 0.3 + curvature * 2.0, 2.0)
    assert sigma_rad < 0.01
    assert abs(right - 0.3) < 3.0 * sigma_rad


def test_wheels_that_come_late_keep_their_scale() -> None:
    """From scan to scan, late turns look too small: a fit of them said 0.75 of wheels that are right."""
    rng = np.random.default_rng(3)
    true = rng.normal(0.0, 0.05, 4000)  # jerky, as a robot between people
    late = 0.5 * (true + np.roll(true, 1))
    turn = _driven(WheelTurn(0.05, 0.05), true, late)
    assert turn.state[0] == pytest.approx(1.0, abs=0.05)


def test_what_is_known_to_be_right_is_left() -> None:
    turn = _driven(WheelTurn(0.0, 0.0), _turns(500), 1.1 * _turns(500) + 0.05 * STEP_M)
    assert turn.corrected(0.2, 1.0) == (0.2, 0.0)


def test_a_stretch_that_was_not_seen_whole_is_not_compared() -> None:
    stretch, pose = WheelStretch(), np.zeros(3)
    for _ in range(20):
        assert stretch.matched(pose) is None
        stretch.missed()  # the wheels slipped
        stretch.measured(0.9, 0.3, SIGMA_RAD)
        pose = se2.compose(pose, np.array([0.9, 0.0, 0.0]))


def test_a_stretch_is_what_was_driven_in_it() -> None:
    stretch = WheelStretch()
    stretch.matched(np.array([3.0, 1.0, 0.5]))
    stretch.measured(0.6, 0.1, 0.02)
    middle = se2.compose(np.array([3.0, 1.0, 0.5]), np.array([0.7, 0.0, 0.2]))
    assert stretch.matched(middle) is None
    stretch.measured(-0.5, 0.1, 0.02)
    compared = stretch.matched(se2.compose(middle, np.array([-0.4, 0.0, 0.3])))
    assert compared == pytest.approx((0.1, 0.2, 8e-4, 0.3, 0.5, 1.1))


def test_a_leap_teaches_nothing() -> None:
    turn = _driven(WheelTurn(0.05, 0.05), _turns(1000), _turns(1000))
    before = turn.state.copy()
    turn.learn(Compared(5.0, 2.0, SIGMA_RAD**2, 5.0, 0.0, 5.0))
    assert turn.state == pytest.approx(before, abs=1e-9)


def test_wheels_that_turn_on_their_own_hold_the_heading_where_nothing_is_seen() -> None:
    """Two seconds without returns at 3.3 m/s; the wheels turn by 0.06 rad/m too much (Intel's log), 23 deg over it."""
    poses, scans = drive()
    steps = [np.zeros(3), *(se2.between(a, b) for a, b in itertools.pairwise(poses))]
    blind = range(130, 130 + int(2 * RATE_HZ))

    def heading_error_deg(curvature_std: float) -> float:
        odometry = PlanarOdometry(OdometrySettings(wheel_curvature_std=curvature_std))
        error = math.nan
        for k, (scan, step) in enumerate(zip(scans, steps, strict=True)):
            wheels = WheelStep(float(step[0]), 0.01, float(step[2] + 0.06 * step[0]), 0.001)
            seen = scan._replace(ranges_m=np.full_like(scan.ranges_m, np.inf)) if k in blind else scan
            pose = odometry.update(seen, LEVEL, wheels).pose_odom_base
            if k == blind[-1]:
                error = math.degrees(se2.wrap(float(pose[2] - (poses[k, 2] - poses[0, 2]))))
        return abs(error)

    assert heading_error_deg(0.05) < 1.0
    assert heading_error_deg(0.0) > 15.0

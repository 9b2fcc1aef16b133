"""A gyroscope stands in where the walls do not hold the heading, and one that is wrong is found out and left alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.odometry.motion import PlanarMotion
from lhdmap.odometry.settings import OdometrySettings
from lhdmap.odometry.wheels.gyro import GyroTurn

DT_S = 0.04


def _drive(
    factor: float = 1.0, bias_dps: float = 0.2, seconds: float = 60.0, frozen: bool = False
) -> tuple[GyroTurn, PlanarMotion]:
    """Drive through bends that walls see; the gyroscope turns `factor` times as far, with a bias."""
    motion = PlanarMotion(OdometrySettings())
    gyro, pose = GyroTurn(motion), np.zeros(3)
    for k in range(round(seconds / DT_S)):
        turn = (0.25 * math.sin(0.3 * k * DT_S)) * DT_S
        pose = pose + np.array([0.0, 0.0, turn])
        motion.predict(DT_S)
        gyro.fuse(0.0 if frozen else factor * turn + math.radians(bias_dps) * DT_S, DT_S)
        motion.correct(pose, np.diag([1e5, 1e5, 1e7]))
        gyro.learn(pose, held=True)
    return gyro, motion


def test_where_walls_hold_the_heading_it_changes_nothing() -> None:
    gyro, _ = _drive()
    assert gyro.believed
    assert gyro.used == 0
    assert gyro.warning() is None


def test_it_holds_the_heading_where_nothing_is_seen() -> None:
    """Three seconds in the dark, in which the machine begins to turn."""
    gyro, motion = _drive()
    before = motion.pose[2]
    gyro.learn(motion.pose, held=False)
    for _ in range(round(3.0 / DT_S)):
        motion.predict(DT_S)
        gyro.fuse((0.3 + math.radians(0.2)) * DT_S, DT_S)
        gyro.learn(motion.pose, held=False)
    assert gyro.used > 0
    assert motion.pose[2] - before == pytest.approx(0.9, abs=math.radians(1.0))


@pytest.mark.parametrize(
    ("factor", "frozen", "said"), [(-1.0, False, "sign"), (57.3, False, "degrees"), (1.0, True, "stand still")]
)
def test_one_that_is_wrong_is_not_believed(factor: float, frozen: bool, said: str) -> None:
    gyro, motion = _drive(factor, frozen=frozen)
    assert not gyro.believed
    assert said in (gyro.warning() or "")
    gyro.learn(motion.pose, held=False)
    before = motion.state.copy()
    gyro.fuse(0.5, DT_S)
    assert np.array_equal(motion.state, before)


def test_one_that_was_not_seen_to_turn_is_not_believed() -> None:
    gyro, _ = _drive(seconds=2.0)
    assert not gyro.believed

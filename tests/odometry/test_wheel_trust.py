"""Wheels that are wrong altogether do no harm where walls hold the motion, and are told of."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.start import ScanInput, starting_velocity
from lhdmap.odometry.steps import WheelStep
from lhdmap.odometry.wheels.stretch import Compared
from lhdmap.odometry.wheels.trust import WheelTrust

from tests.odometry.planar_drives import LEVEL, WARM_SCANS, Driven, along, drive, scans_at


def _taught(*ratios: float, walls_m: float = 1.0) -> WheelTrust:
    trust = WheelTrust()
    for ratio in ratios:
        trust.learn(Compared(ratio * walls_m, 0.0, 0.0, walls_m, 0.0, abs(walls_m)))
    return trust


def test_wheels_are_believed_until_walls_speak_against_them() -> None:
    assert WheelTrust().believed
    assert _taught(1.1, 0.9, 0.85).believed
    assert not _taught(-1.0).believed
    assert not _taught(3.6, 3.6).believed


def test_a_moment_of_slip_does_not_undo_what_was_right_for_long() -> None:
    assert _taught(*[1.0] * 30, 1.6).believed
    assert not _taught(*[1.0] * 30, *[2.5] * 10).believed
    assert _taught(*[2.5] * 30, *[1.0] * 8).believed


@pytest.mark.parametrize(
    ("ratio", "length_m", "word"),
    [(-1.0, 30, "sign"), (3.6, 108, "km/h"), (0.0, 30, "stand still"), (2.0, 60, "2 times the scans' speed")],
)
def test_the_warning_says_what_it_may_come_from(ratio: float, length_m: int, word: str) -> None:
    warning = _taught(*[ratio] * 30).warning()
    assert warning is not None
    assert word in warning
    assert f"{length_m} of {length_m} m" in warning


def test_a_few_metres_are_not_worth_a_warning() -> None:
    assert _taught(*[1.0] * 200, *[3.0] * 4).warning() is None
    assert _taught(*[1.0] * 200, *[0.0] * 15).warning() is None


def test_a_stretch_that_was_hardly_driven_says_nothing() -> None:
    assert _taught(-1.0, -1.0, walls_m=0.1).believed


def _with_wheels(poses: FloatArray, wheels: Callable[[float], float]) -> tuple[Driven, PlanarOdometry]:
    """Return the drive with wheels that say something else of each step forward (m), begun as the pipeline does."""
    steps = [0.0, *(float(se2.between(a, b)[0]) for a, b in itertools.pairwise(poses))]
    inputs = [
        ScanInput(scan, LEVEL, WheelStep(wheels(step), 0.005, None, 1.0))
        for scan, step in zip(scans_at(poses), steps, strict=True)
    ]

    def make(velocity: FloatArray | None) -> PlanarOdometry:
        return PlanarOdometry(velocity=velocity)

    odometry = make(starting_velocity(make, inputs[:WARM_SCANS]))
    out = [odometry.update(*one) for one in inputs]
    estimate = np.array([se2.compose(poses[0], step.pose_odom_base) for step in out])
    return Driven(estimate, poses, out), odometry


@pytest.mark.parametrize("factor", [-1.0, 0.0, 3.6], ids=["sign", "torn off", "km/h"])
@pytest.mark.parametrize("start", ["at speed", "from rest"])
def test_wrong_wheels_leave_a_drive_between_rough_walls_as_it_is(factor: float, start: str) -> None:
    poses = drive()[0] if start == "at speed" else along(np.minimum(np.arange(220) / 50.0, 3.0))
    driven, odometry = _with_wheels(poses, lambda step: factor * step)
    assert driven.distance_m.max() < 0.25  # where wheels pull the first scans off
    assert driven.distance_m[-1] < 0.02
    assert not any(step.lost for step in driven.steps)
    assert not odometry.wheels.trust.believed or factor == 0.0


def test_a_tachometer_without_sign_does_not_turn_a_drive_round() -> None:
    """On real machines it often has none: after half a second of reverse it was believed against the walls."""
    speeds = np.concatenate([np.full(120, 3.0), np.linspace(3.0, -3.0, 60), np.full(90, -3.0)])
    driven, odometry = _with_wheels(along(speeds, 300), abs)
    assert driven.distance_m.max() < 0.4  # where it turns
    assert driven.distance_m[-1] < 0.02
    assert odometry.wheels.trust.against_m > 5.0

"""Pose against scan: what jumps, what slips, and what is not known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.localization.agreement import Agreement
from lhdmap.messages import FloatArray
from lhdmap.proprioception.wheels import WheelMotion

STEP_NS = 80_000_000
SPEED_MPS = 3.0


def motion(way_m: float, turn_rad: float = 0.0, source: str = "articulated") -> WheelMotion:
    return WheelMotion(np.array([way_m, 0.0, turn_rad]), np.eye(3) * 1e-6, source)  # type: ignore[arg-type]


def told(
    slip: float = 0.0, turned_rad: float = 0.0, source: str = "articulated", jump_m: float = 0.0
) -> tuple[float, float]:
    """Return the most that a straight drive of a second gives where the wheels measure so much more, or the scans jump."""
    agreement = Agreement(
        lambda a, b: motion((1.0 + slip) * SPEED_MPS * (b - a) * 1e-9, turned_rad * (b - a) * 1e-9, source)
    )
    worst = np.zeros(2)
    for k in range(13):
        jumped = jump_m if k > 6 else 0.0
        worst = np.maximum(worst, agreement.of_motion(k * STEP_NS, place(SPEED_MPS * k * STEP_NS * 1e-9 + jumped)))
    return float(worst[0]), float(worst[1])


def place(x_m: float) -> FloatArray:
    return np.array([x_m, 0.0, 0.0])


def test_slip_is_no_disagreement_a_jump_is() -> None:
    assert told() == pytest.approx((0.0, 0.0), abs=1e-9)
    assert told(slip=0.08)[0] == pytest.approx(0.0, abs=1e-9)
    assert told(jump_m=0.5)[0] > 0.3
    assert told(slip=-1.0)[0] > 1.0  # wheels stand, scans go on
    assert told(turned_rad=math.radians(8.0))[1] > math.radians(1.0)
    assert told(turned_rad=math.radians(8.0), source="tachometer")[1] == 0.0


def test_without_wheels_nothing_is_said() -> None:
    agreement = Agreement(lambda a, b: None)
    assert [agreement.of_motion(k * STEP_NS, place(5.0 * k)) for k in range(4)] == [(0.0, 0.0)] * 4


def test_the_pose_on_the_map_may_not_jump_against_the_odometry() -> None:
    agreement = Agreement(lambda a, b: None)
    assert agreement.of_map(np.array([10.0, 5.0, 0.5]), place(0.0), known=True) == (0.0, 0.0)
    ahead = np.array([10.0 + math.cos(0.5), 5.0 + math.sin(0.5), 0.5])
    assert agreement.of_map(ahead, place(1.0), known=True) == pytest.approx((0.0, 0.0), abs=1e-9)
    jumped = agreement.of_map(ahead + np.array([0.3, 0.0, 0.02]), place(1.0), known=True)
    assert jumped == pytest.approx((0.3, 0.02))
    assert agreement.of_map(ahead, place(1.0), known=False) == (0.0, 0.0)
    assert agreement.of_map(ahead + 5.0, place(1.0), known=True) == (0.0, 0.0)  # found again elsewhere: no jump

"""Weighing: the lift pressure is Table 2's, and swings after a stop."""

from __future__ import annotations

import numpy as np
import pytest
from lhdmap.simulation.ground.rig import lift_bar, press_force_n, tilt_bar

from tests.simulation.ground.digs import MACHINE

PAYLOAD_KG = MACHINE.drive.payload_kg
M, N = 0.0207, 1.0774  # Table 2


@pytest.mark.parametrize("fill", [0.0, 0.5, 1.0, 1.1])
def test_the_lift_pressure_is_table_2_at_its_boom(fill: float) -> None:
    assert M * lift_bar(MACHINE, 0.2, fill * PAYLOAD_KG) - N == pytest.approx(fill, abs=0.01)


def test_a_bar_is_two_percent() -> None:
    per_bar = 1.0 / (lift_bar(MACHINE, 0.2, PAYLOAD_KG) - lift_bar(MACHINE, 0.2, 0.0))
    assert per_bar == pytest.approx(0.0207, rel=0.005)


def test_another_boom_angle_is_an_error() -> None:
    pressures = [lift_bar(MACHINE, boom, PAYLOAD_KG) for boom in (0.188, 0.2, 0.212)]
    assert np.abs(np.diff(pressures) / 48.4).max() < 0.012  # findings, section 8: 1 % for 0.012 rad
    assert lift_bar(MACHINE, 1.2, PAYLOAD_KG) < lift_bar(MACHINE, 0.2, PAYLOAD_KG)


def test_press_and_tilt_pressure_agree() -> None:
    assert press_force_n(MACHINE, 12.0) == 0.0
    for bar in (23.0, 60.0, 250.0):
        assert tilt_bar(MACHINE, press_force_n(MACHINE, bar) / 190e3) == pytest.approx(bar)

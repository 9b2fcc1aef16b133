"""Forces of the rock against the equations they are from."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.simulation.ground.draws import draw_load
from lhdmap.simulation.ground.earth import (
    RAKES_RAD,
    bearing,
    bearing_table,
    breaking,
    earth_force,
    penetration,
    plate_rake,
)
from lhdmap.simulation.ground.records import Rock, record
from lhdmap.simulation.ground.rig import rig_of
from lhdmap.simulation.ground.sections import Grounds
from scipy.optimize import minimize_scalar

from tests.simulation.ground.digs import MACHINE

RIG = rig_of(MACHINE)[0]
PHI, DELTA = math.radians(39.0), math.radians(23.5)


def rock(**values: float) -> Rock:
    base = Rock(*[0.0] * len(Rock._fields))._replace(density=2000.0, hardness=1.0, penetration=0.165, fee_scale=1.0)
    return record(base._replace(external_rad=DELTA, **values))[0]


def test_the_earth_moving_equations_n_gamma() -> None:
    """McKyes: (cot ρ + cot β) / (2 (cos(ρ + δ) + sin(ρ + δ) cot(β + φ))), the least over the failure angle β."""

    def n_gamma(fail: float) -> float:
        spread = 1.0 / math.tan(0.7) + 1.0 / math.tan(fail)
        return spread / (2.0 * (math.cos(0.7 + DELTA) + math.sin(0.7 + DELTA) / math.tan(fail + PHI)))

    least = minimize_scalar(n_gamma, bounds=(0.2, 1.0), method="bounded")
    assert bearing(0.7, PHI, DELTA)[0] == pytest.approx(least.fun, rel=1e-3)
    assert bearing(0.7, PHI, DELTA)[2] == pytest.approx(2.0 * least.fun, rel=1e-3)


def test_a_flat_plate_has_no_bearing_but_the_separation_plate_has() -> None:
    assert bearing(0.02, PHI, DELTA)[0] > 15.0  # trap 1 of the prototype
    assert [bearing(plate_rake(psi), PHI, DELTA)[0] for psi in (-0.2, 0.0, 0.3)] == pytest.approx([1.9] * 3, abs=0.15)


@given(st.floats(-0.2, 1.2), st.floats(34.0, 44.0), st.floats(20.0, 27.0))
def test_bearing_is_finite_at_any_angle_of_the_bucket(psi: float, phi_deg: float, delta_deg: float) -> None:
    values = bearing(plate_rake(psi), math.radians(phi_deg), math.radians(delta_deg))
    assert all(math.isfinite(value) and 0.0 <= value < 12.0 for value in values)


def test_the_table_is_the_equation() -> None:
    table = bearing_table(PHI, DELTA)
    rakes = np.linspace(*RAKES_RAD, len(table))
    for psi in (-0.1, 0.05, 0.31, 0.6):
        want = bearing(plate_rake(psi), PHI, DELTA)[0] * 2000.0 * 9.81 * 0.8**2 * 2.4
        assert earth_force(rock(), RIG, table, psi, 0.8, 0.0) == pytest.approx(want, rel=5e-3)
    assert rakes[0] == plate_rake(-0.2)


def test_penetration_is_the_prototypes() -> None:
    assert penetration(rock(hardness=2.7), RIG, 0.75, 0.0, 1.0) == pytest.approx(231e3, rel=2e-3)
    up = penetration(rock(hardness=2.7, rake_factor=2.1), RIG, 0.75, 0.2, 1.0)
    assert up == pytest.approx(231e3 * 1.42, rel=2e-3)


def test_a_rising_lip_breaks_rock() -> None:
    assert breaking(rock(hardness=4.0, tensile_pa=2e4), RIG, 0.5, 1.0) == pytest.approx(2.2 * 0.5 * 2.4 * 2e4 * 2.0)
    assert breaking(rock(hardness=4.0, tensile_pa=2e4), RIG, 0.0, 1.0) == 0.0


def test_loads_differ_as_the_file_says() -> None:
    ground = Grounds()
    logs = np.log([draw_load(ground, seed).rock["hardness"][0] for seed in range(400)])
    assert logs.mean() == pytest.approx(math.log(ground.rock.hardness), abs=0.1)
    assert logs.std() == pytest.approx(ground.rock.hardness_sigma, rel=0.12)

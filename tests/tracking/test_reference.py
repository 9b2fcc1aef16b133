"""The reference curve: it is one the machine can go, z0 + z1 = 0 on it, in both directions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.tracking.equations import equilibrium
from lhdmap.tracking.kernel import front_axle
from lhdmap.tracking.path import STEP_M, Path, beside, path_of
from lhdmap.tracking.reference import Curve, reference_of

from tests.tracking.machines import LENGTHS
from tests.tracking.paths import bend, exact, straight

CLOTHOIDS = exact(np.concatenate([straight(20.0), bend(12.0, 90.0, 8.0), straight(20.0)]))
STEP = exact(np.concatenate([straight(20.0), bend(12.0, -90.0, 0.0), straight(20.0)]))


def laid(name: str, gear: int, *, step: bool = False, most: float = 0.15) -> tuple[Path, Curve]:
    path = path_of((STEP if step else CLOTHOIDS)[::10, :2], 0.8, 9.0)
    return path, reference_of(path, gear, np.full(len(path.points), most), LENGTHS[name])


def offsets(path: Path, curve: Curve, name: str) -> np.ndarray:
    found, near = [], 0.0
    for row in curve.rows:
        state = (row[0], row[1], row[2], row[4], 0.0)
        x0, y0, _ = front_axle(state, (*LENGTHS[name], 0.1))
        near = beside(path.points, row[0], row[1], near, 2.0, 2.0)[0]
        found.append(
            (
                beside(path.points, x0, y0, near + 3.5, 4.0, 4.0)[1],
                beside(path.points, row[0], row[1], near, 1.0, 1.0)[1],
            )
        )
    return np.array(found)


@pytest.mark.parametrize("name", LENGTHS)
@pytest.mark.parametrize("step", [False, True])
def test_both_axles_are_as_far_from_the_path(name: str, step: bool) -> None:
    path, curve = laid(name, 1, step=step)
    z = offsets(path, curve, name)
    assert np.abs(z.sum(axis=1)).max() < (0.004 if step else 0.0005)
    own = abs(LENGTHS[name][0] ** 2 - LENGTHS[name][1] ** 2) / 4.0 / 12.0  # Eq. (10) at R 12
    assert np.abs(z).max() < own + (0.09 if step else 0.03)


@pytest.mark.parametrize("name", LENGTHS)
def test_it_is_the_equilibrium_on_the_arc(name: str) -> None:
    _, curve = laid(name, 1)
    assert curve.rows[:, 4].max() == pytest.approx(equilibrium(1 / 12, LENGTHS[name])[4], rel=0.02)
    assert curve.miss_m < 0.0005


@pytest.mark.parametrize("name", LENGTHS)
def test_the_machine_can_go_it(name: str) -> None:
    """Each row leads to the next, by Eq. (3) without slip."""
    _, curve = laid(name, 1, step=True)
    front_m, rear_m = LENGTHS[name]
    rows = curve.rows
    u, middle = rows[:-1, 5], rows[:-1, 4] + 0.5 * STEP_M * rows[:-1, 5]
    turn = (np.sin(middle) - front_m * u) / (front_m + rear_m * np.cos(middle))
    assert np.diff(rows[:, 2]) == pytest.approx(STEP_M * turn, abs=1e-6)
    assert np.diff(rows[:, 4]) == pytest.approx(STEP_M * u, abs=1e-6)
    course = rows[:-1, 2] + 0.5 * STEP_M * turn
    assert np.diff(rows[:, 0]) == pytest.approx(STEP_M * np.cos(course), abs=1e-6)


def test_the_joint_is_no_quicker_than_it_may_be() -> None:
    _, curve = laid("truck", 1, step=True, most=0.045)
    assert np.abs(curve.rows[:, 5]).max() <= 0.045 + 1e-9


@pytest.mark.parametrize("name", LENGTHS)
def test_it_is_one_curve_in_both_directions(name: str) -> None:
    path, ahead = laid(name, 1)
    _, back = laid(name, -1)
    assert back.rows == pytest.approx(ahead.rows, abs=1e-12)
    assert (ahead.gear, back.gear) == (1, -1)
    x0, y0, _ = front_axle((*ahead.at(ahead.to_m)[[0, 1, 2, 4]].tolist(), 0.0), (*LENGTHS[name], 0.1))
    assert math.dist((x0, y0), CLOTHOIDS[::10][-1, :2]) < 0.1
    assert math.dist(back.at(back.to_m)[:2], CLOTHOIDS[0, :2]) < 0.1
    assert path.length_m > 70.0


def test_a_path_that_no_machine_follows_is_refused() -> None:
    hairpin = exact(np.concatenate([straight(15.0), bend(1.0, 178.0, 0.0), straight(15.0)]))
    path = path_of(hairpin[::3, :2], 0.2, 9.0)
    with pytest.raises(InputError, match="curve"):
        reference_of(path, 1, np.full(len(path.points), 0.02), LENGTHS["truck"])

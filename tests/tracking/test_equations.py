"""Eqs. (8) to (12): against rigid geometry and finite differences, the equilibrium, what can be controlled, what is printed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.messages import FloatArray
from lhdmap.tracking.equations import equilibrium, outputs, printed, rates, reduced
from lhdmap.tracking.kernel import State, front_axle, front_speed, moved, rear_speed

from tests.tracking.machines import LENGTHS

TINY_S = 1e-5
STIFF_S = 1e-8  # a joint without lag
moved(
    (0.0, 0.0, 0.0, 0.0, 0.0), 1.0, 0.0, 0.1, (1.0, 1.0, 0.1), (0.0, 0.0)
)  # compiled once, before hypothesis counts the time

machines = st.sampled_from(sorted(LENGTHS))
curvatures = st.floats(-1 / 12, 1 / 12).map(lambda k: k if abs(k) > 1e-3 else 0.0)
speeds = st.floats(-8.0, 8.0).filter(lambda v: abs(v) > 0.3)


def on_circle(state: State, curvature: float, lengths: tuple[float, float]) -> FloatArray:
    """p (5,) beside a circle through the origin, heading along x there: pure geometry."""
    x0, y0, ahead = front_axle(state, (*lengths, 0.0))
    found = []
    for x, y, heading in ((x0, y0, ahead), (state[0], state[1], state[2])):
        if curvature == 0.0:
            found.append((y, heading))
            continue
        radius = 1.0 / curvature
        dx, dy = x, y - radius
        side = math.copysign(1.0, radius)
        course = math.atan2(side * dx, -side * dy)
        turned = (heading - course + math.pi) % (2.0 * math.pi) - math.pi
        found.append((side * (abs(radius) - math.hypot(dx, dy)), turned))
    return np.array([found[0][0], found[1][0], found[0][1], found[1][1], state[3]])


@given(
    machines, speeds, st.floats(-0.3, 0.3), curvatures, st.floats(-1.0, 1.0), st.floats(-0.5, 0.5),
    st.floats(-0.6, 0.6),
)  # fmt: skip
def test_corrected_rates_are_those_of_the_moving_machine(
    name: str, speed: float, rate: float, curvature: float, z: float, heading: float, bend: float
) -> None:
    lengths = LENGTHS[name]
    state = (0.0, z, heading, bend, rate)
    after = moved(state, speed, rate, TINY_S, (*lengths, STIFF_S), (0.0, 0.0))
    before = moved(state, speed, rate, -TINY_S, (*lengths, 1e9), (0.0, 0.0))
    difference = (on_circle(after, curvature, lengths) - on_circle(before, curvature, lengths)) / (2.0 * TINY_S)
    told = rates(on_circle(state, curvature, lengths), speed, rate, (curvature, curvature), lengths)
    assert np.abs(difference - told).max() < 1e-6


@given(machines, speeds, st.floats(-0.7, 0.7), st.floats(-0.3, 0.3), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
def test_both_axles_move_along_their_course(
    name: str, speed: float, bend: float, rate: float, front: float, rear: float
) -> None:
    lengths = (*LENGTHS[name], STIFF_S)
    state = (1.0, 2.0, 0.4, bend, rate)
    after = moved(state, speed, rate, TINY_S, lengths, (front, rear))
    for (x, y, heading), (x1, y1, _), slip in (
        (front_axle(state, lengths), front_axle(after, lengths), front),
        (state[:3], after[:3], rear),
    ):
        across = -math.sin(heading + slip) * (x1 - x) + math.cos(heading + slip) * (y1 - y)
        assert abs(across) / TINY_S < 2e-4


@given(machines, speeds, st.floats(-0.7, 0.7), st.floats(-0.3, 0.3))
def test_speeds_of_both_axles_go_into_each_other(name: str, speed: float, bend: float, rate: float) -> None:
    lengths = (*LENGTHS[name], 0.2)
    assert rear_speed(front_speed(speed, bend, rate, lengths), bend, rate, lengths) == pytest.approx(speed)


@given(machines, st.floats(-1 / 9, 1 / 9), speeds)
def test_the_equilibrium_stays(name: str, curvature: float, speed: float) -> None:
    rest = equilibrium(curvature, LENGTHS[name])
    assert rest[0] + rest[1] == 0.0
    assert np.abs(rates(rest, speed, 0.0, (curvature, curvature), LENGTHS[name])).max() < 1e-14


def jacobian(name: str, curvature: float, *, as_printed: bool) -> FloatArray:
    lengths, rest = LENGTHS[name], equilibrium(curvature, LENGTHS[name])

    def drift(p: FloatArray) -> FloatArray:
        return printed(p, curvature, lengths)[0] if as_printed else rates(p, 1.0, 0.0, (curvature, curvature), lengths)

    steps = 1e-6 * np.eye(5)
    return np.stack([(drift(rest + one) - drift(rest - one)) / 2e-6 for one in steps], axis=1)


@pytest.mark.parametrize("name", LENGTHS)
@pytest.mark.parametrize("curvature", [0.0, 1 / 12, -1 / 30])
def test_the_open_loop_is_not_hurwitz(name: str, curvature: float) -> None:
    """The paper says that it is; its eigenvalues are 0 and twice ±iκ."""
    found = np.sort_complex(np.linalg.eigvals(jacobian(name, curvature, as_printed=False)))
    assert np.abs(found.real).max() < 2e-4
    turning = abs(curvature / (1.0 - curvature * equilibrium(curvature, LENGTHS[name])[1]))  # of the rear axle's circle
    assert np.sort(np.abs(found.imag)) == pytest.approx(turning * np.array([0, 1, 1, 1, 1]), abs=2e-4)


@pytest.mark.parametrize("name", LENGTHS)
@pytest.mark.parametrize("curvature", [0.0, 1 / 12, -1 / 30])
def test_three_states_can_be_steered(name: str, curvature: float) -> None:
    lengths, rest = LENGTHS[name], equilibrium(curvature, LENGTHS[name])
    j = jacobian(name, curvature, as_printed=False)
    both = (curvature, curvature)
    b = rates(rest, 1.0, 1.0, both, lengths) - rates(rest, 1.0, 0.0, both, lengths)
    five = np.stack([np.linalg.matrix_power(j, k) @ b for k in range(5)], axis=1)
    sizes = np.linalg.svd(five, compute_uv=False)
    assert (sizes > 1e-6 * sizes[0]).sum() == 3


@pytest.mark.parametrize("name", LENGTHS)
@pytest.mark.parametrize("speed", [-2.2, -0.3, 0.3, 8.3])
def test_the_reduced_state_can_be_steered(name: str, speed: float) -> None:
    a, b = reduced(speed, 0.15, LENGTHS[name], 1 / 12, 0.3)
    four = np.hstack([np.linalg.matrix_power(a / 6.0, k) @ b for k in range(4)])
    assert np.linalg.matrix_rank(four) == 4


@pytest.mark.parametrize("name", LENGTHS)
@pytest.mark.parametrize("curvature", [0.0, 1 / 12])
def test_the_reduced_matrices_are_the_derivatives(name: str, curvature: float) -> None:
    lengths = LENGTHS[name]
    rest = equilibrium(curvature, lengths)
    a, _ = reduced(1.0, 0.15, lengths, curvature, rest[4], rest[1])
    whole = jacobian(name, curvature, as_printed=False)
    assert a[:3, :3] == pytest.approx(whole[np.ix_([1, 3, 4], [1, 3, 4])], abs=1e-7)


@given(machines, st.floats(-1e-3, 1e-3), st.floats(-1e-3, 1e-3), st.floats(-1e-3, 1e-3))
def test_outputs_are_the_offsets_of_both_axles(name: str, z: float, heading: float, bend: float) -> None:
    p = on_circle((0.0, z, heading, bend, 0.0), 0.0, LENGTHS[name])
    told = outputs(LENGTHS[name]) @ np.array([z, heading, bend, 0.0])
    assert told == pytest.approx([p[0] + p[1], p[0], p[1]], abs=1e-7)


def test_what_is_printed_is_wrong_in_two_rows() -> None:
    lengths = LENGTHS["truck"]
    p = np.array([0.3, -0.2, 0.2, -0.1, 0.3])
    drift, across = printed(p, 1 / 20, lengths)
    right = rates(p, 1.0, 0.0, (1 / 20, 1 / 20), lengths)
    wrong = np.abs(drift - right) > 1e-9
    assert wrong.tolist() == [False, True, False, False, False]
    by_rate = rates(p, 0.0, 1.0, (1 / 20, 1 / 20), lengths)
    assert (np.abs(across - by_rate) > 1e-9).tolist() == [False, False, False, True, False]

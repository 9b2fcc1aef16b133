"""The motion filter against the textbook's formulas in plain numpy, and its invariants."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.messages import FloatArray
from lhdmap.odometry import motion_filter
from lhdmap.odometry.motion import FORWARD, TURNING, PlanarMotion
from lhdmap.odometry.settings import OdometrySettings
from lhdmap.odometry.wheels.gate import WheelGate

ACCELERATION = np.array([0.7, 0.1, 1.0])


def some_state(seed: int = 0) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    state = np.array([1.0, -2.0, 0.7, 3.0, 0.1, 0.4, 1.01]) + 0.1 * rng.standard_normal(7)
    A = rng.standard_normal((7, 7))
    return state, 0.01 * (A @ A.T) + 1e-3 * np.eye(7)


def moved(state: FloatArray, dt_s: float) -> FloatArray:
    """Constant body velocity, the turn applied at its middle."""
    out = state.copy()
    middle = state[2] + 0.5 * state[5] * dt_s
    out[0] += (math.cos(middle) * state[3] - math.sin(middle) * state[4]) * dt_s
    out[1] += (math.sin(middle) * state[3] + math.cos(middle) * state[4]) * dt_s
    out[2] += state[5] * dt_s
    return out


def test_prediction_is_the_motion_and_its_jacobian() -> None:
    state, P = some_state()
    dt = 0.04
    F = np.zeros((7, 7))
    for k in range(7):
        step = 1e-6 * np.eye(7)[k]
        F[:, k] = (moved(state + step, dt) - moved(state - step, dt)) / 2e-6
    expected, wanted = moved(state, dt), F @ P @ F.T
    motion_filter.predict(state, P, dt, np.zeros(3))
    wanted[6, 6] += 1e-7 * dt
    assert state == pytest.approx(expected, abs=1e-12)
    assert pytest.approx(wanted, abs=1e-9) == P


def test_white_acceleration_grows_as_it_should() -> None:
    """From rest and certainty: variances q dt, q dt^3 / 3, covariance q dt^2 / 2 (Bar-Shalom), here with q = a^2."""
    state, P = np.zeros(7), np.zeros((7, 7))
    motion_filter.predict(state, P, 0.5, ACCELERATION)
    q = ACCELERATION**2
    assert np.diag(P)[3:6] == pytest.approx(q * 0.5)
    assert np.diag(P)[:3] == pytest.approx(q * 0.5**3 / 3.0)
    assert [P[0, 3], P[1, 4], P[2, 5]] == pytest.approx(q * 0.5**2 / 2.0)


def test_the_way_stands_behind_the_state_with_its_covariances() -> None:
    """State and way as functions of the state before: the Jacobian, by differences, tells all covariances."""
    state, P = some_state(4)
    dt = 0.6

    def both(before: FloatArray) -> FloatArray:
        after = moved(before, dt)
        return np.concatenate([after, after[:3] - before[:3]])

    J = np.array([(both(state + step) - both(state - step)) / 2e-6 for step in 1e-6 * np.eye(7)]).T
    expected, wanted = both(state), J @ P @ J.T
    way, joint = motion_filter.predict(state, P, dt, np.zeros(3))
    wanted[6, 6] += 1e-7 * dt
    assert way == pytest.approx(expected[7:], abs=1e-12)
    assert pytest.approx(wanted, abs=1e-8) == joint


@pytest.mark.parametrize("scaled", [False, True])
def test_a_measured_way_is_kalmans(scaled: bool) -> None:
    state, P = some_state(5)
    way, joint = motion_filter.predict(state, P, 0.6, ACCELERATION)
    direction, scale = np.array([0.8, 0.6, 0.0]), state[6] if scaled else 1.0
    h = np.concatenate([np.zeros(7), scale * direction])
    h[6] = direction @ way if scaled else 0.0
    S = h @ joint @ h + 0.02**2
    K = joint @ h / S
    expected, wanted = np.concatenate([state, way]) + K * 0.1, (np.eye(10) - np.outer(K, h)) @ joint
    nis = motion_filter.update_displacement(
        state, joint, way, direction, float(scale * direction @ way) + 0.1, 0.02**2, scaled, 9.0
    )
    assert nis == pytest.approx(0.01 / S)
    assert np.concatenate([state, way]) == pytest.approx(expected)
    assert pytest.approx(wanted, abs=1e-12) == joint


@pytest.mark.parametrize("dt_s", [0.2, 0.6, 0.9, 5.0])
def test_wheels_tell_where_the_machine_has_come_to_however_long_it_took(dt_s: float) -> None:
    """Their mean speed was taken for the speed at the start of the step: after 0.6 s the heading was known to 20 deg only."""
    motion = PlanarMotion(OdometrySettings())
    gate = WheelGate(motion)
    motion.predict(dt_s)
    gate.waited(dt_s)
    assert gate.fuse(FORWARD, 0.5 / dt_s, 0.01 / dt_s, scaled=True)
    assert gate.fuse(TURNING, 0.4 / dt_s, 0.02 / dt_s, scaled=False)
    assert motion.measured
    assert np.hypot(motion.pose[0], motion.pose[1]) == pytest.approx(0.5, abs=0.03)
    assert motion.pose[2] == pytest.approx(0.4, abs=0.02)
    assert math.sqrt(motion.P[2, 2]) < 0.025
    assert math.sqrt(motion.P[0, 0]) < 0.03


def test_one_axis_does_not_undo_what_the_other_did() -> None:
    """Wheels that disagree for long are believed: the turn that is fused after them took the old covariance back."""
    motion = PlanarMotion(OdometrySettings(), np.array([3.0, 0.0, 0.0]))
    gate = WheelGate(motion)
    for _ in range(40):
        motion.predict(0.04)
        gate.waited(0.04)
        motion.correct(motion.pose, np.diag([1e6, 1e6, 1e8]))
        if gate.fuse(FORWARD, 1.0, 0.03, scaled=True):
            break
        motion.correct(motion.pose, np.diag([1e6, 1e6, 1e8]))
    speed, variance = motion.velocity[0], motion.P[FORWARD, FORWARD]
    gate.fuse(TURNING, 0.0, 0.05, scaled=False)
    assert speed == pytest.approx(1.0, abs=0.2)
    assert motion.P[FORWARD, FORWARD] == pytest.approx(variance, rel=0.05)


def test_wheels_that_are_believed_against_the_motion_set_the_way_too() -> None:
    """Stamps 20 ms apart for scans of 0.6 s made 8 m/s; the wheels' word set the speed right and left the pose 5 m ahead."""
    motion = PlanarMotion(OdometrySettings(), np.array([0.3, 0.0, 0.0]))
    gate = WheelGate(motion)
    motion.distrust_velocity(np.array([8.0, 0.0, 0.0]))
    motion.P[3:6, 3:6] = np.diag([0.3**2, 0.01, 0.01])
    motion.predict(0.64)
    gate.waited(0.64)
    assert motion.pose[0] == pytest.approx(5.1, abs=0.1)
    assert gate.fuse(FORWARD, 0.27, 0.04, scaled=True)
    assert motion.pose[0] == pytest.approx(0.17, abs=0.05)
    assert motion.velocity[0] == pytest.approx(0.27, abs=0.05)
    assert motion.P[0, 0] < 0.1**2
    assert np.linalg.eigvalsh(motion.P).min() > 0.0


def test_wheels_that_slipped_must_agree_well_to_be_believed_again() -> None:
    """Without them the speed becomes uncertain, and wheels that still slip come within four deviations."""
    motion = PlanarMotion(OdometrySettings(), np.array([2.5, 0.0, 0.0]))
    gate = WheelGate(motion)
    motion.P[3:6, 3:6] = np.diag([0.05**2, 0.01, 0.01])
    taken = []
    for _ in range(100):  # two seconds
        motion.predict(0.02)
        gate.waited(0.02)
        taken.append(gate.fuse(FORWARD, 3.75, 0.03, scaled=True))
    assert not any(taken)
    motion.predict(0.02)
    gate.waited(0.02)
    assert gate.fuse(FORWARD, 2.5, 0.03, scaled=True)
    assert motion.velocity[0] == pytest.approx(2.5, abs=0.05)


def test_wheels_with_a_scale_of_their_own_come_back_after_a_spike() -> None:
    """Compared with the speed itself, not with what such wheels show at it, they would never have agreed again."""
    motion = PlanarMotion(OdometrySettings(), np.array([3.0, 0.0, 0.0]))
    gate = WheelGate(motion)
    motion.P[3:6, 3:6] = np.diag([0.02**2, 0.01, 0.01])
    motion.state[6], motion.P[6, 6] = 0.9, 1e-6
    motion.predict(0.02)
    gate.waited(0.02)
    assert not gate.fuse(FORWARD, 3.2, 0.03, scaled=True)
    motion.predict(0.02)
    gate.waited(0.02)
    assert gate.fuse(FORWARD, 2.7, 0.03, scaled=True)


def test_after_a_gap_what_was_not_measured_is_uncertain() -> None:
    motion = PlanarMotion(OdometrySettings(), np.array([1.0, 0.0, 0.0]))
    gate = WheelGate(motion)
    motion.predict(5.0)
    gate.waited(5.0)
    assert gate.fuse(FORWARD, 1.0, 0.03, scaled=True)
    assert motion.P[4, 4] >= 0.1
    assert motion.P[TURNING, TURNING] >= 0.5


def test_a_speed_update_is_kalmans() -> None:
    state, P = some_state(1)
    h = np.array([0.0, 0.0, 0.0, state[6], 0.0, 0.0, state[3]])
    measured, variance = state[6] * state[3] + 0.1, 0.03**2
    S = h @ P @ h + variance
    K = P @ h / S
    expected = state + K * 0.1
    wanted = (np.eye(7) - np.outer(K, h)) @ P
    nis = motion_filter.update_speed(state, P, FORWARD, measured, variance, True, 4.0)
    assert nis == pytest.approx(0.01 / S)
    assert state == pytest.approx(expected)
    assert pytest.approx(wanted, abs=1e-12) == P


def test_a_slipping_wheel_stays_out() -> None:
    state, P = some_state(2)
    P *= 1e-3
    before = state.copy()
    assert motion_filter.update_speed(state, P, FORWARD, state[3] * 1.5, 0.03**2, False, 4.0) > 16.0
    assert (state == before).all()


def test_a_pose_update_is_bayes() -> None:
    """Fusing the maximum a posteriori pose of prior and scan is the Kalman update with the scan's pose."""
    state, P = some_state(3)
    information = np.diag([4e4, 9e4, 1e6])
    scan_pose = state[:3] + np.array([0.01, -0.02, 0.003])
    prior = np.linalg.inv(P[:3, :3])
    matched = state[:3] + np.linalg.solve(prior + information, information @ (scan_pose - state[:3]))
    H = np.eye(3, 7)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.linalg.inv(information))
    expected, wanted = state + K @ (scan_pose - state[:3]), (np.eye(7) - K @ H) @ P
    motion_filter.update_pose(state, P, matched, information)
    assert state == pytest.approx(expected, abs=1e-9)
    assert pytest.approx(wanted, abs=1e-9) == P


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.tuples(st.sampled_from("psm"), st.floats(0.001, 2.0), st.floats(-1.0, 1.0)), min_size=1, max_size=30)
)
def test_the_covariance_stays_symmetric_and_positive(steps: list[tuple[str, float, float]]) -> None:
    motion = PlanarMotion(OdometrySettings())
    gate = WheelGate(motion)
    for kind, size, value in steps:
        if kind == "p":
            motion.predict(size)
            gate.waited(size)
        elif kind == "s":
            motion.predict(size)
            gate.waited(size)
            gate.fuse(FORWARD, 5.0 * value, 0.03, scaled=True)
            gate.fuse(TURNING, value, 0.03, scaled=False)
        else:
            motion.correct(motion.pose + 0.1 * value, 1e4 * size * np.eye(3))
            motion.forget(min(size, 1.0) * 0.9)
        P = motion.P
        assert np.isfinite(P).all()
        assert pytest.approx(P.T, abs=1e-9) == P
        scale = np.sqrt(np.diag(P)) + 1e-12
        assert np.linalg.eigvalsh(P / np.outer(scale, scale)).min() > -1e-6
        assert -math.pi <= motion.pose[2] < math.pi


def test_a_scale_that_is_not_learned_stays_and_is_reckoned_with() -> None:
    """Smooth walls pulled a little on each scan: a tachometer 1 % off became 2 % wrong on a straight drive."""
    state, P = some_state(3)
    learned, considered = (state.copy(), P.copy()), (state.copy(), P.copy())
    matched, information = state[:3] + np.array([0.02, -0.01, 0.003]), np.diag([1e3, 1e4, 1e5])
    motion_filter.update_pose(*learned, matched, information, True)
    motion_filter.update_pose(*considered, matched, information, False)
    assert considered[0][:6] == pytest.approx(learned[0][:6])
    assert (considered[0][6], considered[1][6, 6]) == (state[6], P[6, 6])
    assert considered[1][:6, :6] == pytest.approx(learned[1][:6, :6])
    assert np.linalg.eigvalsh(considered[1]).min() > 0.0

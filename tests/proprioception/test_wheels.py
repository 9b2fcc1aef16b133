"""Wheel odometry against the exact motion of two rigid bodies, and on bad input."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.machine import Dimensions, Machine
from lhdmap.messages import FloatArray, Joints, Tachometer, WheelPose
from lhdmap.proprioception.wheels import WheelOdometry, WheelSettings
from scipy.integrate import solve_ivp

MACHINE = Machine(dimensions=Dimensions(joint_to_front_axle_m=1.5, joint_to_rear_axle_m=2.1))


def ns(seconds: float) -> int:
    return round(seconds * 1e9)


def joints(stamp_ns: int, articulation_rad: float) -> Joints:
    return Joints(stamp_ns, {"articulation": articulation_rad}, {})


def odometry(
    speed: Callable[[float], float],
    angle: Callable[[float], float],
    seconds: float = 12.0,
    settings: WheelSettings | None = None,
) -> WheelOdometry:
    wheels = WheelOdometry(settings or WheelSettings(), MACHINE)
    for t in np.arange(0.0, seconds, 0.02):
        wheels.update(Tachometer(ns(t), speed(t)))
        wheels.update(joints(ns(t), angle(t)))
    return wheels


def two_bodies(
    speed: Callable[[float], float], angle: Callable[[float], float], span: tuple[float, float]
) -> FloatArray:
    """Move the front axle so that the REAR axle does not slip sideways: the constraint itself, without Eq. (1)."""
    L_f, L_r = 1.5, 2.1

    def rate(t: float, pose: FloatArray) -> list[float]:
        gamma, omega = angle(t), (angle(t + 1e-6) - angle(t - 1e-6)) / 2e-6
        # The rear axle's velocity across the rear body is linear in the turn rate w: find where it is zero.
        across = np.array([math.sin(gamma), math.cos(gamma)])  # the rear body's y axis (its heading is -gamma)

        def slip(w: float) -> float:
            joint = np.array([speed(t), -L_f * w])
            rear_turn = w - omega
            back = np.array([-math.cos(gamma), math.sin(gamma)]) * L_r
            return float((joint + rear_turn * np.array([-back[1], back[0]])) @ across)

        w = -slip(0.0) / (slip(1.0) - slip(0.0))
        return [speed(t) * math.cos(pose[2]), speed(t) * math.sin(pose[2]), w]

    solution = solve_ivp(rate, span, [0.0, 0.0, 0.0], rtol=1e-9, atol=1e-10, max_step=0.05)
    return np.asarray(solution.y[:, -1])


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_motion_is_that_of_two_bodies_without_side_slip(sign: float, direction: float) -> None:
    def speed(t: float) -> float:
        return direction * (1.5 + 0.5 * math.sin(0.8 * t))

    def angle(t: float) -> float:
        return sign * (0.25 + 0.3 * math.sin(0.6 * t))

    truth = two_bodies(speed, angle, (1.0, 9.0))
    motion = odometry(speed, angle).motion_between(ns(1.0), ns(9.0))
    assert motion is not None
    assert motion.source == "articulated"
    assert np.abs(motion.delta[:2] - truth[:2]).max() < 2e-3
    assert abs(se2.wrap(motion.delta[2] - truth[2])) < 5e-4


@pytest.mark.parametrize(("angle", "turns"), [(0.3, 1.0), (-0.3, -1.0)])
def test_bending_to_the_left_drives_to_the_left(angle: float, turns: float) -> None:
    motion = odometry(lambda _: 1.0, lambda _: angle).motion_between(ns(2.0), ns(4.0))
    assert motion is not None
    rate = math.sin(angle) / (1.5 * math.cos(angle) + 2.1)  # Eq. (1) by hand: a circle
    assert motion.delta[2] == pytest.approx(2.0 * rate, abs=1e-9)
    assert motion.delta[1] == pytest.approx((1.0 - math.cos(2.0 * rate)) / rate, abs=1e-6)
    assert np.sign(motion.delta[2]) == turns


def test_turning_the_joint_at_a_stand_turns_the_front_body() -> None:
    motion = odometry(lambda _: 0.0, lambda t: 0.05 * t).motion_between(ns(0.0), ns(4.0))
    assert motion is not None
    gamma = np.linspace(0.0, 0.2, 2001)
    exact = np.trapezoid(2.1 / (1.5 * np.cos(gamma) + 2.1), gamma)
    assert motion.delta[2] == pytest.approx(exact, abs=1e-6)
    assert motion.delta[:2] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_motions_chain() -> None:
    wheels = odometry(lambda t: 1.0 + 0.1 * t, lambda t: 0.2 * math.sin(t))
    chained = np.zeros(3)
    for k in range(20, 80):
        step = wheels.motion_between(ns(k * 0.1), ns((k + 1) * 0.1))
        assert step is not None
        chained = se2.compose(chained, step.delta)
    whole = wheels.motion_between(ns(2.0), ns(8.0))
    assert whole is not None
    assert chained == pytest.approx(whole.delta, abs=1e-4)


def test_covariance_matches_a_scatter_of_drives() -> None:
    settings = WheelSettings(
        scale_std=0.03, speed_std_mps=0.0, side_slip_std=0.0, articulation_std_deg=1.0, articulation_noise_deg=0.0
    )
    told = odometry(lambda _: 2.0, lambda _: 0.2, settings=settings).motion_between(ns(1.0), ns(3.0))
    assert told is not None
    rng = np.random.default_rng(3)
    ends = []
    for _ in range(300):
        scale, offset = 1.0 + rng.normal(0, 0.03), math.radians(rng.normal(0, 1.0))
        wheels = WheelOdometry(settings, MACHINE)
        for stamp in (ns(1.0), ns(1.4), ns(1.8), ns(2.2), ns(2.6), ns(3.0)):
            wheels.update(Tachometer(stamp, 2.0 * scale))
            wheels.update(joints(stamp, 0.2 + offset))
        motion = wheels.motion_between(ns(1.0), ns(3.0))
        assert motion is not None
        ends.append(motion.delta)
    seen = np.cov(np.array(ends).T)
    assert np.sqrt(np.diag(told.covariance)) == pytest.approx(np.sqrt(np.diag(seen)), rel=0.2)


def test_a_noisy_encoder_shows_in_the_covariance() -> None:
    rng, errors, told = np.random.default_rng(8), [], 0.0
    wheels = WheelOdometry(WheelSettings(articulation_noise_deg=0.1), MACHINE)
    for t in np.arange(0.0, 8.0, 0.02):
        wheels.update(Tachometer(ns(t), 0.0))
        wheels.update(joints(ns(t), 0.1 + math.radians(rng.normal(0.0, 0.1))))
    for k in range(390):
        motion = wheels.motion_between(ns(0.02 * k), ns(0.02 * (k + 1)))
        assert motion is not None
        errors.append(motion.delta[2])
        told = math.sqrt(motion.covariance[2, 2])
    assert told == pytest.approx(np.std(errors), rel=0.15)


def test_nothing_is_said_across_gaps_and_outside() -> None:
    wheels = WheelOdometry(WheelSettings(), MACHINE)
    for t in [*np.arange(0.0, 2.0, 0.02), *np.arange(5.0, 7.0, 0.02)]:
        wheels.update(Tachometer(ns(t), 1.0))
        wheels.update(joints(ns(t), 0.0))
    assert wheels.motion_between(ns(1.0), ns(1.5)) is not None
    assert wheels.motion_between(ns(1.5), ns(5.5)) is None
    assert wheels.motion_between(ns(3.0), ns(3.1)) is None
    assert wheels.motion_between(ns(6.5), ns(8.0)) is None
    assert wheels.motion_between(ns(1.5), ns(1.0)) is None
    assert wheels.speed_at(ns(3.0)) is None
    assert wheels.articulation_at(ns(6.0)) == 0.0
    assert WheelOdometry(WheelSettings(), MACHINE).motion_between(0, 1) is None


def test_a_tachometer_alone_leaves_the_heading_open() -> None:
    wheels = WheelOdometry(WheelSettings(), MACHINE)
    for t in np.arange(0.0, 4.0, 0.05):
        wheels.update(Tachometer(ns(t), -1.0))
    motion = wheels.motion_between(ns(1.0), ns(3.0))
    assert motion is not None
    assert motion.source == "tachometer"
    assert motion.delta == pytest.approx([-2.0, 0.0, 0.0], abs=1e-9)
    assert math.sqrt(motion.covariance[2, 2]) > math.radians(5.0)


def test_wheel_poses_are_differenced_in_the_frame_of_the_start() -> None:
    wheels = WheelOdometry(WheelSettings(), MACHINE)
    for t in np.arange(0.0, 4.0, 0.1):
        wheels.update(WheelPose(ns(t), 10.0, 5.0 + t, math.pi / 2))
    motion = wheels.motion_between(ns(1.05), ns(3.0))
    assert motion is not None
    assert motion.source == "wheel_pose"
    assert motion.delta == pytest.approx([1.95, 0.0, 0.0], abs=1e-9)


def test_dead_reckoning_goes_on_unseen_between_its_poses() -> None:
    wheels = WheelOdometry(WheelSettings(), MACHINE)
    for k in range(5):
        wheels.update(WheelPose(ns(4.0 * k), 2.0 * k, 0.0, 0.0))
    across = wheels.motion_between(ns(4.0), ns(12.0))
    assert across is not None
    assert across.delta == pytest.approx([4.0, 0.0, 0.0], abs=1e-12)
    assert wheels.motion_between(ns(4.0), ns(10.0)) is None  # 10 s lies in a gap that is too long to interpolate


def test_poses_that_share_the_scans_stamps_serve_also_where_these_run_backwards() -> None:
    stamps = [ns(t) for t in (0.0, 0.4, 0.8, 0.5, 0.9, 1.3, 1.0, 1.4)]
    wheels = WheelOdometry(WheelSettings(), MACHINE)
    for k, stamp in enumerate(stamps):
        wheels.update(WheelPose(stamp, 0.1 * k, 0.0, 0.0))
    for before, after in pairwise(stamps):
        motion = wheels.motion_between(before, after)
        assert motion is not None
        assert motion.delta[0] == pytest.approx(0.1, abs=1e-12)


def test_ready_until_waits_for_the_slowest_sensor_but_not_for_a_dead_one() -> None:
    wheels = WheelOdometry(WheelSettings(), MACHINE)
    assert wheels.ready_until_ns(ns(9.0)) == ns(9.0)
    wheels.update(Tachometer(ns(1.0), 1.0))
    wheels.update(joints(ns(0.9), 0.0))
    assert wheels.ready_until_ns(ns(1.1)) == ns(0.9)
    assert wheels.ready_until_ns(ns(5.0)) == ns(5.0)


def test_headings_are_interpolated_the_short_way_round() -> None:
    wheels = WheelOdometry(WheelSettings(), MACHINE)
    for k in range(20):
        wheels.update(WheelPose(ns(k * 0.1), 0.0, 0.0, se2.wrap(3.0 + 0.1 * k)))
    motion = wheels.motion_between(ns(0.05), ns(0.45))
    assert motion is not None
    assert motion.delta[2] == pytest.approx(0.4, abs=1e-9)


def test_a_jump_of_the_wheel_pose_is_refused() -> None:
    wheels = WheelOdometry(WheelSettings(), MACHINE)
    for k in range(40):
        wheels.update(WheelPose(ns(k * 0.1), 0.1 * k + (30.0 if k >= 20 else 0.0), 0.0, 0.0))
    assert wheels.motion_between(ns(1.5), ns(2.5)) is None
    assert wheels.motion_between(ns(1.92), ns(1.98)) is None
    behind = wheels.motion_between(ns(2.0), ns(3.0))
    assert behind is not None
    assert behind.delta[0] == pytest.approx(1.0, abs=1e-9)
    assert any("jumps" in text for text in wheels.warnings.texts())


def test_bad_samples_are_left_out_with_a_warning() -> None:
    wheels = odometry(lambda _: 1.0, lambda _: 0.1, seconds=4.0)
    clean = wheels.motion_between(ns(1.0), ns(3.0))
    dirty = WheelOdometry(WheelSettings(), MACHINE)
    for k, t in enumerate(np.arange(0.0, 4.0, 0.02)):
        dirty.update(Tachometer(ns(t), 1.0))
        dirty.update(joints(ns(t), 0.1))
        if k % 7 == 3:
            dirty.update(Tachometer(ns(t + 0.001), math.nan))
            dirty.update(Tachometer(ns(t + 0.001), 300.0))
            dirty.update(Tachometer(ns(t - 0.5), -1.0))
            dirty.update(joints(ns(t + 0.001), 17.0))
            dirty.update(WheelPose(ns(t), math.inf, 0.0, 0.0))
            dirty.update(Joints(ns(t + 0.001), {"boom_lift": 0.3}, {}))
    same = dirty.motion_between(ns(1.0), ns(3.0))
    assert clean is not None
    assert same is not None
    assert same.delta == pytest.approx(clean.delta, abs=1e-12)
    assert len(dirty.warnings.texts()) == 5


def test_a_clock_set_back_does_not_silence_the_wheels() -> None:
    wheels = WheelOdometry(WheelSettings(), MACHINE)
    for start in (1000.0, 0.0):
        for t in np.arange(start, start + 4.0, 0.02):
            wheels.update(Tachometer(ns(t), 1.0))
    motion = wheels.motion_between(ns(2.0), ns(3.0))
    assert motion is not None
    assert motion.delta[0] == pytest.approx(1.0, abs=1e-9)
    assert any("set back" in text for text in wheels.warnings.texts())


def test_memory_stays_bounded() -> None:
    wheels = WheelOdometry(WheelSettings(keep_s=5.0), MACHINE)
    for k in range(30_000):
        wheels.update(Tachometer(k * 10_000_000, 1.0))
    assert len(wheels._speeds._stamps) <= 2048
    assert wheels.motion_between(ns(297.0), ns(299.0)) is not None


def test_poses_that_come_slowly_are_waited_for() -> None:
    """A scanner at 1.6 Hz whose poses come with the scans: silent for 0.6 s, they were not waited for and never used."""
    wheels = WheelOdometry(WheelSettings(), Machine())
    for k in range(10):
        assert wheels.ready_until_ns(ns(0.6 * k)) <= ns(0.6 * max(k - 1, 0))
        wheels.update(WheelPose(ns(0.6 * k), 0.3 * k, 0.0, 0.0))
    motion = wheels.motion_between(ns(4.8), ns(5.4))
    assert motion is not None
    assert motion.delta[0] == pytest.approx(0.3, abs=1e-6)
    assert wheels.ready_until_ns(ns(20.0)) == ns(20.0)


def test_after_a_pause_of_the_whole_log_the_wheels_are_waited_for() -> None:
    wheels = WheelOdometry(WheelSettings(), Machine())
    for k in range(10):
        wheels.update(WheelPose(ns(0.2 * k), 0.1 * k, 0.0, 0.0))
    assert wheels.ready_until_ns(ns(5.0)) == ns(5.0)
    assert wheels.ready_until_ns(ns(5.0), judged_ns=ns(1.8)) == ns(1.8)


def test_where_a_machine_stops_a_late_pose_is_off_by_what_was_driven_meanwhile() -> None:
    wheels = WheelOdometry(WheelSettings(), Machine())
    for k in range(40):
        wheels.update(WheelPose(ns(0.2 * k), 0.2 * min(k, 10), 0.0, 0.0))
    stopped, rested = wheels.motion_between(ns(2.0), ns(2.2)), wheels.motion_between(ns(7.0), ns(7.2))
    assert stopped is not None
    assert rested is not None
    assert stopped.delta[0] == rested.delta[0] == 0.0
    assert math.sqrt(stopped.covariance[0, 0]) > 0.02
    assert math.sqrt(rested.covariance[0, 0]) < 0.002

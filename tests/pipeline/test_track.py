"""The path in space: heights on analytic ramps, times of 19 digits, blending of corrections."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.geometry import se3
from lhdmap.pipeline.track import FinalTrack, Track, TrackRows, resample, trajectory_of
from lhdmap.smoothing.smoother import Correction, corrected

START_NS = 1_758_000_000_123_456_789


def test_times_a_nanosecond_apart_keep_their_poses() -> None:
    """A float holds 16 digits: stamps of 19 must not be told apart by one."""
    times = START_NS + np.array([0, 1, 2, 3], dtype=np.int64)
    rows = TrackRows(times, np.column_stack([np.arange(4.0), *[np.zeros(4)] * 5]))
    found = resample(rows, times)
    assert found.poses[:, 0] == pytest.approx([0.0, 1.0, 2.0, 3.0])
    assert (found.times_ns == times).all()


def test_resampling_is_linear_between_and_bounded_beyond() -> None:
    times = START_NS + np.array([0, 10**8], dtype=np.int64)
    rows = TrackRows(times, np.array([[0.0] * 6, [0.4, 0, 0, 0, 0, 0.1]]))
    at = START_NS + np.array([-(10**10), -(10**7), 25 * 10**6, 10**8, 11 * 10**7, 10**10], dtype=np.int64)
    x = resample(rows, at).poses[:, 0]
    assert x[1:5] == pytest.approx([-0.04, 0.1, 0.4, 0.44])
    assert abs(x[0]) <= 0.8 + 1e-9  # no running away where the log has nothing
    assert x[5] <= 1.2 + 1e-9


def test_one_pose_is_held() -> None:
    rows = TrackRows(np.array([START_NS], dtype=np.int64), np.ones((1, 6)))
    assert (resample(rows, START_NS + np.array([-5, 0, 5], dtype=np.int64)).poses == 1.0).all()


@pytest.mark.parametrize("pitch_deg", [-8.0, -1.0, 1.0, 8.0])
@pytest.mark.parametrize("heading_deg", [0.0, 130.0])
def test_height_on_a_ramp_by_pitch(pitch_deg: float, heading_deg: float) -> None:
    """REP 103: positive pitch points down. 20 m of horizontal travel change the height by -20 tan(pitch)."""
    track, heading = Track(), math.radians(heading_deg)
    for k in range(101):
        pose = np.array([0.2 * k * math.cos(heading), 0.2 * k * math.sin(heading), heading])
        track.append(START_NS + k, pose, 0.0, math.radians(pitch_deg))
    assert track.height_m == pytest.approx(-20.0 * math.tan(math.radians(pitch_deg)), rel=1e-9)


@pytest.mark.parametrize("roll_deg", [-5.0, 5.0])
def test_height_across_a_ramp_by_roll(roll_deg: float) -> None:
    """Positive roll lifts the left side: motion to the left climbs."""
    track = Track()
    for k in range(11):
        track.append(START_NS + k, np.array([0.0, 0.1 * k, 0.0]), math.radians(roll_deg), 0.0)
    assert track.height_m == pytest.approx(math.tan(math.radians(roll_deg)), rel=1e-9)


def test_reversing_comes_back_to_its_height() -> None:
    track = Track()
    for k, x in enumerate([*np.linspace(0.0, 5.0, 51), *np.linspace(5.0, 0.0, 51)]):
        track.append(START_NS + k, np.array([x, 0.0, 0.0]), 0.01, -0.02 * math.sin(x))
    assert track.height_m == pytest.approx(0.0, abs=1e-9)


def test_the_lever_puts_the_front_axle_on_the_ramp_first() -> None:
    """The inclinometer shows the slope between the axles: base_link is ahead of the point that has it."""
    lever_m, slope = 0.85, math.radians(5.0)
    track = Track(lever_m)
    track.append(START_NS, np.zeros(3), 0.0, 0.0)
    track.append(START_NS + 1, np.zeros(3), 0.0, -slope)
    assert track.height_m == pytest.approx(lever_m * math.tan(slope))


def test_heading_is_unwrapped() -> None:
    track = Track()
    for k in range(100):
        track.append(START_NS + k, np.array([0.0, 0.0, math.remainder(0.1 * k, 2 * math.pi)]), 0.0, 0.0)
    assert track.rows().poses[-1, 5] == pytest.approx(9.9)


def test_a_growing_and_a_finished_track_agree() -> None:
    track = Track()
    rng = np.random.default_rng(0)
    for k in range(5):
        track.append(START_NS + k * 10**8, np.array([0.3 * k, 0.1 * k, 0.05 * k]), *rng.normal(0.0, 0.01, 2))
    at = START_NS + np.array([33, 0, 39, 31, -5], dtype=np.int64) * 10**7
    assert FinalTrack(track.rows()).matrices_at(at) == pytest.approx(track.matrices_at(at))


def test_matrices_are_those_of_roll_pitch_and_heading() -> None:
    track = Track()
    track.append(START_NS, np.array([1.0, 2.0, 0.0]), 0.0, 0.0)
    track.append(START_NS + 10, np.array([1.0, 2.0, 0.4]), 0.1, -0.2)
    half, after = track.matrices_at(START_NS + np.array([5, 15], dtype=np.int64))
    assert half == pytest.approx(se3.from_rpy(0.05, -0.1, 0.2, (1.0, 2.0, 0.5 * track.height_m)))
    assert after == pytest.approx(se3.from_rpy(0.15, -0.3, 0.6, (1.0, 2.0, 1.5 * track.height_m)))


def test_a_trajectory_carries_stamps_and_attitude() -> None:
    rows = TrackRows(np.array([START_NS], dtype=np.int64), np.array([[1.0, 2.0, 3.0, 0.1, -0.2, 0.7]]))
    found = trajectory_of(rows, rows.times_ns - 7)
    assert found.stamps_ns[0] == START_NS - 7
    assert se3.rpy_from_quaternions(found.quaternions_xyzw)[0] == pytest.approx([0.1, -0.2, 0.7])


def test_corrections_are_exact_at_keys_and_blend_between() -> None:
    times = START_NS + np.array([0, 10**9], dtype=np.int64)
    moves = np.array([[0.0, 0.0, 0.0], [1.0, -0.5, 0.1]])
    correction = Correction(times, moves, 1)
    poses = np.zeros((3, 6))
    poses[:, :3], poses[:, 3:5], poses[:, 5] = [40.0, 5.0, 2.0], [0.01, 0.02], 0.3
    at = START_NS + np.array([0, 5 * 10**8, 10**9], dtype=np.int64)
    found = corrected(poses, at, correction)
    assert found[0] == pytest.approx(poses[0])
    c, s = math.cos(0.1), math.sin(0.1)
    moved = [1.0 + c * 40.0 - s * 5.0, -0.5 + s * 40.0 + c * 5.0, 2.0, 0.01, 0.02, 0.4]
    assert found[2] == pytest.approx(moved)
    assert found[1] == pytest.approx(0.5 * (found[0] + found[2]))

"""Pairing by stamps: either rate higher, inexact stamps, stamps that run backwards, nothing in common."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.errors import InputError
from lhdmap.evaluation.association import associate, nearest_rows
from lhdmap.trajectory import Trajectory

from tests.evaluation.paths import PERIOD_NS, part, straight, trajectory


def every(path: Trajectory, step: int) -> Trajectory:
    return part(path, slice(None, None, step))


@pytest.mark.parametrize("sparse_side", ["estimate", "truth"])
def test_the_sparser_side_decides_the_pairs(sparse_side: str) -> None:
    dense, sparse = straight(20.0), every(straight(20.0), 4)
    pairs = associate(sparse, dense) if sparse_side == "estimate" else associate(dense, sparse)
    assert pairs.stamps_ns.tolist() == sparse.stamps_ns.tolist()
    assert np.array_equal(pairs.estimate.positions_m, sparse.positions_m)
    assert np.array_equal(pairs.truth.positions_m, sparse.positions_m)


def test_inexact_stamps_are_interpolated_not_taken_as_errors() -> None:
    dense = straight(20.0)
    shift_ns = 7_000_000
    speed_mps = 0.05 / (PERIOD_NS / 1e9)
    ahead = np.array([speed_mps * shift_ns / 1e9, 0.0, 0.0])
    late = every(dense, 5)
    late = late._replace(stamps_ns=late.stamps_ns + shift_ns, positions_m=late.positions_m + ahead)
    late = part(late, slice(0, -1))
    pairs = associate(late, dense)
    assert len(pairs.stamps_ns) == len(late.stamps_ns)
    assert np.abs(pairs.estimate.positions_m - pairs.truth.positions_m).max() < 1e-6


def test_rotations_are_interpolated_on_the_short_way() -> None:
    yaw = np.array([3.1, 3.1 + 0.1])  # the quaternion's sign flips beyond pi
    rpy = np.column_stack([0 * yaw, 0 * yaw, yaw])
    dense = trajectory(np.zeros((2, 3)), rpy)
    dense = dense._replace(quaternions_xyzw=dense.quaternions_xyzw * [[1.0], [-1.0]])
    three = part(dense, np.array([0, 1, 1]))
    three = three._replace(stamps_ns=np.array([0, 10_000_000, 20_000_000]))
    half = trajectory(np.zeros((2, 3)), np.array([[0, 0, 3.15], [0, 0, 3.2]]), [5_000_000, 10_000_000])
    pairs = associate(half, three)
    assert np.abs(pairs.truth.rotations - pairs.estimate.rotations).max() < 1e-6


def test_stamps_that_run_backwards_keep_the_order_of_the_file() -> None:
    truth = straight(5.0)
    order = np.arange(len(truth.stamps_ns))
    order[10:20] = order[10:20][::-1]
    shuffled = part(truth, order)
    pairs = associate(shuffled, every(truth, 2))
    assert np.array_equal(pairs.stamps_ns, every(truth, 2).stamps_ns)
    assert np.array_equal(pairs.estimate.positions_m, pairs.truth.positions_m)


def test_no_common_stamp_says_how_far_apart_they_are_and_what_to_do() -> None:
    truth = straight(5.0)
    with pytest.raises(InputError, match=r"nearest are 100\d* s apart .*share no time"):
        associate(truth._replace(stamps_ns=truth.stamps_ns + 102_000_000_000), truth)
    with pytest.raises(InputError, match=r"nearest are 0\.005 s apart .*--tolerance"):
        associate(truth._replace(stamps_ns=truth.stamps_ns + 5_000_000), truth, tolerance_ns=1_000_000)
    with pytest.raises(InputError, match=r"estimate of one pose"):
        associate(part(truth, slice(0, 1)), truth)


def test_tolerance_bounds_the_distance_of_stamps() -> None:
    truth = straight(5.0)
    late = truth._replace(stamps_ns=truth.stamps_ns + 9_000_000)
    with pytest.raises(InputError):
        associate(every(late, 10), every(truth, 10), tolerance_ns=5_000_000)
    assert len(associate(every(late, 10), every(truth, 10), tolerance_ns=9_000_000).stamps_ns) == 11


@given(
    st.lists(st.integers(0, 10**6), min_size=1, max_size=40), st.lists(st.integers(-(10**5), 2 * 10**6), max_size=40)
)
def test_nearest_rows_are_the_nearest_in_any_order(stamps: list[int], wanted: list[int]) -> None:
    stamps_ns, wanted_ns = np.array(stamps, dtype=np.int64), np.array(wanted, dtype=np.int64)
    away = np.abs(stamps_ns[nearest_rows(stamps_ns, wanted_ns)] - wanted_ns)
    brute = [min(abs(stamp - one) for stamp in stamps) for one in wanted]
    assert away.tolist() == brute

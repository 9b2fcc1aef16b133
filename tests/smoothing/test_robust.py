"""Which closures are believed: false ones at random or as one block, none, all false; what must not change anything."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.smoothing.robust import judged

from tests.smoothing.loops import Falsehood, Loops, in_order, least_squares, moved, rmse_m, twice_round


def judge(loops: Loops) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    return judged(loops.odometry, loops.steps, loops.ties).kept


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("kind", ["random", "block"])
@pytest.mark.parametrize("share", [0.3, 0.6])
def test_false_closures_are_left_out_and_right_ones_are_not(seed: int, kind: Falsehood, share: float) -> None:
    loops = twice_round(seed, kind, share)
    kept = judge(loops)
    assert not (kept & ~loops.right).any()
    assert kept[loops.right].mean() >= 0.95
    assert rmse_m(loops, least_squares(loops, kept)) <= 1.1 * rmse_m(loops, least_squares(loops, loops.right))


def test_closures_mend_the_path() -> None:
    loops = twice_round(3, "block", 0.3)
    assert rmse_m(loops, least_squares(loops, judge(loops))) < 0.7 * rmse_m(loops, loops.odometry)


def test_no_closures_are_no_closures() -> None:
    loops = twice_round(1, right=0, share=0.0)
    found = judged(loops.odometry, loops.steps, [])
    assert found.kept.shape == found.doubtful.shape == found.chi2.shape == (0,)
    assert found.apart_m == 0.0


@pytest.mark.parametrize("seed", [1, 2])
def test_where_all_are_false_none_is_kept(seed: int) -> None:
    loops = twice_round(seed, "random", 1.0, right=20)
    kept = judge(loops)
    assert kept.sum() <= 1  # one alone contradicts nothing but the odometry, which may have come off by as much
    assert rmse_m(loops, least_squares(loops, kept)) < rmse_m(loops, loops.odometry) + 1.0


def test_a_right_closure_alone_is_kept_and_a_false_one_is_not() -> None:
    loops = twice_round(4, right=1, share=0.0)
    assert judge(loops).tolist() == [True]
    lie = loops.ties[0]._replace(pose_first_second=np.array([60.0, 0.0, 0.0]))
    assert judge(loops._replace(ties=[lie])).tolist() == [False]


@settings(max_examples=6, deadline=None)
@given(
    T=st.tuples(st.floats(-500.0, 500.0), st.floats(-500.0, 500.0), st.floats(-3.1, 3.1)),
    kind=st.sampled_from(["random", "block"]),
)
def test_where_the_path_lies_changes_nothing(T: tuple[float, float, float], kind: Falsehood) -> None:
    loops = twice_round(5, kind, 0.4, count=160, right=12, step_m=3.0)
    here, there = (judged(one.odometry, one.steps, one.ties) for one in (loops, moved(loops, np.array(T))))
    assert here.kept.tolist() == there.kept.tolist()
    assert there.chi2[here.kept] == pytest.approx(here.chi2[here.kept], abs=1e-2)


@settings(max_examples=6, deadline=None)
@given(order=st.permutations(range(20)))
def test_the_order_of_the_closures_changes_nothing(order: list[int]) -> None:
    loops = twice_round(6, "random", 0.4, count=160, right=12, step_m=3.0)
    assert len(loops.ties) == len(order)
    assert judge(in_order(loops, order)).tolist() == judge(loops)[order].tolist()

"""Errors of steps put together: against closed forms, and against scattered poses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.step_error import NO_ERROR, StepError, measured_covariance

TURN = np.array([0.0, 0.0, math.pi / 2])


def walked(*sigmas: float) -> StepError:
    return NO_ERROR._replace(walk=np.diag(np.square(sigmas)))


def test_a_heading_error_swings_the_step_that_follows() -> None:
    """Two steps of 10 m straight on: what the heading is off at the first one's end moves the second's end sideways."""
    step, sigma = np.array([10.0, 0.0, 0.0]), 0.01
    both = walked(0.0, 0.0, sigma).then(step, walked(0.0, 0.0, sigma)).walk
    assert both[1, 1] == pytest.approx((10.0 * sigma) ** 2)
    assert both[1, 2] == pytest.approx(10.0 * sigma**2)
    assert both[2, 2] == pytest.approx(2.0 * sigma**2)
    assert both[0, 0] == pytest.approx(0.0)


def test_what_is_weak_stays_weak_in_its_direction() -> None:
    """A drift whose way is not seen, then a turn by 90°: the doubt is sideways of the machine then."""
    turned = walked(1.0, 0.001, 0.0).then(TURN, NO_ERROR).walk
    assert np.sqrt(np.diag(turned)) == pytest.approx([0.001, 1.0, 0.0])


def test_a_pull_adds_up_with_the_way_and_cancels_on_the_way_back() -> None:
    out = NO_ERROR._replace(pull=np.array([0.1, 0.0, 0.0]))
    metre = np.array([1.0, 0.0, 0.0])
    assert out.then(metre, out).then(metre, out).covariance[0, 0] == pytest.approx(0.3**2)
    assert out.then(2.0 * TURN, NO_ERROR).then(metre, out).covariance[0, 0] == pytest.approx(0.0, abs=1e-12)


def test_jitter_counts_at_both_ends_and_not_between() -> None:
    jitter = np.diag([1e-6, 1e-6, 0.0])
    step = NO_ERROR._replace(jitter=jitter)
    way = np.array([1.0, 0.0, 0.0])
    many = step.then(way, step).then(way, step)
    assert measured_covariance(jitter, 3.0 * way, many)[0, 0] == pytest.approx(2e-6)


def test_a_bent_way_scatters_as_composed() -> None:
    """Twenty thousand poses at the end of three steps, each off by what it may be off."""
    rng = np.random.default_rng(4)
    steps = [np.array([4.0, 0.3, 0.5]), np.array([3.0, -0.2, -1.1]), np.array([5.0, 0.0, 0.7])]
    deviations = [np.array([0.02, 0.01, 0.004]), np.array([0.05, 0.01, 0.002]), np.array([0.01, 0.02, 0.003])]
    told, truth = NO_ERROR, np.zeros(3)
    for step, sigmas in zip(steps, deviations, strict=True):
        told, truth = told.then(step, walked(*sigmas)), se2.compose(truth, step)
    ends = np.array([_end(steps, deviations, rng) for _ in range(20_000)])
    errors = np.array([se2.between(truth, end) for end in ends])
    assert np.cov(errors.T) == pytest.approx(told.walk, rel=0.06, abs=3e-6)


def _end(steps: list[FloatArray], deviations: list[FloatArray], rng: np.random.Generator) -> FloatArray:
    pose = np.zeros(3)
    for step, sigmas in zip(steps, deviations, strict=True):
        pose = se2.compose(se2.compose(pose, step), sigmas * rng.standard_normal(3))
    return pose


def test_the_adjoint_carries_a_small_motion() -> None:
    T, small = np.array([2.0, -1.0, 0.8]), 1e-6 * np.array([1.0, 2.0, 3.0])
    moved = se2.compose(se2.compose(T, small), se2.inverse(T))
    assert moved == pytest.approx(se2.adjoint(T) @ small, abs=1e-11)


def test_deviations_are_those_of_the_covariance() -> None:
    error = StepError(np.diag([0.03**2, 0.02**2, 0.01**2]), np.array([0.04, 0.0, 0.0]), np.eye(3))
    assert error.deviations == pytest.approx([0.05, 0.02, 0.01])

"""Walls at the face against drifts made of formulas: wall to wall, a stope's mouth, and how sure it is which of them counts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.messages import FloatArray
from lhdmap.pile.face import PileFace
from lhdmap.pile.limits import _VISIBLE, FaceLimits, limits_of


def _face(slope: float = 1.0, askew: float = 0.0) -> PileFace:
    return PileFace(0.0, askew, slope, 0.0, 1e-6 * np.eye(4), 0.05, 50)


def _walls(face: PileFace, left: FloatArray, right: FloatArray, rough_m: float = 0.0) -> FloatArray:
    """Return hits on both walls up to the face; distances from the middle (K,) at x = -8 … 2, waves over the height."""
    x, z = (a.ravel() for a in np.meshgrid(np.arange(-8.0, 2.0, 0.03), np.arange(0.1, 1.7, 0.05)))
    bump = rough_m * np.sin(9.0 * z)
    at = np.linspace(-8.0, 2.0, len(left))
    y = np.concatenate([np.interp(x, at, left) + bump, -np.interp(x, at, right) - bump])
    hits = np.column_stack([np.tile(x, 2), y, np.tile(z, 2), np.zeros(2 * len(x))])
    return hits[hits[:, 0] < face.x_at(hits[:, 1], hits[:, 2])]


def _straight(half_m: float = 2.0) -> FloatArray:
    return np.full(11, half_m)


def _stope(mouth_x_m: float, step_m: float = 1.5) -> FloatArray:
    """Return a wall at 2 m that steps back at x."""
    return np.where(np.linspace(-8.0, 2.0, 2001) < mouth_x_m, 2.0, 2.0 + step_m)


@pytest.mark.parametrize("askew", [0.0, 0.3, -0.5])
def test_drift_up_to_the_face_is_measured_wall_to_wall_in_its_plane(askew: float) -> None:
    face = _face(askew=askew)
    limits = limits_of(_walls(face, _straight(), _straight(1.9)), face, 0.0, 2.0)
    width, std = limits.width_m(askew)
    assert limits.mouth_chance < 0.05
    assert width == pytest.approx(3.9 * math.hypot(1.0, askew), abs=0.03)
    assert 0.0 < std < 0.1


@pytest.mark.parametrize("before_m", [1.0, 1.5, 2.0])
def test_stope_is_measured_at_its_mouth(before_m: float) -> None:
    face = _face()
    limits = limits_of(_walls(face, _stope(-before_m), _stope(-before_m)), face, 0.0, 2.0)
    width, std = limits.width_m(0.1)
    assert limits.mouth_chance > 0.9
    assert abs(width - 4.0) < 2.0 * math.hypot(std, 0.03)


def test_wall_that_was_not_seen_stands_as_the_other_one() -> None:
    face = _face()
    hits = _walls(face, _straight(), _straight())
    hits = hits[(hits[:, 1] > 0.0) | (hits[:, 0] < -1.5)]
    limits = limits_of(hits, face, 0.0, 2.0)
    assert limits.mouth_chance < 0.05
    assert limits.left_m - limits.right_m == pytest.approx(4.0, abs=0.05)
    assert limits.right_std_m > limits.left_std_m


def test_doubt_between_mouth_and_wall_is_part_of_the_deviation() -> None:
    sure, open_, torn = (FaceLimits(2.0, -2.0, 0.05, 0.05, chance, 0.4, 0.1) for chance in (0.0, 1.0, 0.5))
    assert sure.width_m(0.0) == pytest.approx((4.0, 0.05 * math.sqrt(2.0)))
    assert open_.width_m(0.7) == pytest.approx((4.0, 0.05 * math.sqrt(2.0)))
    width, std = torn.width_m(0.0)
    assert width == pytest.approx(4.0)
    assert std == pytest.approx(math.sqrt(2.0 * 0.05**2 + 0.2**2))


def test_mouth_of_which_few_heights_were_seen_is_less_sure() -> None:
    face = _face()
    hits = _walls(face, _stope(-1.2), _stope(-1.2), rough_m=0.1)
    all_seen = limits_of(hits, face, 0.0, 2.0).left_std_m
    few = limits_of(hits[(hits[:, 2] > 0.65) & (hits[:, 2] < 1.05)], face, 0.0, 2.0).left_std_m
    assert few > 1.2 * all_seen


@pytest.mark.parametrize("seed", range(6))
def test_what_one_sees_along_a_rough_wall_is_its_nearer_part(seed: int) -> None:
    """A wall of three scales of bumps, looked at from 15 to 30 m before: the reason for the upper quartile."""
    rng = np.random.default_rng(seed)
    x = np.arange(0.0, 40.0, 0.01)
    waves = [(0.06, 2.0), (0.04, 0.7), (0.02, 0.25)]
    y = 2.0 + np.sum([a * np.sin(2.0 * np.pi * (x / length + rng.random())) for a, length in waves], axis=0)
    seen = np.zeros(len(x), dtype=bool)
    for eye in np.arange(0.0, 15.0, 3.0):
        beyond = x > eye + 15.0
        slope = y[beyond] / (x[beyond] - eye)  # the ray that leaves the middle at a smaller angle goes farther
        seen[beyond] |= slope <= np.minimum.accumulate(slope) + 1e-12
    every = np.median(y[x > 30.0])
    visible = y[seen & (x > 30.0)]
    assert np.median(visible) < every - 0.02
    assert abs(np.quantile(visible, _VISIBLE) - every) < abs(np.median(visible) - every)


def test_wall_measured_farther_before_a_shallow_face_is_less_sure_where_it_varies() -> None:
    wall = 1.9 + 0.15 * np.linspace(-8.0, 2.0, 2001)
    widening, straight = (
        limits_of(_walls(_face(3.5), one, one), _face(3.5), 0.0, 1.9) for one in (wall, _straight(1.9))
    )
    assert straight.left_std_m < 0.05
    assert widening.left_std_m > 2.0 * straight.left_std_m

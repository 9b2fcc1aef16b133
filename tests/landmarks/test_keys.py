"""The paper's procedure on matrices made by hand and by chance, against a plain reading of it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.landmarks.keys import Keys, choose_keys, judged_landmark
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.messages import FloatArray

SETTINGS = LandmarkSettings()
PAPER = dataclasses.replace(SETTINGS, min_radius=2)
NO_MATCH = SETTINGS.limit_m**2


def matrix(n: int, reach: int = 4, seed: int = 0) -> FloatArray:
    """Values that rise with the distance up to `reach`, and are a little under no match beyond."""
    rng = np.random.default_rng(seed)
    away = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    near = 1e-4 * (away + 0.5 * rng.random((n, n)))
    F = np.where(away <= reach, near, NO_MATCH * (0.5 + 0.4 * rng.random((n, n))))
    np.fill_diagonal(F, 0.0)
    return F


def plainly(column: FloatArray, j: int) -> tuple[float, float]:
    """Walk up the order as the text says: the last neighbour before the first that is none."""
    order = [i for i in np.argsort(column, kind="stable") if i != j]
    last = None
    for position, i in enumerate(order):
        if abs(i - j) > SETTINGS.neighbours:
            break
        last = position
    if last is None:
        return 0.0, 0.0
    following = column[order[last + 1]]
    return column[order[last]], following - column[order[last]]


@given(st.integers(12, 40), st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_threshold_and_delta_are_the_papers(n: int, seed: int) -> None:
    F = np.random.default_rng(seed).uniform(0.0, 0.9 * NO_MATCH, (n, n))
    np.fill_diagonal(F, 0.0)
    for j in range(n):
        threshold, delta, _ = judged_landmark(F[:, j], j, SETTINGS)
        assert (threshold, delta) == pytest.approx(plainly(F[:, j], j))


@given(st.integers(0, 45), st.integers(0, 10_000), st.sampled_from([0, 1, 2]))
@settings(max_examples=60, deadline=None)
def test_what_holds_for_all_keys(n: int, seed: int, min_radius: int) -> None:
    chosen = dataclasses.replace(SETTINGS, min_radius=min_radius)
    F = np.random.default_rng(seed).uniform(0.0, 1.1 * NO_MATCH, (n, n))
    away = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    F = np.where(away <= 3, 0.3 * F, F)
    keys = choose_keys(F, chosen)
    at = np.flatnonzero(keys.key)
    assert (np.diff(at) > chosen.key_spacing).all()
    assert (keys.radius[at] > 0).all()
    inner = at[(at >= chosen.ends) & (at < n - chosen.ends)]
    assert (keys.radius[inner] > min_radius).all()
    assert (keys.delta >= 0.0).all()
    assert (keys.radius <= chosen.neighbours).all()
    for j in range(n):
        within = away[j] <= keys.radius[j]
        within[j] = False
        assert (F[within, j] <= keys.threshold[j]).all()
    again = choose_keys(F, chosen)
    for column in ("threshold", "delta", "radius", "key"):
        np.testing.assert_array_equal(getattr(again, column), getattr(keys, column))


@given(st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_no_key_is_taken_for_another(seed: int) -> None:
    F = np.random.default_rng(seed).uniform(0.0, NO_MATCH, (40, 40))
    near = dataclasses.replace(SETTINGS, key_spacing=1)  # keys may be neighbours: then it has to be tested
    for chosen in (SETTINGS, near):
        keys = choose_keys(F, chosen)
        at = np.flatnonzero(keys.key)
        between = F[np.ix_(at, at)] <= keys.threshold[at]
        assert between.sum() == np.diag(between).sum()


def test_a_clear_tunnel_has_keys_at_both_ends_and_between() -> None:
    keys = choose_keys(matrix(60), PAPER)
    at = np.flatnonzero(keys.key)
    assert at[0] < 10
    assert at[-1] >= 50
    assert 6 <= len(at) <= 10
    assert (keys.radius == 4).sum() > 50


def test_the_radius_is_the_whole_of_what_matches() -> None:
    """Landmark 2 m away does not match, 4 m does: the radius is 0, whatever the last accepted is."""
    F = matrix(30)
    F[15 + np.array([-1, 1]), 15] = 0.95 * NO_MATCH
    threshold, _, radius = judged_landmark(F[:, 15], 15, SETTINGS)
    assert radius == 0
    assert threshold > 0.0


def test_a_tunnel_that_looks_the_same_everywhere_has_no_keys() -> None:
    F = np.full((30, 30), 1e-4)
    np.fill_diagonal(F, 0.0)
    keys = choose_keys(F, SETTINGS)
    assert not keys.key.any()
    assert not keys.radius.any()


def test_a_pair_that_does_not_match_is_no_neighbour_to_be_found() -> None:
    keys = choose_keys(np.full((30, 30), NO_MATCH), SETTINGS)
    assert not keys.radius.any()


def test_pairs_that_were_not_compared_do_not_count() -> None:
    F = matrix(60, reach=SETTINGS.neighbours)
    cut = np.where(np.abs(np.subtract.outer(np.arange(60), np.arange(60))) > 20, np.nan, F)
    whole, part = choose_keys(F, SETTINGS), choose_keys(cut, SETTINGS)
    assert np.array_equal(whole.threshold, part.threshold)
    assert (part.delta >= whole.delta).all()


@pytest.mark.parametrize("n", [0, 1, 2, 7, 11])
def test_short_tunnels(n: int) -> None:
    keys = choose_keys(matrix(n), SETTINGS)
    assert isinstance(keys, Keys)
    assert keys.key.sum() <= 2
    assert len(keys.key) == n

"""A live profile on strips of random walls: found where it was cut from, in both directions and across where strips meet."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.localization.placing import Costs, LiveProfile
from lhdmap.localization.strips import Strips
from lhdmap.messages import FloatArray

WEIGHTS = np.array([1.0, 1.0, 0.02])
BINS, VARIANCE, SPREAD = 300, 0.005**2, 0.05
STEP_M = 0.1


def walls(seed: int, bins: int = BINS) -> FloatArray:
    """Return left and right wall and turn (3, n)."""
    rng = np.random.default_rng(seed)
    return np.array([2.0, 2.0, 0.0])[:, None] + np.array([SPREAD, SPREAD, 0.02])[:, None] * rng.standard_normal(
        (3, bins)
    )


def strips(*values: FloatArray, before: tuple[tuple[int, ...], ...] | None = None) -> Strips:
    """Return strips 1 km apart along x; `before`: those that lead into each."""
    leads = ((),) * len(values) if before is None else before
    poses = [
        np.column_stack([1000.0 * k + STEP_M * np.arange(one.shape[1]), np.zeros((one.shape[1], 2))])
        for k, one in enumerate(values)
    ]
    joined = np.concatenate(values, axis=1)
    known = np.isfinite(joined)
    evidence = 1.0 + math.log1p(SPREAD**2 / VARIANCE)
    return Strips(
        np.where(known, joined, 0.0).astype(np.float32),
        np.full(joined.shape, VARIANCE, np.float32),
        known.astype(np.float32),
        (evidence * known).astype(np.float32),
        np.concatenate(poses),
        np.zeros(joined.shape[1]),
        np.cumsum([0, *(one.shape[1] for one in values)]),
        np.array([one for lead in leads for one in lead], dtype=np.int64),
        np.cumsum([0, *map(len, leads)]),
        tuple(f"t{k}" for k in range(len(values))),
        1.0,
    )


def live(values: FloatArray, seed: int = 0) -> LiveProfile:
    noisy = values + 0.5 * math.sqrt(VARIANCE) * np.random.default_rng(seed).standard_normal(values.shape)
    return LiveProfile(noisy, np.full(values.shape, VARIANCE), np.zeros((values.shape[1], 2)))


@settings(max_examples=20, deadline=None)
@given(end=st.integers(60, BINS - 1), length=st.integers(50, 60), strip=st.integers(0, 2))
def test_a_window_is_found_where_it_was_cut_from(end: int, length: int, strip: int) -> None:
    tunnels = [walls(k) for k in range(3)]
    costs = Costs(strips(*tunnels), live(tunnels[strip][:, end - length + 1 : end + 1]), WEIGHTS)
    best, second = costs.likeliest()[:2]
    assert best.place == strip * BINS + end
    assert second.cost - best.cost > 30.0
    assert best.chi2 < 1.0
    assert best.compared == 1.0
    assert best.probability > 0.999


def test_what_is_no_wall_of_the_map_fits_nowhere() -> None:
    costs = Costs(strips(walls(0), walls(1)), live(walls(7)[:, :100]), WEIGHTS)
    best = costs.likeliest()[0]
    assert best.cost > -1.0  # that of a few bins at an end, by chance
    assert best.compared < 0.1
    assert best.probability < 0.01


def test_a_window_runs_on_where_strips_meet() -> None:
    """Strips 0 and 1 both lead into 2; the live one comes from 1."""
    tunnels = [walls(k) for k in range(3)]
    met = strips(*tunnels, before=((), (), (0, 1)))
    window = np.concatenate([tunnels[1][:, -40:], tunnels[2][:, :30]], axis=1)
    best = Costs(met, live(window), WEIGHTS).likeliest()[0]
    assert best.place == 2 * BINS + 29
    assert best.compared == 1.0
    assert best.chi2 < 1.0
    apart = Costs(strips(*tunnels), live(window), WEIGHTS).likeliest()[0]
    assert apart.cost > best.cost + 30.0


def test_from_outside_the_map_into_it() -> None:
    tunnel = walls(3)
    window = np.concatenate([walls(8)[:, :50], tunnel[:, :60]], axis=1)
    best = Costs(strips(tunnel), live(window), WEIGHTS).likeliest()[0]
    assert best.place == 59
    assert best.compared == pytest.approx(60 / 110)


def test_unknown_walls_tell_nothing() -> None:
    unknown = np.full((3, BINS), np.nan)
    costs = Costs(strips(unknown), live(walls(1)[:, :80]), WEIGHTS)
    best = costs.likeliest()[0]
    assert (best.cost, best.compared) == (0.0, 0.0)
    hidden = walls(1)
    hidden[1, 100:200] = np.nan
    found = Costs(strips(hidden, walls(2)), live(walls(1)[:, 120:180]), WEIGHTS).likeliest()[0]
    assert found.place == 179  # by one wall alone


def test_what_is_said_of_a_place_that_is_claimed() -> None:
    tunnels = [walls(k) for k in range(2)]
    costs = Costs(strips(*tunnels), live(tunnels[0][:, 50:150]), WEIGHTS)
    right, wrong = (costs.at(np.array([x, 0.3, 0.02]), 0.0) for x in (14.9, 1014.9))
    assert right is not None
    assert wrong is not None
    assert right.cost < -30.0 < 30.0 < wrong.cost
    assert costs.at(np.array([14.9, 0.0, math.pi]), 0.0) is None
    assert costs.at(np.array([14.9, 0.0, 0.0]), 10.0) is None  # another level

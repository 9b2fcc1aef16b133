"""The rule for another attempt against all thresholds, on loads whose gains are known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lhdmap.loading.attempts import Attempts, Gains, best_rate, fit_gains
from lhdmap.loading.weighing_settings import AttemptSettings

SETTINGS = AttemptSettings()


def loads(count: int, seed: int) -> list[list[float]]:
    """Return fills after each of six attempts: gains by a line, with a scatter, never a loss."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(count):
        fills = [max(0.62 + 0.2 * rng.standard_normal(), 0.05)]
        for _ in range(5):
            fills.append(fills[-1] + max(0.45 * (1.05 - fills[-1]) + 0.05 * rng.standard_normal(), 0.0))
        found.append(fills)
    return found


def per_hour(fills: list[list[float]], stops: list[int], settings: AttemptSettings) -> float:
    """Return fills per hour where load k is hauled after `stops[k]` attempts."""
    filled = sum(load[stop - 1] for load, stop in zip(fills, stops, strict=True))
    return 3600.0 * filled / (len(fills) * settings.haul_s + settings.attempt_s * sum(stops))


@pytest.mark.parametrize("haul_s", [60.0, 180.0, 600.0])
def test_as_good_as_the_best_threshold_for_each_haul(haul_s: float) -> None:
    settings = replace(SETTINGS, haul_s=haul_s)
    rule, test = Attempts(settings, 11.0, fit_gains(loads(300, 1))), loads(600, 2)
    stops = [next(k for k in range(1, 7) if not rule.decide(load[k - 1], 0.03, k).go_on) for load in test]
    best = max(
        per_hour(test, [next((k for k in range(1, 6) if load[k - 1] >= full), 6) for load in test], settings)
        for full in np.arange(0.3, 1.1, 0.05)
    )
    assert per_hour(test, stops, settings) > 0.99 * best


def test_the_rate_is_that_of_its_own_rule() -> None:
    """Equal loads and gains by a line: the best number of attempts can be counted out."""
    gains = Gains(first=0.5, first_std=0.0, empty=0.4, full=0.05)
    fills = [0.5]
    for _ in range(5):
        fills.append(fills[-1] + gains.gain(fills[-1]))
    settings = replace(SETTINGS, haul_s=200.0, attempt_s=30.0)
    rates = [fill / (200.0 + 30.0 * k) for k, fill in enumerate(fills, start=1)]
    assert best_rate(gains, settings) == pytest.approx(max(rates), rel=1e-9)


def test_a_longer_haul_wants_a_fuller_bucket() -> None:
    def stop_at(haul_s: float) -> float:
        rule = Attempts(replace(SETTINGS, haul_s=haul_s), 11.0)
        return next(fill for fill in np.arange(0.0, 1.5, 0.01) if not rule.decide(fill, 0.0, 1).go_on)

    found = [stop_at(haul_s) for haul_s in (30.0, 60.0, 180.0, 600.0, 3600.0)]
    assert found == sorted(found)
    assert found[0] < found[-1]


def test_it_says_why() -> None:
    decision = Attempts(SETTINGS, 11.0).decide(0.41, 0.03, 1)
    assert decision.go_on
    assert "fill 0.41 ± 0.03 after attempt 1" in decision.text
    assert decision.text.endswith("another attempt")
    values = dict(decision.values)
    assert values["gain_per_s"] > values["best_per_s"]


def test_ends_whatever_is_weighed() -> None:
    rule = Attempts(SETTINGS, 11.0)
    assert rule.decide(math.nan, math.nan, 1).go_on
    assert not rule.decide(math.nan, math.nan, SETTINGS.most).go_on
    plain = Attempts(replace(SETTINGS, rule="threshold", full=0.9), 11.0)
    assert [plain.decide(fill, 0.0, 1).go_on for fill in (0.89, 0.9, math.nan)] == [True, False, True]


def test_gains_of_loads_are_their_line() -> None:
    gains = fit_gains([[0.5, 0.5 + 0.3], [0.8, 0.8 + 0.15], [0.2, 0.2 + 0.45]])
    assert [gains.empty, gains.full] == pytest.approx([0.55, 0.05])
    assert fit_gains([[0.5], [0.7]]).gain(0.2) == 0.0

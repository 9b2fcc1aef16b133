"""The controllers on the simulated ground: a few piles, what must hold on each of them or in their mean."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.loading.digging_settings import ChargingSettings

from tests.loading.digging.charges import charge_all
from tests.loading.digging.loads import Dug, Plan, charged, dug, loader_on

SEEDS = range(8100, 8106)


def first_dig(method: str, seed: int) -> Dug:
    """Return the first attempt on a pile."""
    plan = Plan(method, "fused", approach_m=3.0)
    loader = loader_on("default")
    charge, signals = charged(loader, plan, loader.begin(seed, approach_m=3.0))
    return dug(loader, plan, signals, charge)


@pytest.fixture(scope="module")
def digs() -> dict[str, list[Dug]]:
    """Return the first digs of each method on the same piles."""
    return {method: [first_dig(method, seed) for seed in SEEDS] for method in ("paper", "paper-tuned", "adaptive")}


def test_each_dig_ends_at_a_stop_with_ore(digs: dict[str, list[Dug]]) -> None:
    for rows in digs.values():
        for one in rows:
            assert one.ended in ("boom", "racked", "advance")
            assert 0.1 < one.fill < 1.6
            assert math.isfinite(one.charge.touch_s)


def test_the_force_law_brings_more_and_sooner(digs: dict[str, list[Dug]]) -> None:
    ours, paper = digs["adaptive"], digs["paper"]
    assert np.mean([one.fill for one in ours]) > np.mean([one.fill for one in paper]) + 0.05
    until_racked = [np.mean([one.duration_s + one.rack_s for one in rows]) for rows in (ours, paper)]
    assert until_racked[0] < until_racked[1]


def test_fused_is_right_where_the_thresholds_are_early() -> None:
    seeds = list(range(8200, 8212))
    fused = charge_all("fused", "fused", ChargingSettings(), seeds)
    paper = charge_all("paper", "paper", ChargingSettings(), seeds)
    assert fused.share("early") == 0.0
    assert fused.share("right") >= paper.share("right")
    assert np.median(fused.delays_s("touch_s")) < np.median(paper.delays_s("touch_s"))


def test_the_same_pile_gives_the_same_dig() -> None:
    assert first_dig("adaptive", 8100) == first_dig("adaptive", 8100)

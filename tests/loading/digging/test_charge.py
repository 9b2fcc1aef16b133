"""Charging: launches, bumps, touches; each detector against what the small world knows."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from lhdmap.loading.charge import Charge
from lhdmap.loading.detector import FusedDetector, detector_of
from lhdmap.loading.digging_settings import ChargingSettings
from lhdmap.loading.signals import Signals

from tests.loading.digging.rig import Loader, World, run

SETTINGS = ChargingSettings()
BUMP = World(toe_m=5.0, bump=(2.4, 140.0, 0.3), noise=1.0)


def delay_s(loader: Loader) -> float:
    """Return the time since the lip has met the pile."""
    return (loader.now_ns - loader.touched_ns) * 1e-9 if loader.touched_ns else -math.inf


def test_without_a_guard_the_printed_skid_triggers_at_the_launch() -> None:
    loader = Loader(World(top_mps=3.0, lag_ticks=15))
    turn, turns, _ = run(Charge(replace(SETTINGS, launch_s=0.0), "paper"), loader)
    assert (turn.ended, loader.touched_ns) == ("skid", 0)
    assert len(turns) * 0.02 < 1.0
    for cured in (SETTINGS, replace(SETTINGS, launch_s=0.0, lag_matched=True)):
        loader = Loader(World(top_mps=3.0, lag_ticks=15))
        assert run(Charge(cured, "paper"), loader)[0].ended
        assert loader.touched_ns


@pytest.mark.parametrize("seed", range(4))
def test_fused_is_sooner_than_the_printed_thresholds(seed: int) -> None:
    world = World(noise=1.0, seed=seed, toe_error_m=0.1 * (-1) ** seed)
    delays = {}
    for name in ("paper", "fused"):
        loader = Loader(world)
        turn, _, _ = run(Charge(SETTINGS, name), loader)
        delays[name] = delay_s(loader)
        assert turn.ended
    assert 0.0 <= delays["fused"] < delays["paper"] - 0.2


def test_a_bump_fools_the_thresholds_and_not_the_range() -> None:
    early = Loader(BUMP)
    assert run(Charge(SETTINGS, "paper"), early)[0].ended == "pressure"
    assert not early.touched_ns
    late = Loader(BUMP)
    turn, turns, _ = run(Charge(SETTINGS, "fused"), late)
    assert turn.ended
    assert late.touched_ns
    assert any(one.pedals.tilt > 0.0 for one in turns)  # the bucket was eased


def test_without_a_pile_known_fused_is_as_the_paper() -> None:
    loader = Loader(World())
    world = loader.signals()
    fused = detector_of(SETTINGS, "fused")
    assert isinstance(fused, FusedDetector)
    assert fused.update(world._replace(transmission_bar=299.0, toe_m=math.nan), 0.4).touch == ""
    assert fused.update(world._replace(transmission_bar=301.0, toe_m=math.nan), 0.4).touch == "pressure"
    assert fused.update(world._replace(toe_m=math.nan), 0.6).touch == "skid"


def test_loose_rock_that_gives_no_force_is_touched_by_range() -> None:
    loader = Loader(World(hardness_kn=1.0))
    turn, _, _ = run(Charge(SETTINGS, "fused"), loader)
    assert turn.ended == "inside"
    assert loader.way_m - 3.0 == pytest.approx(SETTINGS.inside_m + 2.0 * 0.15, abs=0.05)


def test_the_delay_told_is_that_since_the_force_came() -> None:
    """40 kN of 160 a metre: what is told as onset is where the force passes 20 kN."""
    loader = Loader(World())
    turn, _, _ = run(Charge(SETTINGS, "fused"), loader)
    passed_s = dict(turn.values)["delay_s"]
    assert 0.0 < passed_s < delay_s(loader)


def test_the_pedal_is_constant_and_nothing_is_lifted() -> None:
    _, turns, _ = run(Charge(SETTINGS, "paper"), Loader(World(noise=1.0)))
    assert {(one.pedals.propel, one.pedals.tilt, one.pedals.lift) for one in turns} == {(0.5, 0.0, 0.0)}


def test_nothing_is_touched_by_what_is_not_heard() -> None:
    nan = math.nan
    nothing = Signals(0, nan, nan, 0, nan, nan, nan, nan, nan, nan, nan)
    for name in ("paper", "fused"):
        charge = Charge(SETTINGS, name)
        charge.begin(nothing)
        for tick in range(400):
            turn = charge.step(nothing._replace(now_ns=tick * 20_000_000))
            assert turn.ended == ""
            assert math.isfinite(turn.pedals.propel)


def test_begun_again_it_has_forgotten() -> None:
    charge = Charge(SETTINGS, "fused")
    first = run(charge, Loader(World(noise=1.0)))[1]
    assert run(charge, Loader(World(noise=1.0)))[1] == first

"""Weighing against pressures of known fills; the fit against sinusoids of known centres; the shake."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from lhdmap.loading.digging_settings import ExcavationSettings
from lhdmap.loading.shake import Shake
from lhdmap.loading.weighing import Weighing
from lhdmap.loading.weighing_settings import WeighingSettings
from lhdmap.loading.weighing_settle import mean_of, sinusoid_of

from tests.loading.digging.rig import Loader, World, run

SETTINGS = WeighingSettings()


@pytest.mark.parametrize("fill", [0.0, 0.5, 1.0, 1.2])
@pytest.mark.parametrize("method", ["mean", "sinusoid"])
def test_table_2_the_other_way_round(fill: float, method: str) -> None:
    loader = Loader(World(fill=fill, noise=0.5), boom_rad=0.0)
    weighing = Weighing(replace(SETTINGS, method=method))
    turn, _, _ = run(weighing, loader)
    assert turn.ended == "weighed"
    assert weighing.result is not None
    assert weighing.result.fill == pytest.approx(fill, abs=0.015 if method == "sinusoid" else 0.03)
    assert 0.02 < weighing.result.fill_std < 0.04
    assert weighing.result.settling_s <= 4.0


@pytest.mark.parametrize("boom_rad", [-0.3, 0.19, 0.6])
def test_it_is_approached_from_below(boom_rad: float) -> None:
    loader = Loader(World(fill=0.8), boom_rad=boom_rad)
    _, turns, heard = run(Weighing(SETTINGS), loader)
    lifts = [turn.pedals.lift for turn in turns]
    moved = [k for k, lift in enumerate(lifts) if lift]
    assert lifts[moved[-1]] > 0.0
    assert min(one.boom_rad for one in heard) <= SETTINGS.boom_rad - SETTINGS.below_rad
    assert heard[-1].boom_rad == pytest.approx(SETTINGS.boom_rad, abs=0.01)
    assert all(turn.pedals.brake and turn.pedals.propel == 0.0 for turn in turns)


def test_a_tare_takes_the_zero_out() -> None:
    """A sensor that reads 3 bar too much (0.5 % of 600 bar) weighs 6 % too much without the tare."""

    class Shifted(Loader):
        def lift_bar(self) -> float:
            return super().lift_bar() + 3.0

    empty = Weighing(SETTINGS)
    run(empty, Shifted(World(fill=0.0)))
    assert empty.result is not None
    fills = []
    for tare in (None, empty.result.pressure_bar):
        weighing = Weighing(SETTINGS, tare)
        run(weighing, Shifted(World(fill=0.8)))
        assert weighing.result is not None
        fills.append(weighing.result)
    assert fills[0].fill == pytest.approx(0.8 + 3.0 * 0.0207, abs=0.005)
    assert fills[1].fill == pytest.approx(0.8, abs=0.005)
    assert fills[1].fill_std < fills[0].fill_std


def test_what_never_settles_is_weighed_after_patience_and_says_so() -> None:
    class Shaking(Loader):
        def lift_bar(self) -> float:
            return 90.0 + 15.0 * math.sin(7.0 * self.now_ns * 1e-9)

    weighing = Weighing(SETTINGS)
    turn, _, _ = run(weighing, Shaking(World(fill=0.8), boom_rad=0.0))
    assert turn.ended == "not settled"
    assert weighing.result is not None
    assert not weighing.result.settled
    assert weighing.result.settling_s == pytest.approx(SETTINGS.patience_s, abs=0.15)


def test_a_pressure_that_is_not_heard_gives_no_fill() -> None:
    class Deaf(Loader):
        def lift_bar(self) -> float:
            return math.nan

    weighing = Weighing(SETTINGS)
    turn, _, _ = run(weighing, Deaf(World(), boom_rad=0.0))
    assert turn.ended == "not settled"
    assert math.isnan(dict(turn.values)["fill"])


@pytest.mark.parametrize("frequency_hz", [0.9, 1.4, 2.3, 4.1])
@pytest.mark.parametrize("damping", [0.03, 0.08])
def test_the_centre_of_a_damped_sinusoid(frequency_hz: float, damping: float) -> None:
    """1 s of a swing of 12 bar about 90 bar, noise 1.5 bar: the mean is off by bars, the fit by tenths."""
    t, rng, errors, plain = 0.02 * np.arange(50, dtype=float), np.random.default_rng(5), [], []
    w = 2.0 * math.pi * frequency_hz
    for phase in np.linspace(0.0, 6.0, 12):
        swing = 90.0 + 12.0 * np.exp(-damping * w * t) * np.cos(w * t + phase) + 1.5 * rng.standard_normal(50)
        errors.append(sinusoid_of(t, swing).pressure_bar - 90.0)
        plain.append(mean_of(swing).pressure_bar - 90.0)
    assert np.std(errors) < 1.0
    if frequency_hz < 1.0:
        assert np.std(errors) < np.std(plain)


def test_the_shake_goes_down_and_up_and_back() -> None:
    loader = Loader(World(), bucket_rad=-0.1)
    turn, turns, _ = run(Shake(SETTINGS, ExcavationSettings()), loader)
    tilts = [one.pedals.tilt for one in turns]
    signs = [tilts[0]] + [b for a, b in itertools.pairwise(tilts) if b != a]
    assert signs == [-1.0, 1.0, -1.0, 1.0, 0.0]
    assert turn.ended == "shaken"
    assert loader.bucket_rad >= -0.03
    assert len(turns) * 0.02 <= 2 * 2 * 0.3 + SETTINGS.racked_s + 0.1

"""Eq. (8) and Fig. 19, step by step, with each erratum on and off."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lhdmap.loading.digging_settings import ExcavationSettings, PaperDigSettings, TunedDigSettings
from lhdmap.loading.excavation import DigSettings, excavation_of
from lhdmap.loading.excavation_lift import SlipLift
from lhdmap.loading.excavation_paper import PaperDig
from lhdmap.loading.signals import Pedals, Signals

from tests.loading.digging.rig import Loader, World, run

QUIET = Signals(0, 0.5, 0.5, 0, 0.0, -0.35, -0.83, 0.0, 200.0, 50.0, 23.0)


def pedals(seconds: float, settings: PaperDigSettings | None = None, **heard: Any) -> list[Pedals]:
    """Return what is asked for while the same is heard, each 20 ms."""
    dig = PaperDig(ExcavationSettings(), settings or PaperDigSettings())
    one = QUIET._replace(**heard)
    dig.begin(one)
    return [dig.step(one._replace(now_ns=k * 20_000_000)).pedals for k in range(round(seconds / 0.02))]


def phases(asked: list[Pedals]) -> list[tuple[bool, float]]:
    """Return which state lasted how long: S_push (full_rpm) or S_tilt."""
    return [(push, 0.02 * len(list(same))) for push, same in itertools.groupby(asked, lambda one: one.full_rpm)]


def test_the_ramp_of_eq_8() -> None:
    asked = pedals(1.0)
    times = 0.02 * np.arange(len(asked))
    np.testing.assert_allclose([one.tilt for one in asked], np.minimum(1.2 * times, 1.0), atol=1e-9)
    assert {one.propel for one in asked} == {0.5}
    assert not any(one.lift or one.full_rpm for one in asked)


def test_the_states_alternate() -> None:
    found = phases(pedals(6.0))
    assert [push for push, _ in found[:4]] == [False, True, False, True]
    for _, length_s in found[:-1]:
        assert length_s == pytest.approx(1.0, abs=0.05)


def test_as_printed_push_lasts_one_tick() -> None:
    """E1: the test of S_push runs in the pass that ended S_tilt, with its time."""
    found = phases(pedals(6.0, PaperDigSettings(time_read_again=False)))
    assert all(length_s == pytest.approx(0.02) for push, length_s in found if push)


def test_pressure_ends_push_after_the_least_time() -> None:
    lengths = [s for push, s in phases(pedals(8.0, transmission_bar=310.0))[:-1] if push]
    assert lengths
    assert lengths == pytest.approx([0.5] * len(lengths), abs=0.05)


def test_pressure_alone_where_it_is_read_so() -> None:
    """E9: `EP and (t_min or t_max)` never leaves S_push while the pressure is low."""
    assert [push for push, _ in phases(pedals(8.0, PaperDigSettings(pressure_needed=True)))] == [False, True]


def test_tilt_ends_early_where_its_lower_bound_is_meant() -> None:
    """E8: with a lower bound, S_tilt ends after 0.5 s while the pressure is low."""
    found = phases(pedals(4.0, PaperDigSettings(tilt_ends_early=True)))
    assert found[0][1] == pytest.approx(0.5, abs=0.05)
    held = phases(pedals(4.0, PaperDigSettings(tilt_ends_early=True), transmission_bar=310.0))
    assert held[0][1] == pytest.approx(1.0, abs=0.05)


def test_lift_in_push_alone_and_only_with_skid() -> None:
    asked = pedals(4.0, tacho_mps=1.0, scan_mps=0.5)
    assert all(one.lift == float(one.full_rpm) for one in asked)
    assert not any(one.lift for one in pedals(4.0, tacho_mps=1.0, scan_mps=0.9))


def test_hysteresis_ends_chatter() -> None:
    """E4: a skid that swings about the threshold switches each time; with hysteresis and a least time it does not."""
    rng = np.random.default_rng(1)
    skids = 0.2 + 0.04 * rng.standard_normal(500)

    def switched(lift: SlipLift) -> int:
        on = [lift.update(k * 20_000_000, float(skid)) for k, skid in enumerate(skids)]
        return sum(a != b for a, b in itertools.pairwise(on))

    assert switched(SlipLift(0.2)) > 150
    assert switched(SlipLift(0.2, 0.1, 0.2)) < 40
    assert not SlipLift(0.2).update(0, math.nan)


@pytest.mark.parametrize(
    ("heard", "ended"),
    [
        ({"boom_rad": 0.5}, "boom"),
        ({"bucket_rad": -0.029}, "racked"),
        ({"travel_m": 2.0}, "advance"),
        ({"boom_rad": 0.49, "bucket_rad": -0.04, "travel_m": 1.99}, ""),
        ({"boom_rad": math.nan, "bucket_rad": math.nan, "travel_m": math.nan}, ""),
    ],
)
def test_stops(heard: dict[str, Any], ended: str) -> None:
    dig = PaperDig(ExcavationSettings(), PaperDigSettings())
    dig.begin(QUIET)
    turn = dig.step(QUIET._replace(now_ns=20_000_000, **heard))
    assert turn.ended == ended
    assert (turn.pedals == Pedals()) == bool(ended)


@pytest.mark.parametrize("method", ["paper", "paper-tuned", "adaptive"])
@pytest.mark.parametrize("most_rad", [0.1, 0.5])
def test_the_boom_is_lifted_no_higher_than_the_roof_allows(method: str, most_rad: float) -> None:
    """All wheels slip for as long as it takes, and no other stop is near: what is not limited lifts to its stop at 0.85."""
    common = ExcavationSettings(lift_most_rad=most_rad, alpha_max_rad=2.0, boom_max_rad=2.0, advance_max_m=10.0)
    paper = PaperDigSettings(boom_max_rad=2.0, advance_max_m=10.0)
    tuned = replace(TunedDigSettings(), boom_max_rad=2.0, advance_max_m=10.0)
    settings = DigSettings(common, paper, tuned)
    dig, boom_rad = excavation_of(settings, method), -0.35
    for k in range(1500):
        slips = QUIET._replace(
            now_ns=k * 20_000_000, scan_ns=k * 20_000_000, scan_mps=0.0, tacho_mps=1.0, boom_rad=boom_rad
        )
        if k == 0:
            dig.begin(slips)
        boom_rad += 0.02 * 0.25 * dig.step(slips).pedals.lift
    assert most_rad - 0.01 < boom_rad < most_rad + 0.01


def test_zero_and_tolerance_of_the_bucket() -> None:
    """E5: with zero at the level floor the dig ends at once; E6: without tolerance a stop read as -0.02 never ends it."""
    level = PaperDig(ExcavationSettings(racked_rad=-0.83), PaperDigSettings())
    level.begin(QUIET)
    assert level.step(QUIET).ended == "racked"
    strict = PaperDig(ExcavationSettings(alpha_tolerance_rad=0.0), PaperDigSettings())
    strict.begin(QUIET)
    assert strict.step(QUIET._replace(bucket_rad=-0.02)).ended == ""


@pytest.mark.parametrize("method", ["paper", "paper-tuned", "adaptive"])
def test_each_method_digs_and_ends_at_a_stop(method: str) -> None:
    loader = Loader(World(toe_m=0.2, hardness_kn=90.0, noise=1.0), speed_mps=0.8)
    turn, _, heard = run(excavation_of(DigSettings(), method), loader)
    assert turn.ended in ("boom", "racked", "advance")
    assert loader.way_m > 0.8
    assert heard[-1].bucket_rad > heard[0].bucket_rad


def test_tuned_is_the_same_law() -> None:
    numbers = replace(PaperDigSettings(), pedal=0.9, phase_max_s=0.4)
    same = {name: getattr(numbers, name) for name in PaperDigSettings.__dataclass_fields__}
    one = QUIET._replace(tacho_mps=1.0, scan_mps=0.7)
    asked = []
    for dig in (
        excavation_of(DigSettings(paper=numbers), "paper"),
        excavation_of(DigSettings(tuned=TunedDigSettings(**same)), "paper-tuned"),
    ):
        dig.begin(one)
        asked.append([dig.step(one._replace(now_ns=k * 20_000_000)).pedals for k in range(300)])
    assert asked[0] == asked[1]

"""The force law at known forces and speeds; what a stuck machine does."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.loading.digging_settings import ExcavationSettings
from lhdmap.loading.excavation_adaptive import AdaptiveDig
from lhdmap.loading.excavation_stuck import BackOff
from lhdmap.loading.signals import Pedals

from tests.loading.digging.test_paper_dig import QUIET

LAW = ExcavationSettings(
    force_kn=100.0,
    force_range_kn=80.0,
    advance_mps=0.05,
    advance_range_mps=0.2,
    back_off_s=0.0,
    skid_max=0.2,
    skid_smooth_s=0.0,
)


def asked(settings: ExcavationSettings = LAW, **heard: Any) -> Pedals:
    """Return what is asked for at once."""
    dig = AdaptiveDig(settings)
    dig.begin(QUIET)
    return dig.step(QUIET._replace(now_ns=20_000_000, **heard)).pedals


@pytest.mark.parametrize(
    ("force_kn", "advance_mps", "tilt"),
    [
        (100.0, 0.05, 0.0),
        (140.0, 0.05, 0.5),
        (180.0, 0.05, 1.0),
        (100.0, -0.05, 0.5),
        (140.0, 0.10, 0.25),
        (20.0, 0.8, 0.0),
    ],
)
def test_tilt_grows_with_force_and_with_the_want_of_advance(force_kn: float, advance_mps: float, tilt: float) -> None:
    pedals = asked(transmission_bar=force_kn / 0.4, scan_mps=advance_mps, tacho_mps=advance_mps)
    assert pedals.tilt == pytest.approx(tilt, abs=1e-9)


def test_without_scans_the_wheels_tell_the_advance() -> None:
    assert asked(transmission_bar=250.0, scan_mps=math.nan, tacho_mps=-0.05).tilt == pytest.approx(0.5)


def test_slip_lifts_and_takes_pedal() -> None:
    slipping = asked(tacho_mps=1.0, scan_mps=0.5)
    assert [slipping.lift, slipping.propel] == pytest.approx([1.0, LAW.pedal * LAW.pedal_slipping])
    holding = asked(tacho_mps=1.0, scan_mps=0.95)
    assert [holding.lift, holding.propel] == pytest.approx([0.0, LAW.pedal])


def test_a_stuck_machine_backs_out_once_and_goes_on() -> None:
    settings = ExcavationSettings(stuck_s=0.8, back_off_s=0.9, back_off_pedal=0.4)
    dig = AdaptiveDig(settings)
    still = QUIET._replace(tacho_mps=0.0, scan_mps=0.0)
    dig.begin(still)
    turns = [dig.step(still._replace(now_ns=k * 20_000_000)) for k in range(110)]
    back = [k for k, turn in enumerate(turns) if turn.pedals.propel < 0.0]
    assert turns[back[0]].pedals.propel == -0.4
    assert 0.7 <= back[0] * 0.02 <= 0.85
    assert len(back) * 0.02 == pytest.approx(0.9, abs=0.03)
    assert dict(turns[-1].values)["back_offs"] == 1.0


@pytest.mark.parametrize("moving", ["bucket_rad", "boom_rad", "travel_m"])
def test_what_moves_is_not_stuck(moving: str) -> None:
    back_off = BackOff(ExcavationSettings(stuck_rps=0.02, stuck_mps=0.03))
    for k in range(500):
        change: dict[str, Any] = {moving: 0.05 * 0.02 * k}
        one = QUIET._replace(now_ns=k * 20_000_000, **change)
        assert not back_off.update(one)


def test_nothing_heard_is_not_stuck_and_asks_for_finite_pedals() -> None:
    dig = AdaptiveDig(replace(LAW, back_off_s=0.9))
    nan = math.nan
    dig.begin(QUIET)
    for k in range(200):
        one = QUIET._replace(now_ns=k * 20_000_000, tacho_mps=nan, scan_mps=nan, travel_m=nan, transmission_bar=nan)
        turn = dig.step(one._replace(boom_rad=nan, bucket_rad=nan))
        assert turn.ended == ""
        assert turn.pedals.propel > 0.0
        assert 0.0 <= turn.pedals.tilt <= 1.0


@given(st.floats(0.0, 500.0), st.floats(-1.0, 3.0), st.floats(-1.0, 3.0))
def test_pedals_are_shares_whatever_is_heard(bar: float, wheels: float, scan: float) -> None:
    pedals = asked(transmission_bar=bar, tacho_mps=wheels, scan_mps=scan)
    assert 0.0 <= pedals.tilt <= 1.0
    assert pedals.lift in (0.0, 1.0)
    assert 0.0 <= pedals.propel <= 1.0

"""The pile along the machine: it stands, slides at its slope, and no litre is lost."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.loading.signals import Pedals
from lhdmap.messages import FloatArray
from lhdmap.simulation.ground.draws import CELL_M, draw_load
from lhdmap.simulation.ground.face import capacity, put_ahead, settle
from lhdmap.simulation.ground.loader import Loader
from lhdmap.simulation.ground.records import State, record
from lhdmap.simulation.ground.rig import rig_of

from tests.simulation.ground.digs import MACHINE, dug, ground_of, quiet

RIG = rig_of(MACHINE)[0]


def rock_of(seed: int = 0) -> Any:
    return draw_load(quiet(), seed).rock[0]


def steepest(heights: FloatArray) -> float:
    return float(np.abs(np.diff(heights)).max()) / CELL_M


@pytest.mark.parametrize("seed", range(4))
def test_the_face_stands_at_first_touch(seed: int) -> None:
    loader = Loader(MACHINE, quiet())
    loader.begin(seed)
    before = loader.pile[1]
    for _ in range(100):
        loader.step(Pedals(0.5), 0.02)
    assert np.array_equal(loader.pile[1], before)


def test_the_face_is_as_steep_as_the_file_says() -> None:
    slopes = []
    for seed in range(40):
        loader = Loader(MACHINE, quiet())
        loader.begin(seed)
        slopes.append(math.degrees(math.atan(steepest(loader.pile[1]))))
    assert min(slopes) == pytest.approx(42.0, abs=1.5)
    assert max(slopes) == pytest.approx(52.0, abs=1.5)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.integers(20, 200), st.floats(0.05, 2.0)), min_size=1, max_size=8))
def test_what_is_heaped_slides_to_its_slope_and_stays(heaps: list[tuple[int, float]]) -> None:
    rock, heights = rock_of(), np.zeros(300)
    for cell, area in heaps:
        put_ahead(heights, cell, rock, area)
    before = heights.sum()
    settle(record(State())[0], RIG, rock, heights)
    assert heights.sum() == pytest.approx(before, abs=1e-9)
    assert heights.min() >= 0.0
    assert steepest(heights) <= float(rock["slope"]) + 0.05


def test_a_trench_is_filled_from_above() -> None:
    loader = Loader(MACHINE, quiet())
    dug(loader, loader.begin(2))
    loader.retry()
    assert steepest(loader.pile[1]) < math.tan(math.radians(52.5)) + 0.05
    assert loader.truth.toe_m == pytest.approx(7.0, abs=0.1)


def test_no_litre_is_lost() -> None:
    loader = Loader(MACHINE, ground_of(filling={"boulder_chance": 0.5}))
    for seed in range(6):
        signals = loader.begin(seed, approach_m=2.0)
        before = loader.balance_m3()
        for _ in range(3):
            dug(loader, signals)
            assert loader.balance_m3() == pytest.approx(before, abs=5e-4)
            for _ in range(100):
                loader.step(Pedals(-0.5, 0.0, 0.2), 0.02)
            signals = loader.retry(approach_m=2.0)
            assert loader.balance_m3() == pytest.approx(before, abs=5e-4)


def test_the_bucket_holds_less_when_level_and_nothing_dumped() -> None:
    rock = rock_of()
    racked, level, dumped = (capacity(rock, RIG, psi) for psi in (0.8, 0.0, -0.8))
    assert racked == pytest.approx(float(rock["heap"]) * 5.0)
    assert level == pytest.approx(float(rock["level_share"]) * racked)
    assert dumped == 0.0


def test_a_bucket_that_is_dumped_gives_its_ore_back() -> None:
    loader = Loader(MACHINE, quiet())
    dug(loader, loader.begin(4))
    before, fill = loader.balance_m3(), loader.truth.fill
    assert fill > 0.2
    for _ in range(250):
        loader.step(Pedals(-0.5), 0.02)
    for lift, tilt in ((1.0, 0.0), (0.0, -1.0)):
        for _ in range(500):
            loader.step(Pedals(0.0, tilt, lift, True), 0.02)
    assert loader.truth.fill < 0.01
    assert loader.balance_m3() == pytest.approx(before, abs=5e-4)


def test_digging_loosens_the_rock_and_an_early_end_does_not() -> None:
    loader = Loader(MACHINE, quiet(rock={"attempt_sigma": 0.0, "loosened": 0.8}))
    signals, first = loader.begin(0), loader.hardness
    loader.retry()
    assert loader.hardness == first
    dug(loader, signals)
    loader.retry()
    assert loader.hardness == pytest.approx(0.8 * first)

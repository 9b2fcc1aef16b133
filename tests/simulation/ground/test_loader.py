"""Digs of the side view: alike for alike seeds, alike for steps of any length in the mean, heard through late sensors."""

from __future__ import annotations

import time

import numpy as np
import pytest
from lhdmap.loading.signals import Pedals
from lhdmap.simulation.ground.loader import Loader
from lhdmap.simulation.ground.sections import Grounds, load_ground

from tests.simulation.ground.digs import MACHINE, STEP_S, charged, dug, ground_of, quiet


def test_alike_seeds_give_alike_digs() -> None:
    def heard(seed: int) -> list[tuple[float, ...]]:
        loader = Loader(MACHINE, Grounds())
        signals = [loader.begin(seed, approach_m=1.0)]
        signals += [loader.step(Pedals(0.5, 0.3 * (k % 2), 0.1, True), STEP_S) for k in range(300)]
        return [tuple(one) for one in signals[20:]]

    assert heard(5) == heard(5)
    assert heard(5) != heard(6)


def test_a_load_before_leaves_nothing_behind() -> None:
    loader, fresh = Loader(MACHINE, Grounds()), Loader(MACHINE, Grounds())
    dug(loader, loader.begin(3, approach_m=1.0))
    assert dug(loader, loader.begin(8, approach_m=1.0)) == dug(fresh, fresh.begin(8, approach_m=1.0))


def test_steps_of_any_length_fill_the_bucket_alike_in_the_mean() -> None:
    """Single digs differ by chance (thresholds); the mean of an ensemble does not. Findings, question 6."""
    means = {}
    for step_s in (0.0005, 0.002, 0.005):
        loader = Loader(MACHINE, Grounds(), sub_step_s=step_s)
        fills = [dug(loader, loader.begin(seed, approach_m=0.5)).fill for seed in range(24)]
        means[step_s] = float(np.mean(fills))
    assert max(means.values()) - min(means.values()) < 0.025


def test_digging_fills_and_a_second_attempt_fills_more() -> None:
    loader, fills = Loader(MACHINE, load_ground()), []
    for seed in range(12):
        first = dug(loader, loader.begin(seed, approach_m=0.5)).fill
        fills.append((first, dug(loader, loader.retry(approach_m=0.5)).fill))
    first, second = np.mean(fills, axis=0)
    assert 0.4 < first < 0.8
    assert second > first + 0.08


def test_soft_rock_fills_better_than_hard() -> None:
    fills = []
    for hardness in (0.5, 6.0):
        loader = Loader(MACHINE, quiet(rock={"hardness": hardness, "hardness_sigma": 0.0}))
        fills.append(np.mean([dug(loader, loader.begin(seed, approach_m=0.5)).fill for seed in range(6)]))
    assert fills[0] > fills[1] + 0.2


def test_it_starts_pressed_before_the_toe() -> None:
    loader = Loader(MACHINE, quiet(errors={"pressure_bar": 0.0}))
    signals = loader.begin(1, approach_m=7.0)
    assert signals.toe_m == pytest.approx(7.0, abs=1e-6)
    assert signals.tilt_bar == pytest.approx(23.0, abs=0.2)
    assert signals.bucket_rad == pytest.approx(-0.81, abs=0.02)
    assert not loader.truth.contact


def test_lowering_onto_the_floor_raises_the_tilt_pressure() -> None:
    loader = Loader(MACHINE, quiet(floor={"high_chance": 1.0, "high_m": (0.15, 0.15)}))
    signals = loader.begin(1)
    free = signals.tilt_bar
    assert free == pytest.approx(MACHINE.digging.tilt_free_bar)
    while signals.tilt_bar < 23.0:
        signals = loader.step(Pedals(0.0, -0.3), STEP_S)
        assert signals.now_ns < 5e9
    assert loader.truth.lip_z_m < 0.0
    for _ in range(50):
        signals = loader.step(Pedals(0.0, -0.3), STEP_S)
    assert signals.tilt_bar > 50.0


def test_the_scan_is_late_and_the_tachometer_slips() -> None:
    loader = Loader(MACHINE, quiet(errors={"scan_lag_s": 0.1}))
    loader.begin(1)
    speeds, found = {0: 0.0}, []
    for _ in range(150):
        signals = loader.step(Pedals(0.5), STEP_S)
        speeds[signals.now_ns] = loader.truth.speed_mps
        if np.isfinite(signals.scan_mps):
            assert 0.1e9 <= signals.now_ns - signals.scan_ns <= 0.16e9
            assert signals.scan_mps == pytest.approx(speeds[signals.scan_ns], abs=1e-9)
            found.append(signals.tacho_mps - signals.scan_mps)
    assert max(found) > 0.05  # the launch looks like slip: findings, E2


def test_noise_is_as_the_file_says() -> None:
    loader = Loader(MACHINE, ground_of(errors={"tacho_mps": 0.01, "pressure_bar": 4.0}, floor={"bumps_per_m": 0.0}))
    loader.begin(1, approach_m=30.0)
    for _ in range(300):
        loader.step(Pedals(0.5), STEP_S)
    heard = [loader.step(Pedals(0.5), STEP_S) for _ in range(500)]
    assert np.std([one.tacho_mps for one in heard]) == pytest.approx(0.01, rel=0.2)
    assert np.std([one.transmission_bar for one in heard]) == pytest.approx(4.0, rel=0.2)
    assert np.std([one.scan_mps for one in heard[::3]]) == pytest.approx(0.03, rel=0.25)


def test_spikes_of_the_floor_meet_a_pressed_lip_only() -> None:
    bumpy = {"bumps_per_m": 4.0, "bump_factor": 8.0}
    pressed = Loader(MACHINE, quiet(floor=bumpy))
    high = Loader(MACHINE, quiet(floor={**bumpy, "high_chance": 1.0}))
    early = [charged(one, one.begin(2), most_s=6.0).transmission_bar for one in (pressed, high)]
    assert early[0] > 150.0 or pressed.truth.toe_m > 2.0
    assert early[1] < 60.0


def test_it_is_hundreds_of_times_faster_than_real_time() -> None:
    """With its sensors; the kernel alone has 3,000 on a free core. The best of five: what else runs makes it slower only."""
    loader = Loader(MACHINE, Grounds())
    charged(loader, loader.begin(1, approach_m=0.5))
    took_s = []
    for _ in range(5):
        begun = time.process_time()
        for _ in range(500):
            loader.step(Pedals(0.5, 0.2, 0.0, True), STEP_S)
        took_s.append(time.process_time() - begun)
    assert 500 * STEP_S / min(took_s) > 150.0

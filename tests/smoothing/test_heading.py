"""Heading from scans and gyroscope: better with a good one, never worse with a bad one."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.smoothing.heading import GyroNoise, Heading, Path, fused_heading, moves_of

PERIOD_S, SPEED_MPS = 0.1, 3.0
NOISE = GyroNoise.of(0.3, 10.0, 2.0)
REST_S = 60.0


def _drive(seed: int, rest_s: float = REST_S) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times (N,), the true path (N, 3) and the scans' of 400 s; the machine stands at first."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 400.0 + rest_s, PERIOD_S)
    moving = (t > rest_s).astype(float)
    rates = np.repeat(rng.uniform(-0.1, 0.1, -(-len(t) // 60)), 60)[: len(t)] * moving
    true_rad = np.cumsum(rates) * PERIOD_S
    drift = math.radians(0.02) * math.sqrt(SPEED_MPS * PERIOD_S) * np.cumsum(moving * rng.standard_normal(len(t)))
    scans_rad = true_rad + drift
    return t, _path(true_rad, moving), _path(scans_rad, moving)


def _path(heading_rad: FloatArray, moving: FloatArray) -> FloatArray:
    step = SPEED_MPS * PERIOD_S * moving
    return np.column_stack([np.cumsum(step * np.cos(heading_rad)), np.cumsum(step * np.sin(heading_rad)), heading_rad])


def _gyro(t: FloatArray, true_rad: FloatArray, seed: int, bias_deg_h: float = 5.0, walk_deg: float = 0.3) -> FloatArray:
    rng = np.random.default_rng([seed, 1])
    noise = math.radians(walk_deg) / 60.0 * math.sqrt(PERIOD_S) * np.cumsum(rng.standard_normal(len(t)))
    turned = true_rad + math.radians(bias_deg_h) / 3600.0 * t + noise
    return np.column_stack([turned, np.zeros(len(t))])


def _errors_deg(bad: Callable[[FloatArray, FloatArray], FloatArray] | None = None) -> tuple[float, float]:
    """Return mean errors at the end of eight drives: by scans alone, with the gyroscope."""
    alone, both = [], []
    for seed in range(8):
        t, true, scans = _drive(seed)
        gyro = _gyro(t, true[:, 2], seed)
        if bad is not None:
            gyro[:, 0] = bad(t, gyro[:, 0])
        found = fused_heading(Path((t * 1e9).astype(np.int64), scans), gyro, NOISE)
        turned = found.turned_rad if isinstance(found, Heading) else np.zeros(len(t))
        alone.append(abs(scans[-1, 2] - true[-1, 2]))
        both.append(abs(scans[-1, 2] + turned[-1] - true[-1, 2]))
    return math.degrees(float(np.mean(alone))), math.degrees(float(np.mean(both)))


def test_a_good_one_halves_the_error() -> None:
    alone, both = _errors_deg()
    assert both < 0.5 * alone


@pytest.mark.parametrize(
    "bad",
    [
        lambda t, g: np.zeros_like(g),
        lambda t, g: -g,
        lambda t, g: 57.3 * g,
        lambda t, g: np.where(t > 200.0, g[2000], g),
        lambda t, g: g + math.radians(1.0) * t,
        lambda t, g: g + 0.2 * (t > 300.0),
        lambda t, g: g + np.cumsum(0.02 * np.random.default_rng(5).standard_normal(len(g))),
        lambda t, g: np.full_like(g, math.nan),
    ],
    ids=["zero", "sign", "degrees", "frozen", "bias", "jump", "noise", "nothing"],
)
def test_a_bad_one_never_makes_it_worse(bad: Callable[[FloatArray, FloatArray], FloatArray]) -> None:
    alone, both = _errors_deg(bad)
    assert both <= 1.05 * alone + 0.005


def test_the_bias_is_learned_at_rest() -> None:
    t, true, scans = _drive(3, rest_s=120.0)
    found = fused_heading(Path((t * 1e9).astype(np.int64), scans), _gyro(t, true[:, 2], 3, 80.0), NOISE)
    assert isinstance(found, Heading)
    assert math.degrees(found.bias_rps) * 3600.0 == pytest.approx(
        80.0, abs=3.5 * math.degrees(found.bias_std_rps) * 3600.0
    )
    assert math.degrees(found.bias_std_rps) * 3600.0 < 3.0


def test_what_is_not_known_of_the_turn_is_the_scans() -> None:
    t, true, scans = _drive(1)
    gyro = _gyro(t, true[:, 2], 1)
    gyro[2000:, 0] += 1.0
    gyro[2000:, 1] += 5.0  # a gap of five seconds
    found = fused_heading(Path((t * 1e9).astype(np.int64), scans), gyro, NOISE)
    assert isinstance(found, Heading)
    assert found.left_out == 0.0
    assert np.abs(np.diff(found.turned_rad)).max() < math.radians(0.1)


def test_the_way_follows_the_heading() -> None:
    t, true, scans = _drive(2)
    moves = moves_of(Path((t * 1e9).astype(np.int64), scans), true[:, 2] - scans[:, 2])
    moved = np.array([se2.compose(move, pose) for move, pose in zip(moves, scans, strict=True)])
    assert np.hypot(*(moved - true)[:, :2].T).max() < 0.1
    assert np.hypot(*(scans - true)[:, :2].T).max() > 0.3

"""Weighing against known fills, many times: a bucket that rocks, a boom that swings, errors that no waiting takes away.

Rocking at 1 to 2 Hz with a damping of 4 to 10 %, begun at 3 to 20 % of the pressure; the boom at 3 to 5 Hz with a third of
that; noise of 1.5 bar. Static, by their 1 sigma: zero of the sensor 0.6 bar, load centre 2 % of the load, boom's angle 0.012 rad
(1 % of a fill), friction of the cylinders 1.2 bar. All assumed: loading findings, section 7.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from lhdmap.loading.signals import Signals
from lhdmap.loading.weighing import Weighing
from lhdmap.loading.weighing_settings import WeighingSettings

_TICK_NS = 20_000_000
_PER_BAR, _OFFSET = 0.0207, 1.0774
_LIFT_RPS = 0.1


Swing = tuple[float, float, float, float]
"""Share of the pressure, frequency (Hz), damping, phase."""


class Draw(NamedTuple):
    """A bucket and what disturbs its weighing."""

    fill: float
    swings: tuple[Swing, ...]
    zero_bar: float
    friction_bar: float
    centre: float
    angle: float

    def pressure_bar(self, since_s: float, *, fill: float | None = None) -> float:
        """Return the pressure so long after the lift stopped."""
        held = (self.fill if fill is None else fill) * (1.0 + self.centre) + self.angle
        still = (held + _OFFSET) / _PER_BAR
        swing = sum(
            share * math.exp(-damping * 2.0 * math.pi * hz * since_s) * math.cos(2.0 * math.pi * hz * since_s + phase)
            for share, hz, damping, phase in self.swings
        )
        return still * (1.0 + swing) + self.zero_bar + self.friction_bar


def drawn(rng: np.random.Generator, *, static: bool) -> Draw:
    """Return a bucket; `static`: with the errors that no waiting takes away."""
    amplitude = float(rng.uniform(0.03, 0.20))

    def swing(share: float, low_hz: float, high_hz: float) -> Swing:
        hz, damping, phase = rng.uniform((low_hz, 0.04, 0.0), (high_hz, 0.10, 6.28)).tolist()
        return share, hz, damping, phase

    swings = swing(amplitude, 1.0, 2.0), swing(amplitude / 3.0, 3.0, 5.0)
    zero, friction, centre, angle = (static * rng.standard_normal(4) * (0.6, 1.2, 0.02, 0.01)).tolist()
    return Draw(float(rng.uniform(0.3, 1.1)), swings, zero, friction, centre, angle)


class Found(NamedTuple):
    """Weighings: error of the fill (N,), its deviation as told (N,), time to settle (N,), share that never settled."""

    error: np.ndarray
    told: np.ndarray
    settling_s: np.ndarray
    unsettled: float


def weigh_all(settings: WeighingSettings, count: int, seed: int, *, static: bool = True, tare: bool = False) -> Found:
    """Weigh many buckets."""
    rng, rows = np.random.default_rng(seed), []
    for _ in range(count):
        draw = drawn(rng, static=static)
        tare_bar = None
        if tare:
            tare_bar = draw.pressure_bar(1e3, fill=0.0) - draw.friction_bar + 0.3 * float(rng.standard_normal())
        result = weighed(settings, draw, rng, tare_bar)
        rows.append((result[0] - draw.fill, *result[1:]))
    error, told, settling_s, settled = np.array(rows).T
    return Found(error, told, settling_s, 1.0 - float(settled.mean()))


def weighed(
    settings: WeighingSettings, draw: Draw, rng: np.random.Generator, tare_bar: float | None
) -> tuple[float, float, float, bool]:
    """Return fill, deviation, time to settle and whether it has, of one weighing from a boom at its lower stop."""
    weighing = Weighing(settings, tare_bar)
    boom_rad, now_ns, stopped_ns = settings.boom_rad - settings.below_rad, 1_000_000_000, 0
    while weighing.result is None:
        since_s = (now_ns - stopped_ns) * 1e-9 if stopped_ns else 0.0
        lift_bar = draw.pressure_bar(since_s) + 1.5 * float(rng.standard_normal())
        turn = weighing.step(Signals(now_ns, 0.0, 0.0, now_ns, 0.0, boom_rad, 0.0, 0.0, 50.0, lift_bar, 23.0))
        boom_rad += _LIFT_RPS * turn.pedals.lift * 0.02
        stopped_ns = 0 if turn.pedals.lift else stopped_ns or now_ns
        now_ns += _TICK_NS
    one = weighing.result
    return one.fill, one.fill_std, one.settling_s, one.settled


def line(name: str, found: Found) -> str:
    """Return a line of the table."""
    return (
        f"| {name} | {100.0 * found.error.mean():+.1f} | {100.0 * found.error.std():.2f} | {100.0 * found.told.mean():.1f} "
        f"| {np.median(found.settling_s):.1f} / {np.quantile(found.settling_s, 0.95):.1f} | {100.0 * found.unsettled:.1f} |"
    )


def rows(count: int) -> list[str]:
    """Return the lines of the table."""
    settings = WeighingSettings()
    mean = replace(settings, method="mean")
    return [
        line("sinusoid, all errors", weigh_all(settings, count, 1)),
        line("the same with a tare", weigh_all(settings, count, 1, tare=True)),
        line("sinusoid, noise and swings alone", weigh_all(settings, count, 2, static=False)),
        line("mean, all errors", weigh_all(mean, count, 1)),
        line("mean, noise and swings alone", weigh_all(mean, count, 2, static=False)),
    ]

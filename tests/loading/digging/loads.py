"""Loads on the simulated ground, attempt after attempt, with the controllers of lhdmap.loading: shared by the figures.

An attempt: charge until the touch is told, dig until a stop, tilt back while reversing, judge the fill. A touch told before the
lip has met the pile is counted as early, and the machine goes back for another try; one that is not told in time is counted,
and the dig begins.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lhdmap.loading.charge import Charge
from lhdmap.loading.digging_settings import ChargingSettings
from lhdmap.loading.excavation import DigSettings, excavation_of
from lhdmap.loading.signals import Pedals, Signals
from lhdmap.machine import Machine
from lhdmap.simulation.ground.loader import Loader
from lhdmap.simulation.ground.sections import load_ground

TICK_S = 0.02
CHARGE_LIMIT_S, DIG_LIMIT_S = 15.0, 30.0
FORCE_N = 40e3
_MOST_EARLY = 8


@dataclass(frozen=True)
class Plan:
    """What is tried: method and detector, settings, when a load ends (fill, its error), attempts at most, length of run-up."""

    method: str = "paper"
    detector: str = "paper"
    dig: DigSettings = field(default_factory=DigSettings)
    charging: ChargingSettings = field(default_factory=ChargingSettings)
    ground: str = "default"
    stop_fill: float = 0.90
    stop_std: float = 0.05
    most: int = 6
    approach_m: float = 7.0
    forced: bool = False


class Charged(NamedTuple):
    """A charge: touches told too early, whether none was told, delays from the first touch and from 40 kN."""

    early: int
    none: bool
    touch_s: float
    force_s: float
    length_s: float
    cause: str


class Dug(NamedTuple):
    """An attempt: its charge, length of the dig, why it ended, fill after it, slip and rear axle in the air in the dig."""

    charge: Charged
    duration_s: float
    ended: str
    fill: float
    slip_s: float
    rear_up_s: float
    lifts: int
    advance_m: float
    back_offs: float = 0.0
    rack_s: float = 0.0


@functools.cache
def loader_on(ground: str) -> Loader:
    """Return a machine on a ground: the name of one that ships, or a file."""
    return Loader(Machine(), load_ground(Path(ground) if ground.endswith(".toml") else ground))


def run_load(plan: Plan, seed: int) -> list[Dug]:
    """Return the attempts of the load of a seed."""
    loader = loader_on(plan.ground)
    rng = np.random.default_rng([seed, 77])
    found: list[Dug] = []
    signals = loader.begin(seed, approach_m=plan.approach_m)
    early = 0
    while True:
        charge, signals = charged(loader, plan, signals)
        if charge.early and early < _MOST_EARLY:
            early += 1
            signals = loader.retry(approach_m=plan.approach_m)
            continue
        charge, early = charge._replace(early=early), 0
        found.append(dug(loader, plan, signals, charge))
        seen = found[-1].fill + plan.stop_std * rng.standard_normal()
        if len(found) >= plan.most or (seen >= plan.stop_fill and not plan.forced):
            return found
        signals = loader.retry(approach_m=plan.approach_m)


def charged(loader: Loader, plan: Plan, signals: Signals) -> tuple[Charged, Signals]:
    """Charge until the touch is told."""
    control = Charge(plan.charging, plan.detector)
    control.begin(signals)
    touched_s, forced_s = math.nan, math.nan
    steps = round(CHARGE_LIMIT_S / TICK_S)
    for step in range(steps):
        turn = control.step(signals)
        truth = loader.truth
        now_s = step * TICK_S
        touched_s = now_s if math.isnan(touched_s) and truth.rock_n > 0.0 else touched_s
        forced_s = now_s if math.isnan(forced_s) and truth.rock_n > FORCE_N else forced_s
        if turn.ended:
            return Charged(
                int(math.isnan(touched_s)), False, now_s - touched_s, now_s - forced_s, now_s, turn.ended
            ), signals
        signals = loader.step(turn.pedals, TICK_S)
    return Charged(0, True, math.nan, math.nan, CHARGE_LIMIT_S, ""), signals


def dug(loader: Loader, plan: Plan, signals: Signals, charge: Charged) -> Dug:
    """Dig, tilt back while reversing."""
    control = excavation_of(plan.dig, plan.method)
    control.begin(signals)
    before = loader.truth
    ended, lifts, was, length_s = "", 0, False, DIG_LIMIT_S
    values: dict[str, float] = {}
    for step in range(round(DIG_LIMIT_S / TICK_S)):
        turn = control.step(signals)
        values = dict(turn.values)
        lifts += turn.pedals.lift > 0.0 and not was
        was = turn.pedals.lift > 0.0
        if turn.ended:
            ended, length_s = turn.ended, step * TICK_S
            break
        signals = loader.step(turn.pedals, TICK_S)
    after = loader.truth
    rack_s = racked(loader)
    return Dug(
        charge, length_s, ended, loader.truth.fill, after.slip_s - before.slip_s, after.rear_up_s - before.rear_up_s,
        lifts, values["advance_m"], values.get("back_offs", 0.0), rack_s,
    )  # fmt: skip


def racked(loader: Loader) -> float:
    """Tilt back, then reverse: the bucket leaves the pile racked. Return the time until it was, s."""
    needed_s = math.nan
    for step in range(45):
        signals = loader.step(Pedals(propel=0.0 if step < 15 else -0.5, tilt=1.0, full_rpm=True), 0.1)
        if math.isnan(needed_s) and signals.bucket_rad > -0.03:
            needed_s = 0.1 * step
    return 4.5 if math.isnan(needed_s) else needed_s


def with_paper(plan: Plan, **changes: object) -> Plan:
    """Return the plan with other numbers of the paper's law."""
    return replace(plan, dig=plan.dig._replace(paper=replace(plan.dig.paper, **changes)))  # type: ignore[arg-type]


def with_common(plan: Plan, **changes: object) -> Plan:
    """Return the plan with other numbers of `[excavation]`."""
    return replace(plan, dig=plan.dig._replace(excavation=replace(plan.dig.excavation, **changes)))  # type: ignore[arg-type]

"""Weighing in the loop: dig on the simulated ground, reverse, shake, weigh; with the empty bucket weighed before, or not."""

from __future__ import annotations

import numpy as np
from lhdmap.loading.digging_settings import ExcavationSettings
from lhdmap.loading.shake import Shake
from lhdmap.loading.signals import Controller, Pedals, Signals
from lhdmap.loading.weighing import Weighing
from lhdmap.loading.weighing_settings import WeighingSettings
from lhdmap.simulation.ground.loader import Loader
from tests.loading.digging.loads import TICK_S, Plan, charged, dug, loader_on

from tools.evaluate.loading_weighing import Found

_LONGEST = 3000


def weigh_in_loop(plan: Plan, first: int, count: int, *, tare: bool) -> Found:
    """Weigh after the first dig of loads of consecutive seeds."""
    settings, loader, rows = WeighingSettings(), loader_on(plan.ground), []
    for seed in range(first, first + count):
        weighing = Weighing(settings)
        if tare:
            stepped(loader, weighing, loader.begin(seed, approach_m=plan.approach_m))
            weighing.tare_bar = weighing.result.pressure_bar if weighing.result else None
        charge, signals = charged(loader, plan, loader.begin(seed, approach_m=plan.approach_m))
        dug(loader, plan, signals, charge)
        signals = loader.step(Pedals(brake=True), TICK_S)
        stepped(loader, weighing, stepped(loader, Shake(settings, ExcavationSettings()), signals))
        one = weighing.result
        if one is not None:
            rows.append((one.fill - loader.truth.fill, one.fill_std, one.settling_s, one.settled))
    error, told, settling_s, settled = np.array(rows, dtype=float).T
    return Found(error, told, settling_s, 1.0 - float(settled.mean()))


def stepped(loader: Loader, controller: Controller, signals: Signals) -> Signals:
    """Step a controller to its end."""
    controller.begin(signals)
    for _ in range(_LONGEST):
        turn = controller.step(signals)
        if turn.ended:
            break
        signals = loader.step(turn.pedals, TICK_S)
    return signals

"""A machine, a mine's ground, and the paper's law of digging, for tests."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from lhdmap.loading.signals import Pedals, Signals
from lhdmap.machine import Machine
from lhdmap.simulation.ground.loader import Loader
from lhdmap.simulation.ground.sections import Grounds
from lhdmap.simulation.ground.truth import Truth

MACHINE = Machine()
STEP_S = 0.02


def ground_of(**sections: dict[str, Any]) -> Grounds:
    """Return the default ground with some values of its sections changed."""
    ground = Grounds()
    return replace(ground, **{name: replace(getattr(ground, name), **values) for name, values in sections.items()})


def quiet(**sections: dict[str, Any]) -> Grounds:
    """Return a ground without boulders, bumps, wet floors, high lips and sensor noise."""
    calm: dict[str, dict[str, Any]] = {
        "rock": {"boulders_per_m": (0.0, 0.0), "noise": 0.0},
        "filling": {"boulder_chance": 0.0},
        "floor": {"bumps_per_m": 0.0, "high_chance": 0.0, "wet_chance": 0.0, "friction": (0.6, 0.6)},
        "errors": {
            "tacho_mps": 0.0,
            "scan_mps": 0.0,
            "pressure_bar": 0.0,
            "lift_bar": 0.0,
            "joint_rad": 0.0,
            "toe_m": 0.0,
        },
        "hydraulic": {"tilt_spread": 0.0},
    }
    for name, values in sections.items():
        calm[name] = {**calm.get(name, {}), **values}
    return ground_of(**calm)


def charged(loader: Loader, signals: Signals, *, most_s: float = 15.0) -> Signals:
    """Drive into the pile until the transmission says 300 bar."""
    for _ in range(round(most_s / STEP_S)):
        signals = loader.step(Pedals(0.5), STEP_S)
        if signals.transmission_bar > 300.0:
            break
    return signals


def dug(loader: Loader, signals: Signals, *, tilting_s: float = 1.0, pushing_s: float = 0.7) -> Truth:
    """Dig by ramps of tilt between pushes until the bucket is racked, or for 30 s."""
    signals, began = charged(loader, signals), loader.truth
    start_ns, changed_ns, tilting = signals.now_ns, signals.now_ns, True
    while (
        signals.bucket_rad < -0.03 and signals.now_ns - start_ns < 30e9 and loader.truth.lip_x_m - began.lip_x_m < 2.5
    ):
        since = (signals.now_ns - changed_ns) * 1e-9
        signals = loader.step(Pedals(0.5, min(1.2 * since, 1.0) if tilting else 0.0, 0.0, not tilting), STEP_S)
        if since > (tilting_s if tilting else pushing_s):
            tilting, changed_ns = not tilting, signals.now_ns
    return loader.truth

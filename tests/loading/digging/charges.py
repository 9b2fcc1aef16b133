"""Detection of the pile on mixed charges: right, early, none, delays; each detector on the same charges."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from lhdmap.loading.digging_settings import ChargingSettings
from lhdmap.machine import Machine
from lhdmap.simulation.ground.loader import Loader
from lhdmap.simulation.ground.sections import Grounds, load_ground

from tests.loading.digging.loads import Charged, Plan, charged

MIX = {"clean": 0.15, "bumps": 0.30, "wet": 0.20, "pressed hard": 0.15, "lip high": 0.20}
"""Shares of what disturbs a charge: spikes of the floor (1 per metre), a wet floor, 60 bar of press, a lip 5 to 15 cm high."""


@dataclass(frozen=True)
class Charges:
    """What one detector made of charges, by what disturbed them."""

    name: str
    rows: list[tuple[str, Charged]] = field(default_factory=list)

    def share(self, what: str, kind: str = "") -> float:
        """Return the share of charges that were `right`, `early`, `none`."""
        rows = [one for disturbed, one in self.rows if not kind or disturbed == kind]
        hits = [
            one.early > 0 if what == "early" else one.none if what == "none" else not (one.early or one.none)
            for one in rows
        ]
        return float(np.mean(hits)) if hits else float("nan")

    def delays_s(self, since: str) -> np.ndarray:
        """Return the delays of those that were right, `touch_s` or `force_s`."""
        values = np.array([getattr(one, since) for _, one in self.rows if not (one.early or one.none)])
        return values[np.isfinite(values)]


@functools.cache
def disturbed(ground: str, kind: str, toe_m: float) -> Grounds:
    """Return the ground on which a kind of charge takes place; `toe_m`: error of the toe, 0: that of the mine's file."""
    base = load_ground(ground)
    base = replace(base, errors=replace(base.errors, toe_m=toe_m or base.errors.toe_m))
    calm = replace(base.floor, wet_chance=0.0, high_chance=0.0, bumps_per_m=0.0)
    changes: dict[str, dict[str, Any]] = {
        "bumps": {"bumps_per_m": 1.0},
        "wet": {"wet_chance": 1.0},
        "pressed hard": {"press_bar": 60.0, "bumps_per_m": base.floor.bumps_per_m},
        "lip high": {"high_chance": 1.0},
    }
    return replace(base, floor=replace(calm, **changes.get(kind, {})))


def kind_of(number: int, count: int) -> str:
    """Return the kind of the charge of a number, the mix being in order."""
    at, most = (number + 0.5) / count, 0.0
    for kind, share in MIX.items():
        most += share
        if at < most:
            return kind
    return list(MIX)[-1]


def charge_all(
    name: str, detector: str, settings: ChargingSettings, seeds: Sequence[int], toe_m: float = 0.0
) -> Charges:
    """Return what a detector makes of the charges of these seeds."""
    loaders = {kind: Loader(Machine(), disturbed("default", kind, toe_m)) for kind in MIX}
    found = Charges(name)
    for number, seed in enumerate(seeds):
        kind = kind_of(number, len(seeds))
        approach_m = 5.0 + 5.0 * float(np.random.default_rng([seed, 5]).random())
        plan = Plan(detector=detector, charging=settings, approach_m=approach_m)
        loader = loaders[kind]
        found.rows.append((kind, charged(loader, plan, loader.begin(seed, approach_m=approach_m))[0]))
    return found


def line(found: Charges) -> str:
    """Return a line of the table."""
    touch, force = found.delays_s("touch_s"), found.delays_s("force_s")
    kinds = " | ".join(f"{100.0 * found.share('right', kind):.0f}" for kind in MIX)
    delays = " | ".join(
        f"{np.median(each):.2f} / {np.quantile(each, 0.95):.2f}" if len(each) else "-" for each in (touch, force)
    )
    shares = " | ".join(f"{100.0 * found.share(what):.1f}" for what in ("right", "early", "none"))
    return f"| {found.name} | {shares} | {kinds} | {delays} |"

"""Calibrate a mine's ground: random search over its settings against Tables 3 to 5 of the loading paper.

    python -m tools.evaluate.grounds judge datasets/grounds/default.toml 200
    python -m tools.evaluate.grounds search SEED CANDIDATES LOADS OUT.jsonl [BEGIN.jsonl]

The controller is the paper's law as printed in Fig. 19, with `else if` (findings: as printed S_push lasts one tick), a guard of
1.5 s at the launch and 0.03 rad of tolerance at the bucket's stop.
"""

from __future__ import annotations

import json
import math
import sys
from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lhdmap.loading.signals import Pedals, Signals
from lhdmap.machine import load_machine
from lhdmap.simulation.ground.loader import Loader
from lhdmap.simulation.ground.sections import Grounds, load_ground

_STEP_S, _PEDAL, _APPROACH_M = 0.02, 0.5, 3.0
_PAPER = {
    "fill 1": (0.62, 0.03), "fill 2": (0.77, 0.04), "fill 3": (0.82, 0.04), "fill 4": (0.90, 0.04),
    "reach 2": (0.70, 0.08), "reach 3": (0.57, 0.09), "reach 4": (0.20, 0.07), "attempts": (2.47, 0.17),
    "dig 1": (12.7, 1.5), "dig 2": (10.2, 0.6), "dig 3": (10.8, 0.7), "dig 4": (10.7, 1.2),
    "final": (0.906, 0.015), "in time": (0.99, 0.02),
}  # fmt: skip
_RANGES = {
    "rock.hardness": (1.0, 4.0), "rock.hardness_sigma": (0.5, 1.2), "rock.loosened": (0.75, 1.0), "rock.loosening": (3.0, 8.0),
    "rock.rake_factor": (1.2, 3.0), "rock.fee_scale": (0.2, 0.6), "rock.tensile_kpa": (8.0, 28.0),
    "face.slide_per_s": (3.0, 20.0), "face.lateral_share": (0.0, 0.5), "filling.entering": (0.84, 0.98),
    "filling.level_share": (0.6, 0.85), "filling.heap": (1.1, 1.4), "filling.boulder_chance": (0.03, 0.07),
    "hydraulic.tilt_factor": (0.75, 1.05), "operator.stop_fill": (0.76, 0.88),
}  # fmt: skip


class Dig(NamedTuple):
    """One attempt: whether the charge ended at the pile, fill after it, time of the digging (s), why it ended."""

    right: bool
    fill: float
    dig_s: float
    ended: str


class Skid:
    """Eq. (7): over a window of a second, the largest speed at least 0.2 m/s."""

    def __init__(self) -> None:
        self._falling: deque[tuple[int, float]] = deque()

    def __call__(self, signals: Signals) -> float:
        scan = 0.0 if math.isnan(signals.scan_mps) else signals.scan_mps
        now, fastest = signals.now_ns, max(signals.tacho_mps, scan)
        while self._falling and self._falling[-1][1] <= fastest:
            self._falling.pop()
        self._falling.append((now, fastest))
        while self._falling[0][0] < now - 1_000_000_000:
            self._falling.popleft()
        return (signals.tacho_mps - scan) / max(0.2, self._falling[0][1])


def attempt(loader: Loader, signals: Signals) -> Dig:
    """Charge and dig once."""
    skid, begun = Skid(), signals.now_ns
    while True:
        slipping, since = skid(signals), (signals.now_ns - begun) * 1e-9
        if since > 15.0 or (since > 1.5 and (slipping > 0.5 or signals.transmission_bar > 300.0)):
            break
        signals = loader.step(Pedals(_PEDAL), _STEP_S)
    if loader.truth.toe_m > 0.15:
        return Dig(False, loader.truth.fill, 0.0, "early" if since <= 15.0 else "none")
    dig_s, ended = dig(loader, signals, skid)
    while signals.bucket_rad < -0.01 and dig_s < 60.0:
        before, signals = signals.bucket_rad, loader.step(Pedals(0.0, 1.0, 0.0, True), 0.1)
        if abs(signals.bucket_rad - before) < 1e-3:
            signals = loader.step(Pedals(-0.5, 1.0, 0.0, True), 0.1)
    return Dig(True, loader.truth.fill, dig_s, ended)


def dig(loader: Loader, signals: Signals, skid: Skid) -> tuple[float, str]:
    """Dig by Fig. 19 and return the time it took and what ended it."""
    begun = changed = signals.now_ns
    tilting, start = True, signals.travel_m
    while True:
        since, here, slipping = (signals.now_ns - changed) * 1e-9, (signals.now_ns - begun) * 1e-9, skid(signals)
        if signals.boom_rad >= 0.5 or signals.bucket_rad >= -0.03:
            return here, "stop"
        if signals.travel_m - start >= 2.0 or here > 30.0:
            return here, "way" if here <= 30.0 else "time"
        if tilting:
            pedals = Pedals(_PEDAL, min(1.2 * since, 1.0))
            tilting = since <= 1.0
            changed = changed if tilting else signals.now_ns
        else:
            pedals = Pedals(_PEDAL, 0.0, 1.0 if slipping >= 0.2 else 0.0, True)
            tilting = (signals.transmission_bar > 300.0 and since > 0.5) or since > 1.0
            changed = signals.now_ns if tilting else changed
        signals = loader.step(pedals, _STEP_S)


def load(loader: Loader, seed: int, approach_m: float) -> list[Dig]:
    """Load once: attempts until the operator says so; early triggers are among them."""
    rng, operator = np.random.default_rng([seed, 5]), loader.ground.operator
    signals, digs = loader.begin(seed, approach_m=approach_m), list[Dig]()
    while len(digs) < 12:
        digs.append(attempt(loader, signals))
        seen = digs[-1].fill + operator.stop_sigma * rng.standard_normal()
        if digs[-1].right and (seen >= operator.stop_fill or sum(d.right for d in digs) >= operator.most_attempts):
            break
        signals = loader.retry(approach_m=approach_m)
    return digs


def figures(loads: list[list[Dig]]) -> dict[str, float]:
    """Return the figures of the paper's tables for these loads."""
    right = [[one for one in digs if one.right] for digs in loads]
    out: dict[str, float] = {}
    for k in range(4):
        here = [digs[k] for digs in right if len(digs) > k]
        out[f"reach {k + 1}"] = len(here) / len(loads)
        out[f"fill {k + 1}"] = float(np.mean([one.fill for one in here])) if here else math.nan
        out[f"dig {k + 1}"] = float(np.mean([one.dig_s for one in here])) if here else math.nan
        last = [digs[-1].fill for digs in right if len(digs) == k + 1]
        out[f"final {k + 1}"] = float(np.mean(last)) if last else math.nan
    times = np.array([one.dig_s for digs in right for one in digs])
    out["attempts"] = float(np.mean([len(digs) for digs in right]))
    out["final"] = float(np.mean([digs[-1].fill for digs in right if digs]))
    out["in time"] = float(np.mean((times >= 6.0) & (times <= 20.0)))
    out["right"] = sum(map(len, right)) / sum(map(len, loads))
    return out


def loss(found: dict[str, float]) -> float:
    """Return the mean squared miss, each in its tolerance; a figure that is none counts as three of them."""
    misses = [(found[name] - value) / sigma for name, (value, sigma) in _PAPER.items()]
    return float(np.mean([9.0 if math.isnan(miss) else min(miss * miss, 25.0) for miss in misses]))


def varied(ground: Grounds, values: dict[str, float]) -> Grounds:
    """Return a ground with some values changed, by `section.name`."""
    for key, value in values.items():
        section, name = key.split(".")
        ground = replace(ground, **{section: replace(getattr(ground, section), **{name: value})})
    return ground


def judge(ground: Grounds, count: int, first_seed: int, approach_m: float = 7.0) -> dict[str, float]:
    """Return the figures of `count` loads."""
    loader = Loader(load_machine(), ground)
    return figures([load(loader, first_seed + i, approach_m) for i in range(count)])


def search(seed: int, candidates: int, count: int, out: Path, known: Path | None) -> None:
    """Draw grounds, and around the best of them ever closer; a line of JSON for each. `known`: begin at the best of these."""
    rng, best = np.random.default_rng(seed), list[tuple[float, dict[str, float]]]()
    if known is not None:
        rows = [json.loads(line) for line in known.read_text(encoding="utf-8").splitlines()]
        best = [(math.inf, row["values"]) for row in sorted(rows, key=lambda row: float(row["loss"]))[:6]]
    for turn in range(candidates):
        values = {key: float(rng.uniform(*both)) for key, both in _RANGES.items()}
        if known is not None and turn < 6:
            values = best[turn][1] if turn < len(best) else values
        elif known is not None or turn >= candidates // 3:
            _, near = best[int(rng.integers(min(5, len(best))))]
            for key, (low, high) in _RANGES.items():
                step = 0.12 * (high - low) * float(rng.standard_normal()) * (rng.random() < 0.5)
                values[key] = float(np.clip(near[key] + step, low, high))
        found = judge(varied(Grounds(), values), count, 10_000 + 1000 * seed, _APPROACH_M)
        best = sorted([*best, (loss(found), values)], key=lambda one: one[0])[: 8 + 6 * (turn < 6)]
        with out.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps({"loss": loss(found), "values": values, "figures": found}) + "\n")


def main() -> None:
    if sys.argv[1] == "judge":
        found = judge(load_ground(Path(sys.argv[2])), int(sys.argv[3]), 50_000)
        for name, value in found.items():
            print(f"{name:10} {value:6.3f}", *(f"paper {_PAPER[name][0]}" for _ in range(name in _PAPER)))
        print(f"loss {loss(found):.2f}")
    else:
        known = Path(sys.argv[6]) if len(sys.argv) > 6 else None
        search(int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]), Path(sys.argv[5]), known)


if __name__ == "__main__":
    main()

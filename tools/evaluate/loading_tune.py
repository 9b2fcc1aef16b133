"""Random search for the numbers of `paper-tuned` and of `adaptive`, with the same budget and the same loads.

    python -m tools.evaluate.loading_tune adaptive OUT.jsonl [--ground NAME] [--seed N]

Three rounds: all draws on few loads, the best of them on more, the best of those on many; loads of a round are not those of the
one before, and all of them are seeds below 1000, which no figure uses.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from tests.loading.digging.loads import Dug, Plan, run_load

ROUNDS = ((120, range(10)), (16, range(100, 130)), (4, range(200, 280)))
"""Candidates and loads of each round."""
Range = tuple[float, float]
_SHARED: dict[str, Range] = {"boom_max_rad": (0.4, 0.8), "advance_max_m": (2.0, 5.0), "pedal": (0.45, 1.0)}
PAPER: dict[str, Range] = {
    **_SHARED, "ramp_per_s": (0.4, 4.0), "skid_max": (0.05, 0.5), "phase_max_s": (0.3, 2.0), "phase_min_s": (0.05, 0.6),
    "pressure_max_bar": (200.0, 420.0), "hysteresis": (0.0, 0.1), "lift_least_s": (0.0, 0.4),
}  # fmt: skip
ADAPTIVE: dict[str, Range] = {
    **_SHARED, "pedal_slipping": (0.4, 1.0), "force_kn": (50.0, 170.0), "force_range_kn": (20.0, 200.0),
    "advance_mps": (-0.05, 0.4), "advance_range_mps": (0.05, 1.0), "skid_max": (0.05, 0.5), "hysteresis": (0.0, 0.1),
    "lift_least_s": (0.0, 0.4), "skid_smooth_s": (0.0, 0.4), "stuck_s": (0.5, 1.5), "back_off_s": (0.4, 1.2),
}  # fmt: skip


def plan_of(method: str, numbers: dict[str, Any], ground: str) -> Plan:
    """Return the plan of a candidate."""
    plan = Plan(method, "fused", ground=ground, approach_m=3.0)
    if method == "paper-tuned":
        return replace(plan, dig=plan.dig._replace(tuned=replace(plan.dig.tuned, **numbers)))
    return replace(plan, dig=plan.dig._replace(excavation=replace(plan.dig.excavation, **numbers)))


def loss(loads: Sequence[Sequence[Dug]]) -> dict[str, float]:
    """Return what is made small, and what it is made of; per load."""
    digs = [dig for load in loads for dig in load]
    count = len(loads)
    found = {
        "attempts": len(digs) / count,
        "first": float(np.mean([load[0].fill for load in loads])),
        "dig_s": sum(dig.duration_s for dig in digs) / count,
        "slip_s": sum(dig.slip_s for dig in digs) / count,
        "time_outs": sum(not dig.ended for dig in digs) / len(digs),
    }
    found["loss"] = found["attempts"] + 0.04 * found["dig_s"] + 0.4 * found["slip_s"] + 8.0 * found["time_outs"]
    return found


def search(method: str, ground: str, seed: int, out: Path) -> dict[str, Any]:
    """Return the best candidate; all are written to `out`."""
    rng = np.random.default_rng(seed)
    ranges = PAPER if method == "paper-tuned" else ADAPTIVE
    candidates = [
        {name: round(float(rng.uniform(*span)), 3) for name, span in ranges.items()} for _ in range(ROUNDS[0][0])
    ]
    results: list[dict[str, Any]] = []
    with out.open("w", encoding="utf-8") as file:
        for number, (most, seeds) in enumerate(ROUNDS):
            results = []
            for numbers in candidates[:most]:
                loads = [run_load(plan_of(method, numbers, ground), one) for one in seeds]
                results.append({"round": number, **loss(loads), "numbers": numbers})
                file.write(json.dumps(results[-1]) + "\n")
                file.flush()
            results.sort(key=lambda one: float(one["loss"]))
            candidates = [one["numbers"] for one in results]
    return results[0]


def main() -> int:
    """Search, print the best."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("method", choices=("paper-tuned", "adaptive"))
    parser.add_argument("out", type=Path)
    parser.add_argument("--ground", default="default")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    print(json.dumps(search(asked.method, asked.ground, asked.seed, asked.out), indent=1))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

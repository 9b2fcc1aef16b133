"""Guidance alone in planar tunnels, many times: `python -m tools.evaluate.guidance --runs 20 --json OUT.json`.

Each run draws a tunnel, a direction, a load and errors of the machine (pose noise 1 cm and 0.1 degrees, joint offset 0.5 degrees,
steering gain +-5 %, lags +-10 %, the route off by 0.15 m) from its seed.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from lhdmap.config import settings_from
from tests.guidance.drawn_drives import CLASSES, Row, row_of


def summary(name: str, rows: list[Row]) -> str:
    """Return a line of the table."""
    least, mean = [row.least_m for row in rows], [row.mean_kmh for row in rows if row.arrived and not row.load_kg]
    loaded = [row.mean_kmh for row in rows if row.arrived and row.load_kg]
    return (
        f"| {name} | {len(rows)} | {sum(r.arrived for r in rows)} | {sum(r.contact for r in rows)} "
        f"| {np.median(least):.3f} / {min(least):.3f} | {_mean(mean):.2f} / {_mean(loaded):.2f} "
        f"| {max(r.top_kmh for r in rows):.1f} | {_mean([r.acd for r in rows]):.5f} | {_mean([r.asd for r in rows]):.4f} "
        f"| {np.median([r.work_ms for r in rows]):.1f} / {max(r.work_p99_ms for r in rows):.1f} |"
    )


def _mean(values: list[float]) -> float:
    return float(np.mean(values)) if values else math.nan


def main() -> int:
    """Run the classes; print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seeds", type=int, nargs="+", help="these instead")
    parser.add_argument("--only", default="")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="changed")
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    chosen = {f"guidance.{one.split('=')[0]}": json.loads(one.split("=")[1]) for one in asked.changed}
    settings = replace(settings_from(chosen).guidance)
    every: dict[str, list[Row]] = {}
    for name, kind in CLASSES.items():
        if asked.only and name not in asked.only.split(";"):
            continue
        rows = every[name] = []
        for seed in asked.seeds or range(asked.first, asked.first + asked.runs):
            row, _ = row_of(kind, seed, settings)
            rows.append(row)
            if row.contact or not row.arrived:
                print("  ", row, file=sys.stderr, flush=True)
            if asked.json:
                asked.json.write_text(json.dumps({key: [asdict(row) for row in done] for key, done in every.items()}))
        print(summary(name, rows), flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

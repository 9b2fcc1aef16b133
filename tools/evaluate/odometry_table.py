"""The issue's table of figures of the planar odometry, measured and written to `evaluation/odometry.md` and `.json`.

python -m tools.evaluate.odometry_table [--quick] [--only NAME ...]
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from tools.evaluate import odometry_pairs as single
from tools.evaluate import odometry_rows as rows
from tools.evaluate import odometry_straight
from tools.evaluate.figures import Figure, number, write

HEADING = """\
# Planar odometry: figures

Written by `python -m tools.evaluate.odometry_table`; not edited by hand. Simulated planar drifts (half width 2 m, bends of
12 m and 9 m radius, a cross drift, 150 m driven), scanner of 190°, 12 mm noise unless said otherwise; {seeds} worlds that no
setting was chosen on. Errors are means over all segments of the length, starting each half metre; single worlds in the last
column. CPU times are of one core of the machine that made the table, which other work shared.
"""
RESULT = Path(__file__).resolve().parents[2] / "evaluation" / "odometry.md"


def sections(seeds: tuple[int, ...], *, quick: bool) -> dict[str, Callable[[], Iterator[Figure]]]:
    """Return the measurements by name."""
    streams = ((0.5, 25.0),) if quick else ((0.5, 50.0), (0.5, 25.0), (0.25, 25.0))
    return {
        "anchored": lambda: rows.anchored(seeds, streams),
        "range-flow": lambda: rows.range_flow(seeds),
        "disturbed": lambda: rows.disturbed(seeds),
        "sweep": lambda: rows.sweep(seeds),
        "smooth": lambda: rows.smooth(seeds),
        "straight": lambda: odometry_straight.straight(odometry_straight.SEEDS[: 2 * len(seeds)]),
        "pairs": lambda: single.pairs(seeds),
        "rotation": lambda: single.rotation_gain(seeds),
        "cold": lambda: single.cold_start(seeds),
        "time": single.time_a_scan,
        "peers": lambda: single.peer_rows(seeds),
    }


def main(words: list[str] | None = None) -> int:
    """Measure, print each figure as it comes, write the table when all was measured; 1 where a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one world, one stream")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these sections alone; nothing is written")
    parser.add_argument("--seeds", nargs="+", type=int, default=list(rows.SEEDS), help="worlds")
    options = parser.parse_args(words)
    seeds = tuple(options.seeds[:1] if options.quick else options.seeds)
    figures: list[Figure] = []
    for name, measure in sections(seeds, quick=options.quick).items():
        if options.only and name not in options.only:
            continue
        started = time.monotonic()
        for figure in measure():
            figures.append(figure)
            verdict = {None: "", True: "ok", False: "MISSED"}[figure.ok]
            target = f"(<= {figure.target:g})" if figure.target is not None else ""
            print(
                f"{verdict:7} {figure.name}: {number(figure.measured)} {figure.unit} {target} {figure.note}", flush=True
            )
        print(f"        {name}: {time.monotonic() - started:.0f} s", flush=True)
    if not options.only and not options.quick:
        write(RESULT, HEADING.format(seeds=len(seeds)), figures)
    return 1 if any(figure.ok is False for figure in figures) else 0


if __name__ == "__main__":
    sys.exit(main())

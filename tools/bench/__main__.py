"""Speed and memory of lhdmap, written to `evaluation/bench.md`: python -m tools.bench [--quick]."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from tools.bench.landmarks import landmark_figures
from tools.bench.movement import movement_figures
from tools.bench.replay import replay_figures
from tools.bench.rockbreaker import rockbreaker_figures
from tools.bench.runs import build_figures, simulate, startup_figures
from tools.bench.stages import reading_figure, stage_figures
from tools.evaluate.figures import Figure, number, write

RESULT = Path(__file__).resolve().parents[2] / "evaluation" / "bench.md"
HEADING = """\
# Speed and memory

Written by `python -m tools.bench` (`make bench`); not edited by hand. Stages: CPU time of one core on a simulated drive at 12 km/h
and 25 Hz, each scan processed; a fixed piece of work, timed in between, makes the figures of two machines comparable.
`build-map` runs in a process of its own with all its threads, start-up included, numba's code compiled before. The machine had
{cores} cores and other work on them.
"""


def measure(durations_s: tuple[float, ...]) -> Iterator[Figure]:
    """Measure everything; simulate the drives first."""
    yield from startup_figures()
    stages = list(stage_figures())
    yield from stages
    yield from movement_figures()
    yield from landmark_figures()
    yield from rockbreaker_figures(10_000 if durations_s[-1] > 60.0 else 1_000)
    yield from replay_figures()
    with tempfile.TemporaryDirectory() as folder:
        logs = [simulate(Path(folder), duration_s) for duration_s in durations_s]
        yield reading_figure(logs[0], stages[0].measured)
        yield from build_figures(logs, Path(folder))


def main(words: list[str] | None = None) -> int:
    """Measure, print, write the table; 1 where a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="drives of 10 s and 30 s; nothing is written")
    options = parser.parse_args(words)
    figures = []
    for figure in measure((10.0, 30.0) if options.quick else (60.0, 180.0)):
        figures.append(figure)
        verdict = {None: "", True: "ok", False: "MISSED"}[figure.ok]
        print(f"{verdict:7} {figure.name}: {number(figure.measured)} {figure.unit} {figure.note}", flush=True)
    if not options.quick:
        write(RESULT, HEADING.format(cores=os.cpu_count()), figures)
    return 1 if any(figure.ok is False for figure in figures) else 0


if __name__ == "__main__":
    sys.exit(main())

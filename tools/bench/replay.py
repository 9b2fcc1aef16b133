"""CPU time of the closed loop: a machine drives itself through a mine, two scanners at 25 Hz, guidance at 20 Hz, on one core.

python -m tools.bench.replay [MAP]          # by process; MAP: of the mine `level`, taught first where absent
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from lhdmap.replay.assemble import Run, Watchers, assemble, parts_of
from lhdmap.replay.journal import Journal
from lhdmap.replay.process import Process
from lhdmap.replay.processes.film import Film
from lhdmap.replay.processes.film_drive import DriveFilm
from lhdmap.replay.scenario import Scenario
from lhdmap.settings_tree import tree_from
from lhdmap.simulation.history import SECOND_NS, START_NS

from tools.evaluate.figures import Figure

_GROUP = "Closed loop: a drive in the mine `level`, CPU time of one core in per cent of the simulated time, warm"
_DRIVE = {"kind": "tram", "mine": "level", "seed": 5, "goal": "DP3"}
_BEGIN_S, _END_S = 4.0, 36.0
TARGET = 3.0
"""Times real time: the whole loop with simulator and recording of the film."""


class _Spent:
    """CPU time by process."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def watch(self, process: Process) -> None:
        """Time all turns of a process from now on."""
        inner = process.step

        def step(now_ns: int, inbox: Sequence[Any]) -> Iterable[Any]:
            began = time.process_time()
            said = list(inner(now_ns, inbox))
            self.seconds[process.name] = self.seconds.get(process.name, 0.0) + time.process_time() - began
            return said

        setattr(process, "step", step)  # noqa: B010  # a process of this run alone


def replay_figures(known: str = "") -> Iterator[Figure]:
    """Measure a stretch of a drive after its start: the first scene of the mine is made once, whatever the drive's length."""
    with tempfile.TemporaryDirectory() as folder:
        scenario = tree_from(Scenario, {**_DRIVE, "map": known})
        parts = parts_of(scenario, Path(folder))
        assert parts.autonomous is not None
        film = Film(parts.machine, drive=DriveFilm(parts.autonomous.known.topology))
        run = assemble(scenario, parts, Journal(), Watchers(film))
        begun_s = _until(run, _BEGIN_S)
        spent = _Spent()
        for slot in run.engine._slots:  # noqa: SLF001  # nobody else may see them
            spent.watch(slot.process)
        all_s, before_s = _until(run, _END_S), (run.engine.now_ns - START_NS) / SECOND_NS
    span_s = before_s - _BEGIN_S
    yield Figure(_GROUP, "first seconds, with the mine's surface", begun_s, "s", None, f"{_BEGIN_S:.0f} s of the drive")
    yield Figure(_GROUP, "whole loop", 100.0 * all_s / span_s, "%", 100.0 / TARGET, f"{span_s / all_s:.1f} × real time")
    for name, seconds in sorted(spent.seconds.items(), key=lambda one: -one[1]):
        yield Figure(_GROUP, name, 100.0 * seconds / span_s, "%", None, "")


def _until(run: Run, end_s: float) -> float:
    """Run up to a time (s); return the CPU time that it took."""
    began = time.process_time()
    for _ in run.engine.run(START_NS + round(end_s * SECOND_NS)):
        if run.monitor.ended:
            break
    return time.process_time() - began


if __name__ == "__main__":
    for figure in replay_figures(*sys.argv[1:2]):
        print(f"{figure.name}: {figure.measured:.1f} {figure.unit} {figure.note}", flush=True)

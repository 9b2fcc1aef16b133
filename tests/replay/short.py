"""Drives in the mine `short`, a drift of 46 m with a bend, which is taught once a session."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lhdmap.config import Settings
from lhdmap.replay.assemble import Run, Watchers, assemble, parts_of
from lhdmap.replay.journal import Event, Journal
from lhdmap.replay.processes.film import Film
from lhdmap.replay.scenario import Scenario
from lhdmap.settings_tree import tree_from
from lhdmap.simulation.history import START_NS


def tram(folder: Path, **table: Any) -> Scenario:
    """Return a scenario in the mine `short`, whose map is in a folder."""
    given = {
        "mine": "short",
        "map": str(folder / "short.map"),
        "start": "P1",
        "goal": "OP1",
        "seed": 1,
    }
    return tree_from(Scenario, {**given, **table})


def drive(told: Scenario, folder: Path, *, for_s: float = 60.0, path: Path | None = None, withhold_truth: bool = False,
          after_s: float = 0.0) -> tuple[Run, list[Event]]:  # fmt: skip
    """Run a scenario, `after_s` longer than the monitor wants; return the run and its journal."""
    journal, events = Journal(path), list[Event]()
    journal.listeners.append(events.append)
    parts = parts_of(told, folder, Settings())
    run = assemble(told, parts, journal, Watchers(Film(parts.machine)), withhold_truth=withhold_truth)
    ended_s: float | None = None
    for now_ns in run.engine.run(START_NS + round(for_s * 1e9)):
        at_s = (now_ns - START_NS) * 1e-9
        ended_s = at_s if run.monitor.ended and ended_s is None else ended_s
        if ended_s is not None and at_s >= ended_s + after_s:
            break
    run.engine.finish()
    journal.close()
    return run, events

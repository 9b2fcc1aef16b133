"""Short runs of the doubles."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lhdmap.replay.assemble import Run, Watchers, assemble
from lhdmap.replay.journal import Event, Journal
from lhdmap.replay.parts import Parts
from lhdmap.replay.process import Process
from lhdmap.replay.processes.film import Film
from lhdmap.replay.scenario import Scenario
from lhdmap.settings_tree import tree_from
from lhdmap.simulation.history import START_NS


def scenario(**table: Any) -> Scenario:
    """Return a scenario without perception unless it is asked for."""
    return tree_from(Scenario, {"mine": "corridor", "perception": False, **table})


def go(
    told: Scenario,
    parts: Parts,
    *,
    more: Sequence[Process] = (),
    path: Path | None = None,
    withhold_truth: bool = False,
    for_s: float = 60.0,
) -> tuple[Run, list[Event]]:
    """Run until the monitor has seen enough; return the run and its journal."""
    journal, events = Journal(path), list[Event]()
    journal.listeners.append(events.append)
    watchers = Watchers(Film(parts.machine), more=more)
    run = assemble(told, parts, journal, watchers, withhold_truth=withhold_truth)
    for _ in run.engine.run(START_NS + round(for_s * 1e9)):
        if run.monitor.ended:
            break
    run.engine.finish()
    journal.close()
    return run, events

"""A machine that fills its bucket in closed loop: perception, task, guidance, executor, machine, ground."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from lhdmap.config import Settings
from lhdmap.errors import UsageError
from lhdmap.loading.states import State
from lhdmap.replay.assemble import Run, Watchers, assemble, parts_of
from lhdmap.replay.journal import Event, Journal
from lhdmap.replay.processes.film import Film
from lhdmap.replay.processes.film_load import LoadFilm
from lhdmap.replay.scenario import Scenario
from lhdmap.settings_tree import tree_from
from lhdmap.simulation.history import START_NS

WATCH = ("monitor", "engine", "faults")
WAY = [
    State.IDENTIFICATION,
    State.POSITIONING,
    State.CHARGING,
    State.EXCAVATION,
    State.PULL_BACK,
    State.WEIGHING,
    State.DONE,
]


def scenario(**more: Any) -> Scenario:
    return tree_from(Scenario, {"kind": "loading", "mine": "stope", "start": "DP1", "seed": 1, **more})


def drive(told: Scenario, for_s: float, *, withhold_truth: bool = False) -> tuple[Run, list[Event], LoadFilm]:
    journal, events = Journal(None), list[Event]()
    journal.listeners.append(events.append)
    parts = parts_of(told, Path("unused"), Settings())
    film = LoadFilm(parts.machine.drive.payload_kg)
    run = assemble(told, parts, journal, Watchers(Film(parts.machine, load=film)), withhold_truth=withhold_truth)
    for _ in run.engine.run(START_NS + round(for_s * 1e9)):
        if run.monitor.ended:
            break
    run.engine.finish()
    return run, events, film


@pytest.fixture(scope="module")
def once() -> tuple[Run, list[Event], LoadFilm]:
    return drive(scenario(), 200.0)


def test_the_bucket_is_filled_and_weighed_without_a_contact(once: tuple[Run, list[Event], LoadFilm]) -> None:
    run, events, film = once
    assert run.monitor.tally.reason == "done"
    assert run.monitor.tally.touched.count == 0
    verdict = run.monitor.verdict()
    assert verdict["fill_true"] > 0.6
    assert verdict["fill"] == pytest.approx(verdict["fill_true"], abs=4.0 * 0.035)  # four deviations of the weighing
    assert verdict["charges"] == verdict["attempts"]
    assert verdict["early_triggers"] == 0
    states = [one.after for one in events if one.process == "loading" and one.event == "state"]
    assert states[: len(WAY) - 1] == WAY[:-1]
    assert states[-1] == State.DONE
    assert film.data().column("fill_true")[-1] == pytest.approx(verdict["fill_true"], abs=0.02)


def test_truth_is_not_needed_and_the_journal_is_the_same(once: tuple[Run, list[Event], LoadFilm]) -> None:
    for_s = 20.0
    run, events, _ = drive(scenario(), for_s, withhold_truth=True)
    assert run.monitor.tally.drive.distance_m == 0.0
    until_ns = START_NS + round(for_s * 1e9)
    seen, withheld = (
        [one for one in each if one.process not in WATCH and one.t_ns < until_ns] for each in (once[1], events)
    )
    assert withheld == seen
    assert State.POSITIONING in [one.after for one in withheld if one.process == "loading"]


@pytest.mark.parametrize("start", ["P1", "nowhere"])
def test_only_draw_points_can_be_loaded_at(start: str) -> None:
    with pytest.raises(UsageError, match="draw point"):
        parts_of(scenario(start=start), Path("unused"))

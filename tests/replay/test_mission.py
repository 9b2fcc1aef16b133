"""A mission in closed loop, up to the bucket in the pile: the map is kept beside the tests, as teaching it takes minutes."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from lhdmap.config import Settings
from lhdmap.haulage.records import Phase
from lhdmap.loading.states import State
from lhdmap.messages import FloatArray
from lhdmap.replay.assemble import Run, Watchers, assemble, parts_of
from lhdmap.replay.journal import Event, Journal
from lhdmap.replay.processes.film import Film
from lhdmap.replay.scenario import Scenario
from lhdmap.report.replay_data import COLUMNS
from lhdmap.settings_tree import tree_from
from lhdmap.simulation.history import START_NS

KEPT = Path(__file__).parent / "kept" / "cycle.map"
FOR_S = 60.0


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, list[Event], FloatArray]:
    """A machine that leaves its park with a mission, until its bucket digs."""
    folder = tmp_path_factory.mktemp("mission")
    shutil.copytree(KEPT, folder / "cycle.map")
    table = {
        "kind": "mission",
        "mine": "cycle",
        "map": str(folder / "cycle.map"),
        "start": "P1",
        "seed": 1,
        "mission": [{"from": "DP1", "to": "OP1"}],
    }
    told = tree_from(Scenario, table)
    journal, events = Journal(), list[Event]()
    journal.listeners.append(events.append)
    parts = parts_of(told, folder, Settings())
    film = Film(parts.machine)
    run = assemble(told, parts, journal, Watchers(film))
    for now_ns in run.engine.run(START_NS + round(FOR_S * 1e9)):
        digs_ns = next((one.t_ns for one in events if one.after == State.EXCAVATION.value), now_ns)
        if run.judges.ended or now_ns - digs_ns > 300_000_000:  # the monitor has its turn, too
            break
    run.engine.finish()
    return run, events, film.series.rows()


def states(events: list[Event], process: str) -> list[str]:
    return [one.after for one in events if one.process == process and one.event == "state"]


def test_it_drives_to_its_draw_point_and_digs(drive: tuple[Run, list[Event], FloatArray]) -> None:
    run, events, _ = drive
    assert not run.judges.ended, run.judges.reason
    phases = states(events, "mission")
    assert phases[0] in (Phase.IDLE, Phase.ROUTE, Phase.TRAM)
    assert phases[-2:] == [Phase.TRAM, Phase.LOAD]
    loading = [one for one in states(events, "loading") if one != State.IDLE]
    assert loading[0] == State.IDENTIFICATION
    assert loading[-1] == State.EXCAVATION


def test_the_pile_is_found_while_it_rolls_and_nothing_is_touched(drive: tuple[Run, list[Event], FloatArray]) -> None:
    run, events, rows = drive
    found = next(one for one in events if one.process == "loading" and one.before == State.IDENTIFICATION)
    speed_mps = np.interp((found.t_ns - START_NS) * 1e-9, rows[:, 0], rows[:, COLUMNS.index("speed_mps")])
    assert speed_mps > 0.5
    assert run.monitor.tally.touched.contacts == []
    assert run.monitor.tally.drive.distance_m > 40.0


def test_the_truth_is_where_the_pile_is(drive: tuple[Run, list[Event], FloatArray]) -> None:
    run, _, _ = drive
    assert run.monitor.load is not None
    told = run.monitor.load.verdict()
    assert (told["charges"], told["early_triggers"]) == (1, 0)

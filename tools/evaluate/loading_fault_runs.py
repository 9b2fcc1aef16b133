"""What `loading_faults` drives: a run in which nothing is wrong, and at moments of it copies that have a fault.

A copy is a child of this process (`fork`): it goes on from the very state of the run, so the way there is driven once.
"""

from __future__ import annotations

import os
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from lhdmap.config import Settings
from lhdmap.driving.model import DriveModel, drive_model
from lhdmap.loading.states import ASSISTANCE, RESTING, State
from lhdmap.loading.task import limits_s
from lhdmap.loading.task_settings import LoadingSettings
from lhdmap.messages import FloatArray
from lhdmap.replay.assemble import Run, Watchers, assemble, parts_of
from lhdmap.replay.journal import Event, Journal
from lhdmap.replay.processes.film import Film
from lhdmap.replay.processes.film_load import LoadFilm
from lhdmap.replay.scenario import Scenario
from lhdmap.simulation.history import SECOND_NS, START_NS
from lhdmap.simulation.sensing.faults import FaultSettings

from tools.evaluate.replay_faults import LIMIT_S, MOVES_MPS, NEEDED, Drive, stops_missed

PRESSURES = ("/machine/pressure/transmission", "/machine/pressure/lift", "/machine/pressure/tilt")
FOLLOWED_S = 12.0
"""So long a copy goes on after its fault."""
_STILL = {str(one) for one in (State.HELD, *RESTING)}
_HELPED = {str(one) for one in ASSISTANCE}
_LINK_S = 2.1  # `executor.link_lost_s`, and a sign of life
_ROLLS_S = 1.5  # dead time and the way to rest from 5 km/h


class Live(NamedTuple):
    """A run under way, with what is kept of it."""

    run: Run
    events: list[Event]
    drive: Drive
    model: DriveModel
    limits: LoadingSettings


def started(scenario: Scenario, settings: Settings) -> Live:
    """Return a run that is ready to go."""
    parts = parts_of(scenario, Path("unused"), settings)
    journal, events, drive = Journal(None), list[Event](), Drive()
    journal.listeners.append(events.append)
    film = Film(parts.machine, load=LoadFilm(parts.machine.drive.payload_kg))
    run = assemble(scenario, parts, journal, Watchers(film, more=[drive]))
    return Live(run, events, drive, drive_model(parts.machine, 0.0), settings.loading)


def moments(live: Live, for_s: float) -> Iterator[tuple[str, float]]:
    """Go on; yield ten times a second the state of the loading machine and how long it has lasted."""
    state, since_ns, seen = "", START_NS, 0
    for now_ns in live.run.engine.run(START_NS + round(for_s * SECOND_NS)):
        for one in live.events[seen:]:
            if one.process == "loading" and one.event == "state":
                state, since_ns = one.after, one.t_ns
        seen = len(live.events)
        yield state, (now_ns - since_ns) / SECOND_NS
        if live.run.monitor.ended:
            return


def in_a_copy(work: Callable[[], None]) -> None:
    """Do something in a copy of this process, and wait for it."""
    child = os.fork()
    if child == 0:
        try:
            work()
        except Exception:  # noqa: BLE001  # a copy must not go on as if it were the run
            traceback.print_exc()
        finally:
            os._exit(0)
    os.waitpid(child, 0)


def with_fault(live: Live, fault: FaultSettings) -> dict[str, Any]:
    """Give a run a fault now, go on, and say what came of it."""
    engine, begin_ns = live.run.engine, live.run.engine.now_ns
    before = len(live.events)
    live.run.faults.inject(fault, begin_ns)
    begin_s = (begin_ns - START_NS) / SECOND_NS
    for _ in engine.run(begin_ns + round((fault.duration_s + FOLLOWED_S) * SECOND_NS)):
        if live.run.monitor.ended:
            break
    engine.finish()
    fault = replace(fault, at_s=begin_s)
    return {"at_s": round(begin_s, 2), **_came(live, fault, live.events[before:])}


def _came(live: Live, fault: FaultSettings, later: Sequence[Event]) -> dict[str, Any]:
    tally, rows = live.run.monitor.tally, np.array(live.drive.rows)
    stopped_s, why = _first(later, _stops, fault.at_s)
    asked_s, asked = _first(later, lambda one: one.process == "loading" and one.after in _HELPED, fault.at_s)
    states = [one for one in later if one.process == "loading" and one.event == "state"]
    missed, worst = stops_missed(rows[rows[:, 0] >= fault.at_s], later, live.model)
    missed += _stale(fault, rows, live.events) + _too_long(live)
    missed += [f"contact: {one['body']}" for one in tally.touched.contacts]
    return {
        "stopped_after_s": stopped_s,
        "why": why,
        "asked_after_s": asked_s,
        "asked": asked,
        "ways": [one.after for one in states],
        "ended": tally.reason if tally.ended else "under way",
        "worst_stop": round(worst, 2),
        "clearance_m": round(float(tally.touched.clearance_m or 0.0), 3),
        "missed": missed,
    }


def _stops(one: Event) -> bool:
    """Return whether somebody stops the machine here: the watchdog, or the task."""
    watched = one.event == "watchdog: armed" and one.values.get("after") == "disarmed"
    told = one.process == "loading" and one.event == "state" and one.after in _STILL - {str(State.DONE)}
    return watched or (told and one.before not in _HELPED)


def _first(events: Sequence[Event], wanted: Callable[[Event], bool], at_s: float) -> tuple[float | None, str]:
    for one in events:
        if wanted(one):
            return round((one.t_ns - START_NS) / SECOND_NS - at_s, 2), one.cause
    return None, ""


def _stale(fault: FaultSettings, rows: FloatArray, events: Sequence[Event]) -> list[str]:
    """Return whether the machine moves although a signal, or the link, has been silent for too long.

    The task wants the pressures in all its states, whether it uses them or not; an operator who drives by hand does not.
    """
    silent = fault.kind in ("dead", "delayed", "link_lost") or (fault.kind == "frozen" and "lidar" in fault.target)
    if not silent or fault.target not in (*NEEDED, *PRESSURES, "link"):
        return []
    late_s = fault.at_s + (_LINK_S if fault.target == "link" else LIMIT_S) + _ROLLS_S
    times = rows[:, 0]
    moves = rows[(times > late_s) & (times < fault.at_s + fault.duration_s) & (np.abs(rows[:, 3]) > MOVES_MPS)]
    if fault.target in PRESSURES:
        moves = np.array([row for row in moves if _state_at(events, float(row[0])) not in _HELPED])
    return [f"{moves[0, 0]:.2f} s: moves without {fault.target} ({fault.kind})"] if len(moves) else []


def _state_at(events: Sequence[Event], at_s: float) -> str:
    found = ""
    for one in events:
        if one.process == "loading" and one.event == "state" and (one.t_ns - START_NS) / SECOND_NS <= at_s:
            found = one.after
    return found


def _too_long(live: Live) -> list[str]:
    """Return the states that lasted longer than they may."""
    limits = {str(state): limit for state, limit in limits_s(live.limits).items()}
    found, state, since_ns = [], "", START_NS
    for one in [*live.events, Event(live.run.engine.now_ns, "loading", "state")]:
        if one.process == "loading" and one.event == "state":
            lasted_s = (one.t_ns - since_ns) / SECOND_NS
            if lasted_s > limits.get(state, np.inf) + 0.1:
                found.append(f"{state} lasted {lasted_s:.1f} s")
            state, since_ns = one.after, one.t_ns
    return found

"""Records of cycles from a run folder's `journal.jsonl`, and what a mission writes into it.

The process `mission` notes each phase as a state (`values`: `place`, `odometer_m`) and each bucket as an event `cycle` (`values`:
the columns of a cycle). Of several machines the first one's processes have these names, those of the others begin with their
machine and a slash (`lhd2/mission`). A run without a mission has what navigation notes (drives, rests, help, lost
places) and the stops of the executor; its ways are not known.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from lhdmap.errors import InputError
from lhdmap.haulage.records import Cycle, Ledger, Phase

MISSION, NAVIGATION = "mission", "navigation"
_EXECUTOR, _ASKED_FOR = "executor: state", ("navigation", "queue")
_ALONE = "lhd"
_PHASES = {str(phase): phase for phase in Phase}
_OF_NAVIGATION = {
    "driving": Phase.TRAM, "resting": Phase.TRAM, "backing": Phase.TRAM, "planning": Phase.ROUTE, "halted": Phase.PLACE,
    "assistance": Phase.ASSISTANCE, "arrived": Phase.IDLE, "idle": Phase.IDLE,
}  # fmt: skip


def cycle_values(cycle: Cycle) -> dict[str, Any]:
    """Return the values of the event `cycle` of a finished cycle."""
    wanted = ("machine", "number", "load", "dump", "mass_t", "fill", "attempts", "slip")
    return {name: getattr(cycle, name) for name in wanted}


def cycles_of_journal(path: Path) -> list[Cycle]:
    """Return the cycles of a run, one machine after the other; the last one of each may not be finished.

    Raises:
        InputError: the file cannot be read, or is no journal.
    """
    events = list(_events(path))
    machines = list(dict.fromkeys(_machine(one) for one in events if _is_mission(one)))
    if not machines:
        return _cycles(events, _Navigated())
    end_ns = events[-1]["t_ns"]
    return [
        cycle
        for machine in machines
        for cycle in _cycles(_events_of(events, machine), _of_mission, _name(machine, len(machines)), end_ns)
    ]


def _machine(one: Mapping[str, Any]) -> str:
    """Return the machine that an event is of; empty: the first one."""
    return str(one["process"]).rpartition("/")[0]


def _is_mission(one: Mapping[str, Any]) -> bool:
    return str(one["process"]).rpartition("/")[2] == MISSION and one["event"] == "state"


def _name(machine: str, count: int) -> str:
    return machine or (_ALONE if count == 1 else f"{_ALONE}1")


def _events_of(events: Sequence[Mapping[str, Any]], machine: str) -> list[Mapping[str, Any]]:
    """Return the events of one machine as they would be if it were the only one."""
    return [{**one, "process": str(one["process"]).rpartition("/")[2]} for one in events if _machine(one) == machine]


def _events(path: Path) -> Iterator[Mapping[str, Any]]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a readable journal ({error})") from error
    for number, line in enumerate(lines, start=1):
        try:
            event = json.loads(line)
            if not isinstance(event["t_ns"], int) or not {"process", "event", "to", "cause", "values"} <= set(event):
                raise ValueError("keys are missing")
        except (ValueError, KeyError, TypeError) as error:
            if number == len(lines):
                return  # a run that was killed: its last line is cut
            raise InputError(f"{path}, line {number}: no line of a journal ({error})") from error
        yield event


Said = tuple[Phase, str, str]
"""Phase, place, cause."""


def _of_mission(one: Mapping[str, Any]) -> Said | None:
    """Return what an event of a mission says of the phase; None: nothing."""
    if one["process"] != MISSION or one["event"] != "state" or one["to"] not in _PHASES:
        return None
    return _PHASES[one["to"]], str(one["values"].get("place", "")), str(one["cause"])


class _Navigated:
    """The phases of a run without a mission: what navigation is at, and the stops of the executor that it did not ask for."""

    def __init__(self) -> None:
        self._drives: Said = (Phase.IDLE, "", "")
        self._stop: Said | None = None

    def __call__(self, one: Mapping[str, Any]) -> Said | None:
        """Return the phase after an event; None: it says nothing of it."""
        if one["process"] == NAVIGATION and one["event"] == "state" and one["to"] in _OF_NAVIGATION:
            self._drives = _OF_NAVIGATION[one["to"]], "", str(one["cause"])
        elif one["event"] == _EXECUTOR:
            self._stop = self._stopped(one["values"], str(one["cause"]))
        else:
            return None
        return self._stop if self._stop is not None and self._drives[0] == Phase.TRAM else self._drives

    def _stopped(self, values: Mapping[str, Any], cause: str) -> Said | None:
        """Return the stop after an event of the executor; one is what it was begun for, whatever is said while it lasts."""
        if values.get("after") == "driving":
            return None
        if values.get("before") != "driving":
            return self._stop
        if cause in _ASKED_FOR:
            return None
        return Phase.OBSTACLE if cause.startswith("guard") else Phase.STOPPED, "", cause


def _cycles(
    events: Sequence[Mapping[str, Any]],
    said: Callable[[Mapping[str, Any]], Said | None],
    machine: str = _ALONE,
    end_ns: int | None = None,
) -> list[Cycle]:
    """Return the cycles of one machine; `end_ns`: of the run, where that is later than its last event."""
    ledger, cycles, odometer_m = Ledger(), list[Cycle](), math.nan
    now: Said = (Phase.IDLE, "", "")
    for one in events:
        if one["process"] == MISSION:
            odometer_m = float(one["values"].get("odometer_m", odometer_m))
        following, ends = said(one), one["process"] == MISSION and one["event"] == "cycle"
        if following is not None or ends:
            now = following or now
            ledger.note(one["t_ns"], *now, odometer_m)
        if ends:
            cycles.append(_cycle({"machine": machine, **one["values"]}, ledger, finished=True))
    if events:
        ledger.note(events[-1]["t_ns"] if end_ns is None else end_ns, *now, odometer_m)
    rest = _cycle({"number": len(cycles) + 1, "machine": machine}, ledger, finished=False)
    return [*cycles, rest] if rest.intervals else cycles


def _cycle(values: Mapping[str, Any], ledger: Ledger, *, finished: bool) -> Cycle:
    def number(name: str) -> float:
        value = values.get(name)
        return math.nan if value is None else float(value)

    return Cycle(
        str(values.get("machine", _ALONE)),
        int(values.get("number", 0)),
        str(values.get("load", "")),
        str(values.get("dump", "")),
        ledger.take(),
        number("mass_t"),
        number("fill"),
        int(values.get("attempts") or 0),
        number("slip"),
        finished,
    )

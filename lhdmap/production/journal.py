"""Records of cycles from a run folder's `journal.jsonl`, and what a mission writes into it.

The process `mission` notes each phase as a state (`values`: `place`, `odometer_m`) and each bucket as an event `cycle` (`values`:
the columns of a cycle). A run without a mission has what navigation notes: drives, rests, help.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from lhdmap.errors import InputError
from lhdmap.haulage.records import Cycle, Ledger, Phase

MISSION, NAVIGATION, ENGINE = "mission", "navigation", "engine"
_OF_NAVIGATION = {
    "driving": Phase.TRAM, "resting": Phase.TRAM, "backing": Phase.TRAM, "planning": Phase.ROUTE, "halted": Phase.PLACE,
    "assistance": Phase.ASSISTANCE, "arrived": Phase.IDLE, "idle": Phase.IDLE,
}  # fmt: skip


def cycle_values(cycle: Cycle) -> dict[str, Any]:
    """Return the values of the event `cycle` of a finished cycle."""
    wanted = ("machine", "number", "load", "dump", "mass_t", "fill", "attempts", "slip")
    return {name: getattr(cycle, name) for name in wanted}


def cycles_of_journal(path: Path) -> list[Cycle]:
    """Return the cycles of a run; the last one may not be finished.

    Raises:
        InputError: the file cannot be read, or is no journal.
    """
    events = list(_events(path))
    if any(one["process"] == MISSION and one["event"] == "state" for one in events):
        return _cycles(events, MISSION, {str(phase): phase for phase in Phase})
    return _cycles(events, NAVIGATION, _OF_NAVIGATION)


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


def _cycles(events: Sequence[Mapping[str, Any]], process: str, phases: Mapping[str, Phase]) -> list[Cycle]:
    ledger, cycles, odometer_m, last = Ledger(), list[Cycle](), 0.0, (Phase.IDLE, "", "")
    for one in events:
        mine, now_ns, values = one["process"] == process, one["t_ns"], one["values"]
        if mine:
            odometer_m = float(values.get("odometer_m", odometer_m))
        if mine and one["event"] == "state" and one["to"] in phases:
            last = phases[one["to"]], str(values.get("place", "")), str(one["cause"])
            ledger.note(now_ns, *last, odometer_m)
        elif mine and one["event"] == "cycle":
            ledger.note(now_ns, *last, odometer_m)
            cycles.append(_cycle(values, ledger, finished=True))
    if events:
        ledger.note(events[-1]["t_ns"], *last, odometer_m)
    rest = _cycle({"number": len(cycles) + 1}, ledger, finished=False)
    return [*cycles, rest] if rest.intervals else cycles


def _cycle(values: Mapping[str, Any], ledger: Ledger, *, finished: bool) -> Cycle:
    def number(name: str) -> float:
        value = values.get(name)
        return math.nan if value is None else float(value)

    return Cycle(
        str(values.get("machine", "lhd")),
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

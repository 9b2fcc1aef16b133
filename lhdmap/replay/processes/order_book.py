"""What an executive says after each turn of its mission task, underground and on a surface site alike."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from lhdmap.haulage.mission_io import MissionInput, MissionOutput
from lhdmap.messages import Text
from lhdmap.production.journal import cycle_values
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import CYCLE, MISSION, ORDERS, Outgoing
from lhdmap.replay.processes.told import Orders


class Task(Protocol):
    """A mission task: of a machine alone, or of one in a fleet."""

    def update(self, given: MissionInput) -> MissionOutput:
        """Return what is asked for now."""
        ...


class OrderBook:
    """Writes what has come of a turn into the journal, and gives orders, each cycle that has ended, and how far the mission is."""

    def __init__(self, scribe: Scribe) -> None:
        self._scribe, self._mission = scribe, ""

    def say(self, now_ns: int, out: MissionOutput, orders: Orders, odometer_m: float) -> Iterator[Outgoing]:
        """Note a turn and yield what is to be sent."""
        self._note(out, odometer_m)
        yield Outgoing(ORDERS, orders)
        if out.cycle is not None:
            yield Outgoing(CYCLE, out.cycle)
        mission = said_of(out)
        if mission != self._mission:
            self._mission = mission
            self._scribe.event("mission", mission)
            yield Outgoing(MISSION, Text(now_ns, mission))

    def _note(self, out: MissionOutput, odometer_m: float) -> None:
        for event in out.events:
            self._scribe.event("event", event.value, task=out.task, left=out.left)
        values = {"place": out.place, "goal": out.goal, "odometer_m": odometer_m, "at": out.state.value}
        self._scribe.goes(out.phase.value, out.cause or out.asks, **values, stage=out.stage, left=out.left)
        if out.cycle is not None:
            self._scribe.event("cycle", "", odometer_m=odometer_m, **cycle_values(out.cycle))


def said_of(out: MissionOutput) -> str:
    """Return how far the mission is, as it is told on its topic."""
    if out.asks:
        return f"assistance: {out.asks}"
    if out.state.value == "aborted":
        return "aborted: mission"
    return "done" if out.left == 0 and out.state.value == "idle" and not out.goal else "driving"

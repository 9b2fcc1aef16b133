"""The scripted operator as a process: the only driver that sees the truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lhdmap.messages import Command, Text
from lhdmap.replay.journal import Scribe
from lhdmap.replay.parts import Operator
from lhdmap.replay.process import MACHINE, MILLISECOND_NS, MISSION, STATE, Outgoing, Process, Received
from lhdmap.roles import ROLES

DRIVER = "operator"
PERIOD_NS = 50 * MILLISECOND_NS
DRIVING, DONE = "driving", "done"


class Driver(Process):
    """Asks the operator for a command each 50 ms. Its journal has when he drives forwards, in reverse, and rests."""

    name, period_ns, priority = DRIVER, PERIOD_NS, 20
    reads = (STATE,)
    inbox_size = 64

    def __init__(self, operator: Operator, scribe: Scribe, *, site: str = MACHINE) -> None:
        self.site = site
        self._operator, self._scribe = operator, scribe
        self._mission = ""

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Give a command for the newest state, and say whether the route is driven."""
        if not inbox:
            return
        command = self._operator.command(inbox[-1].message, now_ns)
        if command is not None:
            self._note(command)
            yield Outgoing(ROLES["command"].topic, command)
        mission = DONE if self._operator.done else DRIVING
        if mission != self._mission:
            self._mission = mission
            self._scribe.event("mission", mission)
            yield Outgoing(MISSION, Text(now_ns, mission))

    def _note(self, command: Command) -> None:
        gear = "rest" if command.propel == 0.0 else "forward" if command.propel > 0.0 else "reverse"
        self._scribe.goes(gear, "route")

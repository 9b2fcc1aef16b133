"""Who attends a machine: the console over its link, a person at a terminal, or what was done in an earlier run."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from lhdmap.console.messages import COMMANDS, Ask, Command, Event, Outcome, Plan, Status
from lhdmap.errors import InputError

PROCESS, COMMAND = "station", "command"
"""Process and event of the lines of a journal that are commands."""


class Attendant(Protocol):
    """Gets what a machine says, gives what is commanded. A machine that nobody attends is not armed."""

    def shows(self, plan: Plan) -> None:
        """Take what the machine is drawn on."""
        ...

    def notes(self, event: Event) -> None:
        """Take something that happened."""
        ...

    def attend(self, now_ns: int, status: Status, request: Ask | None) -> Sequence[Command]:
        """Return what has been commanded since the last turn; called each 20 ms of the machine's time, and may wait for it."""
        ...

    def told(self, outcome: Outcome) -> None:
        """Take what became of a command."""
        ...


class Recorded:
    """Does what the journal of an earlier run says that was commanded, at the same moments: the run comes out the same."""

    def __init__(self, lines: Sequence[Mapping[str, Any]]) -> None:
        self._left = deque(
            (int(line["t_ns"]), _command_of(line["values"], line["cause"]))
            for line in lines
            if line["process"] == PROCESS and line["event"] == COMMAND
        )

    @classmethod
    def of(cls, path: Path) -> Recorded:
        """Read a journal.

        Raises:
            InputError: it cannot be read, or is none.
        """
        try:
            return cls([json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{path}: a journal.jsonl of a replay was wanted: {error}") from error

    def shows(self, plan: Plan) -> None:
        """Nobody looks."""

    def notes(self, event: Event) -> None:
        """Nobody looks."""

    def told(self, outcome: Outcome) -> None:
        """It is known."""

    def attend(self, now_ns: int, status: Status, request: Ask | None) -> Sequence[Command]:  # noqa: ARG002
        """Return what was commanded at this moment."""
        found = []
        while self._left and self._left[0][0] <= now_ns:
            found.append(self._left.popleft()[1])
        return found


def _command_of(values: Mapping[str, Any], cause: str) -> Command:
    command = Command(**values, cause=cause)
    if command.kind not in COMMANDS:
        raise ValueError(f"kind '{command.kind}' of a command")
    return command

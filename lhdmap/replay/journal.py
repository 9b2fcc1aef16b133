"""`journal.jsonl`: a line an event, the same to the bit for the same scenario and seed; nothing of the wall clock is in it."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lhdmap.simulation.history import START_NS

_DIGITS = 9  # of a figure: more than matters, fewer than what another processor may round otherwise


class Event(NamedTuple):
    """A line: who, what, from which state to which, why, and the figures that made it so."""

    t_ns: int
    process: str
    event: str
    before: str = ""
    after: str = ""
    cause: str = ""
    values: Mapping[str, Any] = {}

    def line(self) -> str:
        """Return the line as JSON."""
        keys = ("t_ns", "process", "event", "from", "to", "cause", "values")
        return json.dumps(dict(zip(keys, (*self[:6], _plain(self.values)), strict=True)), ensure_ascii=False)


Listener = Callable[[Event], None]


class Journal:
    """Writes events as they come; none is kept. `now_ns` is the time of the engine."""

    def __init__(self, path: Path | None = None) -> None:
        self.now_ns, self.lines = START_NS, 0
        self.listeners: list[Listener] = []
        self._hash = hashlib.sha256()
        self._file = None if path is None else path.open("wb")

    def write(self, process: str, event: str, **more: Any) -> None:
        """Write an event of now; `more` are `before`, `after`, `cause`, `values`."""
        one = Event(self.now_ns, process, event, **more)
        data = one.line().encode() + b"\n"
        self._hash.update(data)
        self.lines += 1
        if self._file is not None:
            self._file.write(data)
        for listener in self.listeners:
            listener(one)

    def listen(self, listener: Listener) -> None:
        """Tell a listener of each event from now on."""
        self.listeners.append(listener)

    def of(self, process: str) -> Scribe:
        """Return what a process writes with."""
        return Scribe(self, process)

    @property
    def sha256(self) -> str:
        """SHA-256 of all lines so far, which is that of the file."""
        return self._hash.hexdigest()

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()


class Scribe:
    """The journal as one process sees it, with the state that it is in."""

    def __init__(self, journal: Journal, process: str) -> None:
        self._journal, self._process, self.state = journal, process, ""

    def event(self, event: str, cause: str = "", **values: Any) -> None:
        """Note something that happened."""
        self._journal.write(self._process, event, cause=cause, values=values)

    def goes(self, state: str, cause: str = "", **values: Any) -> None:
        """Note a new state; the same one again is none."""
        if state != self.state:
            before, self.state = self.state, state
            self._journal.write(self._process, "state", before=before, after=state, cause=cause, values=values)


def _plain(value: Any) -> Any:
    """Return a value as it stands in a line: figures rounded, what is not finite null, order as given."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return _plain(value.tolist())
    if isinstance(value, float):
        return float(f"{value:.{_DIGITS}g}") + 0.0 if math.isfinite(value) else None  # + 0.0: no minus zero
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)

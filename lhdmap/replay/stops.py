"""Stops of a run from its journal: from when to when, why, and what watchdog and guard said meanwhile."""

from __future__ import annotations

from dataclasses import dataclass, field

from lhdmap.replay.journal import Event
from lhdmap.report.replay_data import StopRow
from lhdmap.simulation.history import SECOND_NS, START_NS

MOST = 500
_STATE, _SAYS = "executor: state", ("watchdog: ", "guard: ", "executor: emergency")
_DRIVING = "driving"


@dataclass
class _Open:
    """A stop that is not over yet."""

    from_ns: int
    speed_mps: float
    causes: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)


class Stops:
    """A listener of the journal; the first `MOST` stops are kept."""

    def __init__(self) -> None:
        self._rows: list[StopRow] = []
        self._open: _Open | None = None
        self._before: list[str] = []

    def __call__(self, event: Event) -> None:
        """Take an event."""
        if event.event == _STATE:
            self._state(event)
        elif event.event.startswith(_SAYS):
            self._hear(event)

    def rows(self) -> list[StopRow]:
        """Return the stops so far; the last one may not be over."""
        return self._rows + ([_row(self._open, None)] if self._open is not None else [])

    def _state(self, event: Event) -> None:
        before, after = event.values.get("before"), event.values.get("after")
        if after == _DRIVING:
            if self._open is not None and len(self._rows) < MOST:
                self._rows.append(_row(self._open, event.t_ns))
            self._open = None
        elif self._open is None and before == _DRIVING:
            self._open = _Open(event.t_ns, float(event.values.get("speed_mps", 0.0)), said=self._before)
        self._before = []
        if self._open is not None:
            _add(self._open.causes, event.cause)

    def _hear(self, event: Event) -> None:
        who = event.event.partition(":")[0]
        words = f"{who}: {event.cause}"
        if "free_m" in event.values and event.values.get("after") == "blocked":
            words += f" in {event.values['free_m']:.2f} m, stops in {event.values['stop_m']:.2f} m"
        if event.values.get("before") == event.values.get("after"):
            return  # refused: it stays as it is
        _add(self._before if self._open is None else self._open.said, words)


def _add(words: list[str], word: str) -> None:
    if word and word not in words and len(words) < 6:
        words.append(word)


def _row(one: _Open, until_ns: int | None) -> StopRow:
    from_s = (one.from_ns - START_NS) / SECOND_NS
    to_s = None if until_ns is None else (until_ns - START_NS) / SECOND_NS
    return StopRow(from_s, to_s, 3.6 * abs(one.speed_mps), "; ".join(one.causes), "; ".join(one.said))

"""The state machine of autonomous loading (Fig. 6 of the paper) as data: states, events, and what leads where.

Nothing in here knows a time, a signal or a machine: `event_of` picks the event of a moment from plain facts, `TABLE` says where
it leads. Both are small enough to be gone through in full (`tests/loading/task/test_states.py`) and to be drawn
(`lhdmap.loading.diagram`).
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple


class State(StrEnum):
    """The steps of Fig. 6, its two kinds of assistance, and what a machine needs beside them."""

    IDLE = "idle"
    IDENTIFICATION = "rock_pile_identification"
    POSITIONING = "positioning"
    CHARGING = "charging"
    EXCAVATION = "excavation"
    PULL_BACK = "pull_back"
    WEIGHING = "payload_weighing"
    POSITIONING_ASSISTANCE = "positioning_assistance"
    LOADING_ASSISTANCE = "loading_assistance"
    HELD = "held"
    DONE = "done"
    ABORTED = "aborted"
    EMERGENCY = "emergency_stop"


class Event(StrEnum):
    """What leads from a state to another."""

    MISSION = "mission"
    CANCELLED = "mission withdrawn"
    PILE_FOUND = "pile identified"
    PILE_UNKNOWN = "pile not identified in time"
    PILE_UNFIT = "pile not to be loaded"
    PLACED = "in position, bucket down"
    MISSED = "no steering angle lands on the pile"
    BLOCKED = "wall in the way"
    COLLISION = "collision detected"
    DUG = "bucket full or at its end"
    BACKED = "pulled back and shaken"
    AGAIN = "another attempt"
    ENOUGH = "enough, or no attempt pays"
    FAILED = "failed"
    TOO_LONG = "time limit"
    TAKEN_OVER = "operator took over"
    STOPPED = "disarmed, idle or blind"
    RESTORED_FREE = "valid again, bucket free"
    RESTORED_TOUCHED = "valid again, bucket in the pile"
    RESTORED_LOADED = "valid again, loaded by hand"
    EXPIRED_FREE = "not valid in time, bucket free"
    EXPIRED_TOUCHED = "not valid in time, bucket in the pile"
    ANSWERED = "operator says go on"
    ABORT = "operator aborts"
    UNANSWERED = "nobody answers"
    EMERGENCY = "emergency stop"
    RELEASED_IDLE = "armed again, no mission"
    RELEASED_FREE = "armed again, bucket free"
    RELEASED_TOUCHED = "armed again, bucket in the pile"


RESTING = frozenset({State.IDLE, State.DONE, State.ABORTED, State.EMERGENCY})
"""The machine stands, for as long as nobody wants anything else."""
ASSISTANCE = frozenset({State.POSITIONING_ASSISTANCE, State.LOADING_ASSISTANCE})
"""The task asks for nothing: an operator has the machine."""
MOVING = frozenset(State) - RESTING - ASSISTANCE - {State.HELD}
"""The states in which the task may move the machine."""
BEFORE_THE_PILE = frozenset({State.IDENTIFICATION, State.POSITIONING})
_AT_THE_PILE = MOVING - BEFORE_THE_PILE


def _table() -> dict[tuple[State, Event], State]:
    s, e = State, Event
    table = {
        (s.IDENTIFICATION, e.PILE_FOUND): s.POSITIONING,
        (s.IDENTIFICATION, e.PILE_UNKNOWN): s.POSITIONING_ASSISTANCE,
        (s.IDENTIFICATION, e.PILE_UNFIT): s.POSITIONING_ASSISTANCE,
        (s.POSITIONING, e.PLACED): s.CHARGING,
        (s.POSITIONING, e.MISSED): s.POSITIONING_ASSISTANCE,
        (s.POSITIONING, e.BLOCKED): s.POSITIONING_ASSISTANCE,
        (s.CHARGING, e.COLLISION): s.EXCAVATION,
        (s.EXCAVATION, e.DUG): s.PULL_BACK,
        (s.PULL_BACK, e.BACKED): s.WEIGHING,
        (s.WEIGHING, e.AGAIN): s.IDENTIFICATION,
        (s.WEIGHING, e.ENOUGH): s.DONE,
        (s.HELD, e.RESTORED_FREE): s.IDENTIFICATION,
        (s.HELD, e.RESTORED_TOUCHED): s.PULL_BACK,
        (s.HELD, e.RESTORED_LOADED): s.WEIGHING,
        (s.HELD, e.EXPIRED_FREE): s.POSITIONING_ASSISTANCE,
        (s.HELD, e.EXPIRED_TOUCHED): s.LOADING_ASSISTANCE,
        (s.EMERGENCY, e.RELEASED_IDLE): s.IDLE,
        (s.EMERGENCY, e.RELEASED_FREE): s.POSITIONING_ASSISTANCE,
        (s.EMERGENCY, e.RELEASED_TOUCHED): s.LOADING_ASSISTANCE,
    }
    for state in RESTING - {s.EMERGENCY}:
        table[state, e.MISSION] = s.IDENTIFICATION
    for state in MOVING:
        helped = s.POSITIONING_ASSISTANCE if state in BEFORE_THE_PILE else s.LOADING_ASSISTANCE
        table |= {(state, e.TOO_LONG): helped, (state, e.TAKEN_OVER): helped, (state, e.STOPPED): s.HELD}
    for state in _AT_THE_PILE:
        table[state, e.FAILED] = s.LOADING_ASSISTANCE
    for state in ASSISTANCE:
        table |= {(state, e.ANSWERED): s.HELD, (state, e.ABORT): s.ABORTED, (state, e.UNANSWERED): s.ABORTED}
    for state in frozenset(State) - RESTING:
        table[state, e.CANCELLED] = s.ABORTED
    for state in frozenset(State) - {s.EMERGENCY}:
        table[state, e.EMERGENCY] = s.EMERGENCY
    return dict(sorted(table.items(), key=lambda item: (_ORDER[item[0][0]], list(Event).index(item[0][1]))))


_ORDER = {state: place for place, state in enumerate(State)}
TABLE = _table()
"""Where each event of each state leads; what is not in it cannot happen."""


class Facts(NamedTuple):
    """All that decides at a moment.

    Attributes:
        emergency: an emergency stop is pressed or asked for.
        armed: the executor is armed.
        autonomous: the mode in force is the one in which the task drives.
        operator: it is one in which an operator drives.
        healthy: what the state needs is heard, finite, fresh and alive.
        wanted: there is a mission; in a resting state: a new one.
        expired: the state's time limit is over.
        valid: all that re-validation asks for holds, and has for a while; at rest: it has been ready for a while.
        touched: the bucket has been in the pile, or may have been, since the last weighing.
        loaded: an operator said that the loading was finished by hand.
        answer: what the operator answers to the open request: empty, `go_on`, `loaded`, `abort`.
        outcome: the event by which the state ends of itself.
    """

    emergency: bool = False
    armed: bool = True
    autonomous: bool = True
    operator: bool = False
    healthy: bool = True
    wanted: bool = True
    expired: bool = False
    valid: bool = False
    touched: bool = False
    loaded: bool = False
    answer: str = ""
    outcome: Event | None = None

    @property
    def ready(self) -> bool:
        """Whether the task may move the machine."""
        return self.armed and self.autonomous and self.healthy and not self.emergency


def event_of(state: State, facts: Facts) -> Event | None:
    """Return the event of a moment, None where the state goes on: safety first, then who commands, outcome, time limit."""
    if facts.emergency:
        return None if state == State.EMERGENCY else Event.EMERGENCY
    if state in RESTING:
        return _at_rest(state, facts)
    if not facts.wanted:
        return Event.CANCELLED
    if state in ASSISTANCE:
        return _assisted(facts)
    if state == State.HELD:
        return _held(facts)
    if facts.operator:
        return Event.TAKEN_OVER
    if not facts.ready:
        return Event.STOPPED
    if facts.outcome is not None:
        return facts.outcome
    return Event.TOO_LONG if facts.expired else None


def _at_rest(state: State, facts: Facts) -> Event | None:
    if state != State.EMERGENCY:
        return Event.MISSION if facts.wanted and facts.ready and facts.valid else None
    if not facts.armed:
        return None
    if not facts.wanted:
        return Event.RELEASED_IDLE
    return Event.RELEASED_TOUCHED if facts.touched else Event.RELEASED_FREE


def _assisted(facts: Facts) -> Event | None:
    if facts.answer == "abort":
        return Event.ABORT
    if facts.answer:
        return Event.ANSWERED
    return Event.UNANSWERED if facts.expired else None


def _held(facts: Facts) -> Event | None:
    if facts.ready and facts.valid:
        if facts.loaded:
            return Event.RESTORED_LOADED
        return Event.RESTORED_TOUCHED if facts.touched else Event.RESTORED_FREE
    if facts.expired:
        return Event.EXPIRED_TOUCHED if facts.touched else Event.EXPIRED_FREE
    return None

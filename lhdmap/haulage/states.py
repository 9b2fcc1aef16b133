"""The state machine of load, haul and dump as data: states, events, and what leads where.

A moving state is the kind of the edge of the route that the machine is on (`lhdmap.haulage.layout`); the 13 stages of the paper
are labels of it. Nothing in here knows a place, a time or a machine: `lhdmap.haulage.machine` applies the tables to a layout, and
`lhdmap.haulage.explore` goes through all that can happen.
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple


class State(StrEnum):
    """What the machine is at; the stage of the paper in brackets."""

    IDLE = "idle"  # (13)
    AREA_OUT = "out of the area"  # (2, 8)
    JUNCTION_ON = "onto the road"  # (3, 9)
    ROAD = "along the road"  # (4, 10)
    THROUGH = "through a junction"
    JUNCTION_OFF = "off the road"  # (5, 11)
    AREA_IN = "into the area"  # (6, 12)
    QUEUE = "queue"
    DOCK = "dock"
    LOAD = "load"  # (1)
    DUMP = "dump"  # (7)
    REFUEL = "refuel"
    ASSIST = "assistance"
    ABORTED = "aborted"


class Event(StrEnum):
    """What leads from a state to another."""

    DISPATCH = "dispatch"
    REACH = "end of the edge crossed"
    POINT_FREE = "point granted"
    DOCK_MISSED = "dock missed"
    LOADED = "loaded"
    LOAD_FAILED = "loading failed"
    DUMPED = "dumped"
    DUMP_STUCK = "load sticks"
    SERVICE_DUE = "service due"
    SERVICED = "serviced"
    LOST = "place lost"
    OBSTACLE_STAYS = "obstacle stays"
    ASSISTED = "assistance done"
    COMPLETED = "assistance did the task"
    ABORT = "abort"
    OBSTACLE = "obstacle"
    GONE = "obstacle gone"
    DENIED = "permit denied"
    GRANTED = "permit granted"
    CLOSED = "edge closed"
    OPENED = "edge opened"
    ESTOP = "emergency stop"
    RESET = "reset"


class Permission(StrEnum):
    """The orthogonal region: whether the machine may move, whatever it is at."""

    GO = "go"
    WAIT = "wait for the permit"
    BLOCKED = "obstacle in the way"
    STOPPED = "emergency stop"


class Guard(StrEnum):
    """What must hold for a rule; `lhdmap.haulage.machine.HaulageMachine` tells."""

    ALWAYS = ""
    ROUTE = "route exists"
    ENDED = "stands at the end of the edge"
    WORKING = "task not done"
    DONE = "task done"
    TRIES = "tries left"
    RELEASED = "no emergency stop"


class On(StrEnum):
    """A target that depends on the layout."""

    NEXT = "next edge"
    HERE = "this edge"


class Rule(NamedTuple):
    """Under `guard`, on to `target`; of several rules the first whose guard holds counts."""

    guard: Guard
    target: State | On


EDGES = (State.AREA_OUT, State.JUNCTION_ON, State.ROAD, State.THROUGH, State.JUNCTION_OFF, State.AREA_IN)
"""Kinds of an edge that is driven without a task at its end."""
MOVING = frozenset({*EDGES, State.DOCK})
TASKS = frozenset({State.LOAD, State.DUMP, State.REFUEL})
WORKS = frozenset(State) - {State.IDLE, State.ABORTED}

_ON_ROADS = frozenset({State.ROAD, State.THROUGH, State.JUNCTION_OFF, State.DOCK})
FOLLOWS: dict[State, frozenset[State]] = {
    State.AREA_OUT: frozenset(EDGES) - {State.AREA_OUT} | {State.DOCK},
    State.JUNCTION_ON: _ON_ROADS,
    State.ROAD: _ON_ROADS,
    State.THROUGH: _ON_ROADS,
    State.JUNCTION_OFF: frozenset({State.AREA_IN, State.JUNCTION_ON, State.JUNCTION_OFF, State.DOCK}),
    State.AREA_IN: frozenset({State.AREA_IN, State.AREA_OUT, State.DOCK, State.JUNCTION_ON, State.JUNCTION_OFF}),
    State.DOCK: frozenset({State.AREA_OUT, State.AREA_IN, State.DOCK}),
}
"""Which kind of edge may follow which; before a DOCK the machine is in QUEUE. A layout that breaks it is refused."""


def _table() -> dict[tuple[State, Event], tuple[Rule, ...]]:
    s, e, g = State, Event, Guard
    on, ended = Rule(g.ALWAYS, On.NEXT), Rule(g.ENDED, On.NEXT)
    table = {
        (s.IDLE, e.DISPATCH): (Rule(g.ROUTE, On.NEXT),),
        (s.ABORTED, e.DISPATCH): (Rule(g.ROUTE, On.HERE),),
        (s.QUEUE, e.POINT_FREE): (on,),
        (s.QUEUE, e.SERVICE_DUE): (Rule(g.ALWAYS, s.QUEUE),),
        (s.DOCK, e.DOCK_MISSED): (Rule(g.TRIES, s.QUEUE), Rule(g.ALWAYS, s.ASSIST)),
        (s.LOAD, e.LOADED): (Rule(g.WORKING, On.NEXT),),
        (s.LOAD, e.LOAD_FAILED): (Rule(g.TRIES, s.LOAD), Rule(g.WORKING, s.ASSIST)),
        (s.DUMP, e.DUMPED): (Rule(g.WORKING, On.NEXT),),
        (s.DUMP, e.DUMP_STUCK): (Rule(g.TRIES, s.DUMP), Rule(g.WORKING, s.ASSIST)),
        (s.REFUEL, e.SERVICED): (Rule(g.WORKING, On.NEXT),),
        (s.ASSIST, e.ASSISTED): (Rule(g.RELEASED, On.HERE),),
        (s.ASSIST, e.COMPLETED): (Rule(g.RELEASED, On.NEXT),),
    }
    for state in MOVING:
        table[state, e.REACH] = (on,)
        table |= {(state, e.LOST): (Rule(g.ALWAYS, s.ASSIST),), (state, e.OBSTACLE_STAYS): (Rule(g.ALWAYS, s.ASSIST),)}
    for event in (e.GRANTED, e.CLOSED, e.OPENED, e.RESET, e.GONE):
        table |= {(state, event): (ended,) for state in MOVING}
        table |= {(state, event): (Rule(g.DONE, On.NEXT),) for state in TASKS}
        table[s.QUEUE, event] = (Rule(g.ALWAYS, s.QUEUE),)
    for state in WORKS - {s.QUEUE}:
        goes_on = (
            {True: (ended,), False: (Rule(g.DONE, On.NEXT),)}.get(state in MOVING, ()) if state != s.ASSIST else ()
        )
        table[state, e.SERVICE_DUE] = (*goes_on, Rule(g.ALWAYS, state))
    for state in WORKS:
        table[state, e.ABORT] = (Rule(g.ALWAYS, s.ABORTED),)
    order, events = list(State), list(Event)
    return dict(sorted(table.items(), key=lambda item: (order.index(item[0][0]), events.index(item[0][1]))))


TABLE = _table()
"""Where each event of each state leads. In QUEUE the way on is looked at again: one that is not the dock any more is taken."""

PERMISSIONS: dict[tuple[Permission, Event], Permission] = {
    (Permission.GO, Event.DENIED): Permission.WAIT,
    (Permission.GO, Event.OBSTACLE): Permission.BLOCKED,
    (Permission.GO, Event.ESTOP): Permission.STOPPED,
    (Permission.WAIT, Event.GRANTED): Permission.GO,
    (Permission.WAIT, Event.OBSTACLE): Permission.BLOCKED,
    (Permission.WAIT, Event.ESTOP): Permission.STOPPED,
    (Permission.BLOCKED, Event.GONE): Permission.GO,
    (Permission.BLOCKED, Event.ESTOP): Permission.STOPPED,
    (Permission.STOPPED, Event.RESET): Permission.GO,
}
"""Where each event leads the permission. Who stands at the end of an edge comes back to WAIT instead of GO: it asks anew."""

OF_PERMISSION = frozenset(event for _, event in PERMISSIONS)
"""Events of the permission: each is defined in every state."""
_NOT_HERE = {
    Event.DISPATCH: "a mission is at work: it is aborted first",
    Event.REACH: "the machine stands",
    Event.POINT_FREE: "it waits for no point",
    Event.DOCK_MISSED: "it does not dock",
    Event.LOADED: "it does not load",
    Event.LOAD_FAILED: "it does not load",
    Event.DUMPED: "it does not dump",
    Event.DUMP_STUCK: "it does not dump",
    Event.SERVICE_DUE: "asked for again once a mission is at work",
    Event.SERVICED: "it is not in service",
    Event.LOST: "it stands; its place is wanted when it is to move",
    Event.OBSTACLE_STAYS: "it does not drive",
    Event.ASSISTED: "nobody was asked for help",
    Event.COMPLETED: "nobody was asked for help",
    Event.ABORT: "nothing is at work",
    Event.CLOSED: "kept for the next route",
    Event.OPENED: "kept for the next route",
}
IGNORED: dict[tuple[State, Event], str] = {
    (state, event): _NOT_HERE[event]
    for state in State
    for event in Event
    if (state, event) not in TABLE and event not in OF_PERMISSION
}
"""Events that are heard and change nothing, and why; no pair of state and event is left out (`tests/haulage/test_states.py`)."""

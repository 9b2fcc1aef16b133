"""All that can happen to the state machine on a layout, gone through on the machine itself: `explore(machine)`.

From a parked machine each event that is not ignored is tried in each status, with each argument. Edges close one at a time, of
those that the machine may be on (`in_play`); an operator who helps leaves it on one of them; the permission has its worst cause.
What is found: whether a mission can always still be finished, and what breaks an invariant.
"""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

from lhdmap.haulage.layout import CLOSABLE, GOALS, Layout
from lhdmap.haulage.machine import NOWHERE, HaulageMachine, Status
from lhdmap.haulage.states import MOVING, OF_PERMISSION, PERMISSIONS, TABLE, Event, Permission, State

_ON_EDGE = (Event.CLOSED, Event.OPENED)


class Exploration(NamedTuple):
    """What was found: each text in `broken`, `dead_ends` and `stranded` names a status.

    `states`: kinds of state that occur; `finished`: statuses in which a mission is finished.
    """

    statuses: int
    transitions: int
    states: frozenset[State]
    finished: int
    dead_ends: tuple[str, ...] = ()
    stranded: tuple[str, ...] = ()
    broken: tuple[str, ...] = ()

    @property
    def sound(self) -> bool:
        """Whether nothing was found."""
        return self.finished > 0 and not (self.dead_ends or self.stranded or self.broken)


def explore(machine: HaulageMachine, buckets: int = 2, without: frozenset[Event] = frozenset()) -> Exploration:
    """Go through all statuses that can come about, `without` some events."""
    begin = machine.idle()
    number: dict[Status, int] = {begin: 0}
    queue = deque([begin])
    transitions, dead_ends = 0, []
    froms, tos = array("l"), array("l")
    events, step = _Events(machine, without), machine.step
    while queue:
        at = queue.popleft()
        own, changes = number[at], len(froms)
        tried = events.of(at)
        transitions += len(tried)
        for event, edge in tried:
            after = step(at, event, edge, buckets)
            if after == at:
                continue
            reached = number.get(after)
            if reached is None:
                reached = number[after] = len(number)
                queue.append(after)
            froms.append(own)
            tos.append(reached)
        if len(froms) == changes:
            dead_ends.append(_told(machine.layout, at))
    ends = [k for at, k in number.items() if finished(at)]
    coming = _coming(froms, tos, ends, len(number))
    stranded = [_told(machine.layout, at) for at, k in number.items() if k not in coming]
    broken = [f"{text}: {_told(machine.layout, at)}" for at in number for text in _broken(machine, at)]
    states = frozenset(at.state for at in number)
    return Exploration(len(number), transitions, states, len(ends), tuple(dead_ends), tuple(stranded), tuple(broken))


def in_play(machine: HaulageMachine) -> tuple[list[int], list[int]]:
    """Return the edges that an errand may lead over with at most one edge closed, and those whose closing changes a route."""
    layout, errand = machine.layout, machine.errand
    trips = [
        (errand.park, errand.load),
        (errand.load, errand.dump),
        (errand.dump, errand.load),
        (errand.dump, errand.park),
    ]
    used = sorted({k for trip in trips for k in layout.route(*trip) or []})
    around = {k for shut in used for trip in trips for k in layout.route(*trip, _bits(layout.passages[shut])) or []}
    leaving = {k for shut in used for k in layout.leaving[layout.edges[shut].start]}  # the other ways out of a point
    closing = {layout.passages[k]: k for k in used if layout.edges[k].kind in CLOSABLE}
    return sorted({*used, *around, *(k for k in leaving if layout.edges[k].kind == State.AREA_OUT)}), list(
        closing.values()
    )


def _bits(mask: int) -> list[int]:
    return [k for k in range(mask.bit_length()) if mask >> k & 1]


def finished(at: Status) -> bool:
    """Return whether nothing is left to be done: parked, empty, no bucket left."""
    return at.state == State.IDLE and not at.loaded and at.left == 0


class _Events:
    """The events that are tried in a status."""

    def __init__(self, machine: HaulageMachine, without: frozenset[Event]) -> None:
        self._edges, self._closing = in_play(machine)
        reactions = {
            state: [event for event in Event if (state, event) in TABLE and event not in without] for state in State
        }
        permissions = [event for event in Event if event in OF_PERMISSION and event not in without]
        self._of = {
            (state, permission): [
                event
                for event in Event
                if (event in reactions[state] and event not in _ON_EDGE)
                or (event in permissions and (permission, event) in PERMISSIONS)
            ]
            for state in State
            for permission in {one for one, _ in PERMISSIONS}
        }
        self._alike: dict[tuple[State, Permission, bool, int], list[tuple[Event, int]]] = {}
        self._closes, self._opens = Event.CLOSED not in without, Event.OPENED not in without

    def of(self, at: Status) -> list[tuple[Event, int]]:
        """Return the events that can happen in a status and are not ignored, each with the edge that it is about."""
        alike = at.state, at.permission, at.edge == NOWHERE, at.closed
        found = self._alike.get(alike)
        if found is None:
            found = self._alike[alike] = list(self._tried(at))
        return found

    def _tried(self, at: Status) -> Iterator[tuple[Event, int]]:
        for event in self._of[at.state, at.permission]:
            if at.edge == NOWHERE and event in (Event.ASSISTED, Event.DISPATCH):
                yield from ((event, edge) for edge in self._edges)
            else:
                yield event, NOWHERE
        if at.closed and self._opens:
            yield Event.OPENED, at.closed.bit_length() - 1
        elif not at.closed and self._closes:
            yield from ((Event.CLOSED, edge) for edge in self._closing)


def _coming(froms: array[int], tos: array[int], ends: list[int], statuses: int) -> set[int]:
    """Return the statuses from which one of `ends` can be reached; `froms`, `tos`: what each transition leads between."""
    start = statuses  # leads to each end; transitions are gone through backwards
    tails, heads = [*tos, *([start] * len(ends))], [*froms, *ends]
    back = csr_array((np.ones(len(tails), dtype=np.int8), (tails, heads)), shape=(statuses + 1, statuses + 1))
    return set(breadth_first_order(back, start, return_predecessors=False).tolist())


def _broken(machine: HaulageMachine, at: Status) -> Iterator[str]:
    """Yield what may never be."""
    if at.edge == NOWHERE:
        if at.state not in (State.ASSIST, State.ABORTED):
            yield "does not know where it is"
        return
    edge = machine.layout.edges[at.edge]
    purpose = machine.layout.point[edge.end].purpose
    if at.state == State.LOAD and (not at.ended or purpose != "load"):
        yield "loads where nothing is to be loaded"
    if at.state == State.DUMP and (not at.ended or purpose != "dump"):
        yield "dumps where nothing is to be dumped"
    if at.state in (State.IDLE, State.REFUEL) and (not at.ended or purpose != "park"):
        yield "parks where nobody parks"
    if at.state in MOVING and at.state != edge.kind:
        yield "is not what its edge is"
    if at.state == State.QUEUE and (not at.ended or purpose in GOALS):
        yield "queues at a point of work"
    if at.loaded and at.state == State.IDLE:
        yield "parks loaded"


def _told(layout: Layout, at: Status) -> str:
    edge = layout.edges[at.edge]
    more = f"{'at the end of ' if at.ended else ''}{edge.start} to {edge.end}" if at.edge != NOWHERE else "anywhere"
    shut = ", ".join(f"{one.start} to {one.end}" for k, one in enumerate(layout.edges) if at.closed >> k & 1)
    return (
        f"{at.state}, {more}, {'loaded' if at.loaded else 'empty'}, {at.left} left, {at.permission}"
        + (", service" if at.service else "")
        + (f", closed: {shut}" if shut else "")
    )

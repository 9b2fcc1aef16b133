"""The state machine of load, haul and dump at work: `HaulageMachine(layout).step(at, event)`. Pure: no time, no signal.

What is not in `TABLE` or `PERMISSIONS` is ignored. A route is not stored: at the end of each edge the first edge of the
shortest open way to the goal of now is taken, so each closed or opened edge counts from the next end on.
"""

from __future__ import annotations

from typing import NamedTuple

from lhdmap.haulage.layout import Layout, checked
from lhdmap.haulage.states import MOVING, OF_PERMISSION, PERMISSIONS, TABLE, TASKS, Event, Guard, On, Permission, State

NOWHERE = -1
"""Edge of a machine that others may move: after assistance, and with a new mission, its pose tells where it is."""


class Status(NamedTuple):
    """All that the machine knows.

    Attributes:
        state: what it is at.
        edge: number of the edge that it is on, or at whose end it stands.
        ended: it stands at that end: it waits there, or works.
        loaded: there is something in the bucket.
        left: buckets that are still to be dumped.
        tries: how often the task of now has failed.
        service: fuel, or another service, is due.
        permission: whether it may move.
        closed: closed edges, a bit each.
    """

    state: State
    edge: int
    ended: bool = True
    loaded: bool = False
    left: int = 0
    tries: int = 0
    service: bool = False
    permission: Permission = Permission.GO
    closed: int = 0


class Tries(NamedTuple):
    """How often docking, loading and dumping are tried before somebody is asked to help."""

    dock: int = 3
    load: int = 3
    dump: int = 2


class Errand(NamedTuple):
    """From which load point to which dump, and where to park."""

    load: str
    dump: str
    park: str


class HaulageMachine:
    """Runs on one layout, for one errand at a time."""

    def __init__(self, layout: Layout, errand: Errand | None = None, tries: Tries | None = None) -> None:
        self.layout = checked(layout)
        self.errand = errand or Errand(*(layout.of(purpose)[0] for purpose in ("load", "dump", "park")))
        most = tries or Tries()
        self._most = {State.DOCK: most.dock, State.LOAD: most.load, State.DUMP: most.dump}
        self._kinds = [edge.kind for edge in layout.edges]
        self._ends = [edge.end for edge in layout.edges]
        self._first: dict[tuple[str, int], dict[str, int]] = {}

    def idle(self) -> Status:
        """Return the status of a machine that is parked."""
        return Status(State.IDLE, self.layout.entering[self.errand.park][0])

    def goal(self, at: Status) -> str:
        """Return where a machine is bound for: what is in the bucket is dumped first."""
        if at.loaded:
            return self.errand.dump
        return self.errand.load if at.left and not at.service else self.errand.park

    def next_edge(self, at: Status) -> int | None:
        """Return the edge after this one; None where no open way leads to the goal, or the goal is here."""
        goal = self.goal(at)
        first = self._first.get((goal, at.closed))
        if first is None:
            shut = [k for k in range(len(self._kinds)) if at.closed >> k & 1]
            first = self._first[goal, at.closed] = self.layout.first_edges(goal, shut)
        return first.get(self._ends[at.edge])

    def has_route(self, at: Status) -> bool:
        """Return whether an open way leads from the end of this edge to the goal of now."""
        return self._ends[at.edge] == self.goal(at) or self.next_edge(at) is not None

    @staticmethod
    def working(at: Status) -> bool:
        """Return whether the task of a state is still to be done; one that is done waits for a way on."""
        if at.state == State.LOAD:
            return not at.loaded
        return at.loaded if at.state == State.DUMP else at.service or at.state != State.REFUEL

    def step(self, at: Status, event: Event, edge: int = NOWHERE, buckets: int = 1) -> Status:
        """Return the status after an event.

        `edge`: of CLOSED and OPENED that edge (those of its passage go with it), of ASSISTED and DISPATCH the one that the
        machine is on now; `buckets`: of DISPATCH.
        """
        now = self._heard(at, event, edge) if event in _HEARD else at
        for rule in TABLE.get((at.state, event), ()):
            if rule.guard is Guard.ALWAYS or self._holds(rule.guard, now, edge):
                return self._goes(now, rule.target, event, edge, buckets)
        return now

    def _heard(self, at: Status, event: Event, edge: int) -> Status:
        """Note what counts whatever the state: closed edges, the permission."""
        if event is Event.CLOSED:
            return Status(*at[:8], at.closed | self.layout.passages[edge])
        if event is Event.OPENED:
            return Status(*at[:8], at.closed & ~self.layout.passages[edge])
        permission = PERMISSIONS.get((at.permission, event))
        if permission is None:
            return at
        waits = at.ended and permission == Permission.GO and at.state in MOVING and event != Event.GRANTED
        return Status(*at[:7], Permission.WAIT if waits else permission, at.closed)

    def _holds(self, guard: Guard, at: Status, edge: int) -> bool:
        if guard == Guard.ENDED:
            return at.ended
        if guard == Guard.RELEASED:
            return at.permission != Permission.STOPPED
        if guard == Guard.ROUTE:
            return self.has_route(at._replace(left=1, service=False, edge=at.edge if edge == NOWHERE else edge))
        if guard == Guard.TRIES:
            return self.working(at) and at.tries + 1 < self._most[at.state]
        return self.working(at) is (guard == Guard.WORKING)

    def _goes(self, at: Status, target: State | On, event: Event, edge: int, buckets: int) -> Status:
        if event == Event.COMPLETED:  # the operator drove to the goal, and did there what was to be done
            at = at._replace(edge=self.layout.entering[self.goal(at)][0])
        if event in _COUNTS:
            at = _done(at, event, edge, buckets)
        if target == On.NEXT:
            return self._on(at, granted=event == Event.POINT_FREE)
        if target == On.HERE:
            return at._replace(state=self._kinds[at.edge], ended=False, tries=0)
        if target == State.QUEUE:
            return self._queues(at, event)
        if isinstance(target, State) and target in _LEFT_TO_OTHERS and target is not at.state:
            _, _, _, loaded, left, _, service, permission, closed = at
            return Status(target, NOWHERE, False, loaded, left, 0, service, permission, closed)
        return at._replace(tries=at.tries + 1) if event in _AGAIN else at

    def _queues(self, at: Status, event: Event) -> Status:
        """Wait for the point; back out of a dock that was missed; go where the way leads now if that is another one."""
        if event == Event.DOCK_MISSED:
            back = self.layout.entering[self.layout.edges[at.edge].start][0]
            return at._replace(state=State.QUEUE, edge=back, ended=True, tries=at.tries + 1)
        following = self.next_edge(at)
        if following is None or self._kinds[following] == State.DOCK:
            return at
        return self._on(at, granted=False)

    def _on(self, at: Status, *, granted: bool) -> Status:
        """Go on from the end of an edge: to the task there, to the next edge, or wait."""
        if self._ends[at.edge] == self.goal(at):
            return at._replace(state=self._task(at), ended=True, tries=0)
        following = self.next_edge(at)
        if following is not None and self._kinds[following] == State.DOCK and not granted:
            return at._replace(state=State.QUEUE, ended=True, tries=at.tries if at.state == State.QUEUE else 0)
        if following is None or at.permission != Permission.GO:
            if at.ended and at.state in _STAY:
                return at
            state = at.state if at.state in _STAY else self._kinds[at.edge]
            return Status(state, at.edge, True, *at[3:])
        return Status(self._kinds[following], following, False, *at[3:])

    @staticmethod
    def _task(at: Status) -> State:
        if at.loaded:
            return State.DUMP
        if at.service:
            return State.REFUEL
        return State.LOAD if at.left else State.IDLE


_STAY = MOVING | TASKS | {State.QUEUE}
_AGAIN = frozenset({Event.LOAD_FAILED, Event.DUMP_STUCK})
_LEFT_TO_OTHERS = frozenset({State.ASSIST, State.ABORTED})
_HEARD = OF_PERMISSION | {Event.CLOSED, Event.OPENED}
_COUNTS = frozenset(
    {Event.COMPLETED, Event.DISPATCH, Event.LOADED, Event.DUMPED, Event.SERVICE_DUE, Event.SERVICED, Event.ASSISTED}
)


def _done(at: Status, event: Event, edge: int, buckets: int) -> Status:
    """Note what an event says that counts in this state."""
    if event == Event.COMPLETED:
        event = Event.DUMPED if at.loaded else Event.SERVICED if at.service else Event.LOADED if at.left else event
    if event == Event.DISPATCH:
        return at._replace(left=buckets, service=False, tries=0, edge=at.edge if edge == NOWHERE else edge)
    if event == Event.LOADED:
        return at._replace(loaded=True, tries=0)
    if event == Event.DUMPED:
        return at._replace(loaded=False, left=max(at.left - 1, 0), tries=0)
    if event in (Event.SERVICE_DUE, Event.SERVICED):
        return at._replace(service=event == Event.SERVICE_DUE)
    return at._replace(edge=edge, ended=False) if event == Event.ASSISTED else at

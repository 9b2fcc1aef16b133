"""The state machine in full: all states, all facts, breadth first; what must hold in every one of them."""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import pytest
from lhdmap.loading.states import (
    ASSISTANCE,
    BEFORE_THE_PILE,
    MOVING,
    RESTING,
    TABLE,
    Event,
    Facts,
    State,
    event_of,
)
from lhdmap.loading.task import limits_s
from lhdmap.loading.task_settings import LoadingSettings

_OUTCOMES = {
    state: [
        None,
        *(
            event
            for (start, event) in TABLE
            if start == state
            and event not in (Event.EMERGENCY, Event.CANCELLED, Event.STOPPED, Event.TAKEN_OVER, Event.TOO_LONG)
        ),
    ]
    for state in MOVING
}
"""By which events each moving state may end of itself."""


class Node(NamedTuple):
    """A state, and what is remembered beside it: as in `Memory`, and whether there was a charge that was not weighed."""

    state: State
    active: bool = False
    touched: bool = False
    loaded: bool = False


def all_facts(node: Node) -> Iterator[Facts]:
    flags = (False, True)
    answers = ("", "go_on", "loaded", "abort") if node.state in ASSISTANCE else ("",)
    modes = ((True, False), (False, True), (False, False))
    for emergency, armed, healthy, wanted, expired, valid in itertools.product(flags, repeat=6):
        for (autonomous, operator), answer, outcome in itertools.product(
            modes, answers, _OUTCOMES.get(node.state, [None])
        ):
            if node.state == State.EMERGENCY and not node.active and wanted:
                continue  # a mission that is over is none
            yield Facts(
                emergency, armed, autonomous, operator, healthy, wanted, expired, valid,
                node.touched, node.loaded, answer, outcome,
            )  # fmt: skip


def after(node: Node, event: Event, facts: Facts) -> Node:
    """What `LoadingTask` remembers after an event."""
    state = TABLE[node.state, event]
    loaded = node.loaded or facts.answer == "loaded"
    touched = node.touched or loaded or state == State.CHARGING
    if event == Event.MISSION:
        loaded = touched = False
    if event in (Event.AGAIN, Event.ENOUGH):
        touched = False
    loaded &= state != State.WEIGHING
    active = (node.active or event == Event.MISSION) and state not in RESTING - {State.EMERGENCY}
    return Node(state, active, touched, loaded)


def explored() -> dict[Node, list[tuple[Event, Facts, Node]]]:
    first = Node(State.IDLE)
    found: dict[Node, list[tuple[Event, Facts, Node]]] = {}
    queue = deque([first])
    while queue:
        node = queue.popleft()
        if node in found:
            continue
        found[node] = []
        for facts in all_facts(node):
            event = event_of(node.state, facts)
            if event is None:
                continue
            assert (node.state, event) in TABLE, f"{node.state} has no reaction to {event}"
            found[node].append((event, facts, after(node, event, facts)))
            queue.append(found[node][-1][2])
    return found


GRAPH = explored()


def test_every_state_is_reached_and_every_line_of_the_table_is_used() -> None:
    assert {node.state for node in GRAPH} == set(State)
    used = {(node.state, event) for node, ways in GRAPH.items() for event, _, _ in ways}
    assert used == set(TABLE)


def test_every_event_leads_somewhere() -> None:
    assert {event for _, event in TABLE} == set(Event)


def test_every_state_ends_in_bounded_time_or_rests() -> None:
    """A state with no way out by time alone is a resting one, and there nothing moves."""
    limits = limits_s(LoadingSettings())
    assert set(limits) == set(State) - RESTING
    assert all(0.0 < limit < math.inf for limit in limits.values())
    for node in GRAPH:
        if node.state in RESTING:
            continue
        for facts in all_facts(node):
            if facts.expired:
                assert event_of(node.state, facts) is not None, (node, facts)


def test_by_time_limits_alone_every_state_comes_to_rest() -> None:
    """Where nothing works and nobody answers, it ends: no circle of time limits."""
    for node in GRAPH:
        for armed in (False, True):
            at, steps = node, 0
            while at.state not in RESTING:
                facts = Facts(armed=armed, expired=True, touched=at.touched, loaded=at.loaded)
                event = event_of(at.state, facts)
                assert event is not None
                at, steps = after(at, event, facts), steps + 1
                assert steps < 5
            assert at.state == State.ABORTED or at == node


def test_from_every_state_a_full_bucket_can_still_be_had() -> None:
    """No dead end: whatever happened, there is a way to DONE."""
    back: dict[Node, set[Node]] = {node: set() for node in GRAPH}
    for node, ways in GRAPH.items():
        for _, _, end in ways:
            back[end].add(node)
    reached, queue = set(), [node for node in GRAPH if node.state == State.DONE]
    while queue:
        node = queue.pop()
        if node not in reached:
            reached.add(node)
            queue += back[node]
    assert reached == set(GRAPH)


def test_an_emergency_stop_counts_everywhere_before_all_else() -> None:
    for node in GRAPH:
        for facts in all_facts(node):
            if facts.emergency:
                event = event_of(node.state, facts)
                end = node.state if event is None else TABLE[node.state, event]
                assert end == State.EMERGENCY


@pytest.mark.parametrize("blind", ["armed", "autonomous", "healthy"])
def test_what_is_not_ready_never_moves(blind: str) -> None:
    """Disarmed, in another mode, or with inputs missing: one look later the task is in a state that moves nothing."""
    for node in GRAPH:
        for facts in all_facts(node):
            if not getattr(facts, blind):
                event = event_of(node.state, facts)
                end = node.state if event is None else TABLE[node.state, event]
                assert end not in MOVING, (node, facts, event)


def test_from_a_stop_nothing_moves_but_through_arming_and_validation() -> None:
    """Out of EMERGENCY only to help or to rest; out of help only to HELD, or to an end; out of HELD only when all is valid."""
    for node, ways in GRAPH.items():
        for event, facts, end in ways:
            if node.state == State.EMERGENCY:
                assert facts.armed
                assert not facts.emergency
                assert end.state in ASSISTANCE | {State.IDLE}
            if node.state in ASSISTANCE:
                assert end.state in {State.HELD, State.ABORTED, State.EMERGENCY}
            if node.state == State.HELD and end.state in MOVING:
                assert facts.ready
                assert facts.valid
                assert event in (Event.RESTORED_FREE, Event.RESTORED_TOUCHED, Event.RESTORED_LOADED)
            if node.state in RESTING and end.state in MOVING:
                assert facts.ready
                assert facts.valid
                assert event == Event.MISSION


def test_weighing_is_never_skipped() -> None:
    """What has been in the pile is weighed before the mission is done or another attempt begins, by hand or not."""
    for node, ways in GRAPH.items():
        if node.state == State.DONE or (node.state in BEFORE_THE_PILE):
            assert not node.touched
        for _, _, end in ways:
            if end.state == State.DONE:
                assert node.state == State.WEIGHING
            if node.touched and not end.touched:
                assert node.state == State.WEIGHING or end.state == State.IDENTIFICATION
                assert end.state in (State.DONE, State.IDENTIFICATION)


def test_a_withdrawn_mission_stops_all() -> None:
    for node in GRAPH:
        for facts in all_facts(node):
            event = event_of(node.state, facts)
            end = node.state if event is None else TABLE[node.state, event]
            if not facts.wanted:
                assert end in RESTING


def test_the_same_facts_decide_the_same_and_only_in_their_order() -> None:
    """A takeover outweighs an outcome, an outcome a time limit."""
    facts = Facts(outcome=Event.DUG, expired=True)
    assert event_of(State.EXCAVATION, facts) == Event.DUG
    assert event_of(State.EXCAVATION, facts._replace(operator=True, autonomous=False)) == Event.TAKEN_OVER
    assert event_of(State.EXCAVATION, facts._replace(outcome=None)) == Event.TOO_LONG
    assert event_of(State.EXCAVATION, facts._replace(armed=False)) == Event.STOPPED


def test_the_paths_of_figure_6() -> None:
    s, e = State, Event
    good = [e.MISSION, e.PILE_FOUND, e.PLACED, e.COLLISION, e.DUG, e.BACKED, e.ENOUGH]
    at = s.IDLE
    for event in good:
        at = TABLE[at, event]
    assert at == s.DONE
    for state in (s.IDENTIFICATION, s.POSITIONING):
        assert TABLE[state, e.TOO_LONG] == s.POSITIONING_ASSISTANCE
    for state in (s.CHARGING, s.EXCAVATION, s.PULL_BACK):
        assert TABLE[state, e.TOO_LONG] == s.LOADING_ASSISTANCE
    assert TABLE[s.WEIGHING, e.AGAIN] == s.IDENTIFICATION


def test_the_limits_are_the_papers_but_for_charging() -> None:
    limits = limits_s(LoadingSettings())
    assert [limits[state] for state in (State.POSITIONING, State.EXCAVATION, State.PULL_BACK)] == [30.0, 30.0, 60.0]
    assert limits[State.CHARGING] == 15.0
    assert LoadingSettings().identify_m == 15.0

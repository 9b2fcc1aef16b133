"""The tables by themselves: nothing left out, what the findings' table says, one kind of machine."""

from __future__ import annotations

from pathlib import Path

from lhdmap.haulage.diagram import mermaid
from lhdmap.haulage.states import (
    FOLLOWS,
    IGNORED,
    MOVING,
    OF_PERMISSION,
    PERMISSIONS,
    TABLE,
    Event,
    Guard,
    On,
    Permission,
    State,
)


def test_each_pair_of_state_and_event_has_a_reaction_or_a_reason() -> None:
    for state in State:
        for event in Event:
            known = [(state, event) in TABLE or event in OF_PERMISSION, (state, event) in IGNORED]
            assert known in ([True, False], [False, True]), (state, event)


def test_each_ignored_event_has_a_reason() -> None:
    assert all(IGNORED.values())


def test_what_does_not_end_by_a_guard_ends_by_the_last_rule_or_changes_nothing() -> None:
    for pair, rules in TABLE.items():
        assert len({rule.guard for rule in rules}) == len(rules), pair
        assert Guard.ALWAYS not in [rule.guard for rule in rules[:-1]], pair


def test_an_emergency_stop_is_heard_in_each_permission_and_ends_by_a_reset_alone() -> None:
    for permission in Permission:
        if permission != Permission.STOPPED:
            assert PERMISSIONS[permission, Event.ESTOP] == Permission.STOPPED
    assert [event for permission, event in PERMISSIONS if permission == Permission.STOPPED] == [Event.RESET]


def test_the_table_says_what_the_findings_say() -> None:
    rules = {pair: [rule.target for rule in found] for pair, found in TABLE.items()}
    assert rules[State.IDLE, Event.DISPATCH] == [On.NEXT]
    assert all(rules[state, Event.REACH] == [On.NEXT] for state in MOVING)
    assert rules[State.QUEUE, Event.POINT_FREE] == [On.NEXT]
    assert rules[State.DOCK, Event.DOCK_MISSED] == [State.QUEUE, State.ASSIST]
    assert rules[State.LOAD, Event.LOAD_FAILED] == [State.LOAD, State.ASSIST]
    assert rules[State.DUMP, Event.DUMP_STUCK] == [State.DUMP, State.ASSIST]
    for state in MOVING:
        assert rules[state, Event.LOST] == rules[state, Event.OBSTACLE_STAYS] == [State.ASSIST]
    for state in set(State) - {State.IDLE, State.ABORTED}:
        assert rules[state, Event.ABORT] == [State.ABORTED]


def test_a_dock_is_never_followed_by_the_road() -> None:
    assert FOLLOWS[State.DOCK].isdisjoint({State.ROAD, State.JUNCTION_ON, State.THROUGH})


def test_the_page_shows_the_diagram_of_the_code() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "haulage_states.md").read_text(encoding="utf-8")
    assert f"```mermaid\n{mermaid()}```" in page

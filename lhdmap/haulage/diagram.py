"""The state machine as a diagram in Mermaid's language, drawn from its tables: `docs/haulage.md` shows it."""

from __future__ import annotations

from collections.abc import Iterator

from lhdmap.haulage.states import FOLLOWS, MOVING, PERMISSIONS, TABLE, TASKS, Event, On, Permission, State

_SAME = "again"
_WAY = "way"  # a composite of all kinds of edges


def mermaid() -> str:
    """Return the diagram: the edges of a route as one composite, and beside it the permission."""
    lines = ["stateDiagram-v2", f'    state "on the way" as {_WAY} {{']
    lines += [f'        state "{state}" as {state.name}' for state in State if state in MOVING]
    lines += [f"        {a.name} --> {b.name}" for a in State if a in FOLLOWS for b in State if b in FOLLOWS[a]]
    lines += ["    }"]
    lines += [f'    state "{state}" as {state.name}' for state in State if state not in MOVING]
    lines += ["    [*] --> IDLE"]
    lines += dict.fromkeys(_arrows())
    lines += ['    state "permission" as permission {', "        [*] --> GO"]
    lines += [f'        state "{one}" as {one.name}' for one in Permission]
    lines += [f"        {a.name} --> {b.name} : {event}" for (a, event), b in PERMISSIONS.items()]
    return "\n".join([*lines, "    }"]) + "\n"


def _arrows() -> Iterator[str]:
    for (state, event), rules in TABLE.items():
        first = _WAY if state in MOVING and event != Event.DOCK_MISSED else state.name
        for rule in rules:
            guard = f" [{rule.guard}]" if rule.guard else ""
            for target in _targets(state, rule.target):
                if target != first:
                    yield f"    {first} --> {target} : {event}{guard}"


def _targets(state: State, target: State | On) -> list[str]:
    """Return where a rule leads: `next edge` is the way, or the task where the edge that has ended was a dock."""
    if target == On.NEXT:
        tasks = [one.name for one in (*sorted(TASKS), State.IDLE)] if state in (*MOVING, State.ASSIST) else []
        return [_WAY, *(["QUEUE"] if state != State.QUEUE else []), *tasks]
    return [_WAY] if target == On.HERE else [State(target).name]

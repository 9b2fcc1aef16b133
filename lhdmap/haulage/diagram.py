"""The state machine as a diagram in Mermaid's language, drawn from its tables: `docs/haulage_states.md` shows it."""

from __future__ import annotations

from collections.abc import Iterator

from lhdmap.haulage.states import FOLLOWS, MOVING, PERMISSIONS, TABLE, TASKS, Event, Guard, On, Permission, State

_WAY = "way"  # a composite of all kinds of edges


def mermaid() -> str:
    """Return the diagram: the edges of a route as one composite, and beside it the permission."""
    lines = ["stateDiagram-v2", f'    state "on the way" as {_WAY} {{']
    lines += [f'        state "{state}" as {state.name}' for state in State if state in MOVING]
    lines += [f"        {a.name} --> {b.name}" for a in State if a in FOLLOWS for b in State if b in FOLLOWS[a]]
    lines += ["    }"]
    lines += [f'    state "{state}" as {state.name}' for state in State if state not in MOVING]
    lines += ["    [*] --> IDLE"]
    lines += _arrows()
    lines += ['    state "permission" as permission {', "        [*] --> GO"]
    lines += [f'        state "{one}" as {one.name}' for one in Permission]
    lines += [f"        {a.name} --> {b.name} : {event}" for (a, event), b in PERMISSIONS.items()]
    return "\n".join([*lines, "    }"]) + "\n"


def _arrows() -> Iterator[str]:
    """Yield an arrow for each pair of states, with all events that lead that way."""
    labels: dict[tuple[str, str], dict[Guard, list[Event]]] = {}
    for (state, event), rules in TABLE.items():
        first = _WAY if state in MOVING and event != Event.DOCK_MISSED else state.name
        for rule in rules:
            targets = [] if rule.target == state else _targets(state, rule.target)
            for target in targets:
                events = labels.setdefault((first, target), {}).setdefault(rule.guard, [])
                if target != first and event not in events:
                    events.append(event)
    for (first, target), by_guard in labels.items():
        told = [", ".join(events) + (f" [{guard}]" if guard else "") for guard, events in by_guard.items() if events]
        if told:
            yield f"    {first} --> {target} : {' or '.join(told)}"


def _targets(state: State, target: State | On) -> list[str]:
    """Return where a rule leads: `next edge` is the way, or the task where the edge that has ended was a dock."""
    if target == On.NEXT:
        tasks = [one.name for one in (*sorted(TASKS), State.IDLE)] if state in (*MOVING, State.ASSIST) else []
        return [_WAY, *(["QUEUE"] if state != State.QUEUE else []), *tasks]
    return [_WAY] if target == On.HERE else [State(target).name]

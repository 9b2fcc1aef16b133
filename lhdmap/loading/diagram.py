"""The state machine as a Mermaid diagram, from the table that runs."""

from __future__ import annotations

from collections.abc import Iterable

from lhdmap.loading.states import RESTING, TABLE, Event, State

_EVERYWHERE = (Event.EMERGENCY, Event.CANCELLED)


def mermaid() -> str:
    """Return the diagram (stateDiagram-v2); what holds in every state alike is said in a note, not drawn as arrows."""
    lines = ["stateDiagram-v2", f"    [*] --> {State.IDLE.value}"]
    lines += _arrows((start, event, end) for (start, event), end in TABLE.items() if event not in _EVERYWHERE)
    lines += [
        f"    note right of {State.EMERGENCY.value}: from every state, at once",
        f"    note right of {State.ABORTED.value}: a mission that is withdrawn ends here, from every state but "
        + ", ".join(sorted(state.value for state in RESTING)),
    ]
    return "\n".join(lines) + "\n"


def _arrows(moves: Iterable[tuple[State, Event, State]]) -> list[str]:
    """Return an arrow for each pair of states, with all events that lead from one to the other."""
    found: dict[tuple[State, State], list[str]] = {}
    for start, event, end in moves:
        found.setdefault((start, end), []).append(event.value)
    return [f"    {start.value} --> {end.value}: {' / '.join(events)}" for (start, end), events in found.items()]

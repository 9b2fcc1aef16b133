"""The paper's 13 stages as labels of the machine's states: by kind of edge, and by what is in the bucket."""

from __future__ import annotations

from lhdmap.haulage.states import State

STAGES = (
    "A1: load",
    "A1: move to the intersection",
    "T-junction: turn onto the road",
    "A2: travel along the road",
    "T-junction: turn off the road at A3",
    "A3: move to the unloading position",
    "A3: unload",
    "A3: move to the intersection",
    "T-junction: turn onto the road",
    "A2: travel along the road",
    "T-junction: turn off the road at A1",
    "A1: move to the loading position",
    "A1: stop, wait",
)
"""Section 2.2.1; stage 1 is the first."""
_LOADED = {
    State.AREA_OUT: 2,
    State.JUNCTION_ON: 3,
    State.ROAD: 4,
    State.THROUGH: 4,
    State.JUNCTION_OFF: 5,
    State.AREA_IN: 6,
    State.QUEUE: 6,
    State.DOCK: 6,
}
_ALONE = {State.LOAD: 1, State.DUMP: 7, State.IDLE: 13}


def stage_of(state: State, *, loaded: bool) -> int:
    """Return the stage's number, 0 where the paper has none (assistance, refuelling, aborted)."""
    if state in _LOADED:
        return _LOADED[state] + (0 if loaded else 6)
    return _ALONE.get(state, 0)

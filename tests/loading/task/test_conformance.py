"""The task itself against the table: each state with each combination of facts is made real, `update` must go where it says."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lhdmap.driving.motion import Motion
from lhdmap.loading.assistance import Answer
from lhdmap.loading.moment import LoadingInput, LoadingOutput, Mission, Moment, Step
from lhdmap.loading.signals import Pedals, Signals
from lhdmap.loading.states import ASSISTANCE, MOVING, RESTING, TABLE, Event, Facts, State, event_of
from lhdmap.loading.task import LoadingTask, limits_s
from lhdmap.loading.task_settings import LoadingSettings

from tests.guidance.tunnels import BODIES, MODEL
from tests.loading.task.bench import Until, controllers
from tests.loading.task.test_states import GRAPH, Node, after, all_facts

SETTINGS = LoadingSettings()
LIMITS_NS = {state: round(limit * 1e9) for state, limit in limits_s(SETTINGS).items()}
NOW_NS = 10_000 * 1_000_000_000


class Stub:
    """A part that ends as told."""

    phase = ""

    def __init__(self) -> None:
        self.outcome: Event | None = None

    def begin(self, moment: Moment) -> None:
        self.outcome = None

    def step(self, moment: Moment) -> Step:
        return Step("", self.outcome, pedals=Pedals(0.5))


def task_in(node: Node, facts: Facts) -> LoadingTask:
    """A task in a state, as it is after what has led there."""
    task = LoadingTask(MODEL, BODIES, controllers(), Until(), SETTINGS)
    stubs: Any = {state: Stub() for state in MOVING}
    if node.state in MOVING:
        stubs[node.state].outcome = facts.outcome
    task._parts = stubs
    memory = task._memory
    limit_ns = LIMITS_NS.get(node.state, 0)
    memory.state, memory.since_ns = node.state, NOW_NS - (limit_ns + 1 if facts.expired else limit_ns // 2)
    memory.active, memory.touched, memory.loaded = node.active, node.touched, node.loaded
    memory.mission = Mission(1) if node.active or node.state in (State.DONE, State.ABORTED) else None
    memory.last_ns = NOW_NS - 50_000_000
    if facts.valid:
        memory.valid_ns = NOW_NS - 2_000_000_000
    if node.state in ASSISTANCE:
        task._help.ask(node.state, State.CHARGING, "why", (), told(node, facts, task))
    if node.touched:
        task._trail.add(_motion())
    return task


def _motion() -> Motion:
    return Motion(NOW_NS, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def told(node: Node, facts: Facts, task: LoadingTask) -> LoadingInput:
    """An input that makes the facts true."""
    number = 2 if node.state in RESTING - {State.EMERGENCY} else 1
    mode = "autonomous" if facts.autonomous else "teleoperated" if facts.operator else "idle"
    signals = Signals(NOW_NS, 0.0, 0.0, NOW_NS, 0.0, 0.0, 0.0, 0.0, 60.0, 80.0, 10.0)
    request = task._help.request
    return LoadingInput(
        NOW_NS,
        signals if facts.healthy else None,
        _motion(),
        walls_m=np.zeros((0, 2)),
        mode=mode,
        armed=facts.armed,
        answer=Answer(request.number, facts.answer) if facts.answer and request is not None else None,
        emergency=facts.emergency,
        mission=Mission(number) if facts.wanted else None,
    )


def moves(out: LoadingOutput) -> bool:
    return out.directive is not None or out.pedals is not None


@pytest.mark.parametrize("state", State)
def test_update_goes_where_the_table_says(state: State) -> None:
    for node in GRAPH:
        if node.state != state:
            continue
        for facts in all_facts(node):
            if facts.valid and not (facts.ready and state in RESTING | {State.HELD}):
                continue  # cannot be: what is valid is ready
            event = event_of(state, facts)
            task = task_in(node, facts)
            out = task.update(told(node, facts, task))
            want = node if event is None else after(node, event, facts)
            memory = task._memory
            got = Node(out.state, memory.active, memory.touched, memory.loaded)
            assert got == want, (node, facts, event)
            assert moves(out) <= (facts.ready and out.state in MOVING)
            if event is not None:
                assert [note.event for note in out.notes] == ["state"]
                assert TABLE[state, event] == out.state
            assert (out.request is not None) == (out.state in ASSISTANCE)
            assert math.isnan(out.fill)

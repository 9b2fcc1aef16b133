"""The loading task's process without a simulator: when it has the machine, what it lets through, answers to requests."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, cast

import numpy as np
import pytest
from lhdmap.executor.notes import Note
from lhdmap.guidance.directive import Directive, path_of
from lhdmap.loading.assistance import ABORT, GO_ON, Request
from lhdmap.loading.moment import LoadingInput, LoadingOutput, Mission, Target
from lhdmap.loading.signals import Pedals
from lhdmap.loading.states import State
from lhdmap.loading.task import LoadingTask
from lhdmap.messages import FloatArray, Joints, Tachometer
from lhdmap.replay.journal import Event, Journal
from lhdmap.replay.process import (
    APPROACH,
    DIRECTIVE,
    LOADING,
    MACHINE_SAYS,
    MISSION,
    ORDERS,
    PEDALS,
    POSE,
    STATION_SAYS,
    Outgoing,
    Received,
)
from lhdmap.replay.processes.feed import JOINTS, TACHOMETER
from lhdmap.replay.processes.load import Loads, draw_point_of, mouth_of
from lhdmap.replay.processes.told import Asked, Health, Orders, Word
from lhdmap.simulation.history import START_NS

TICK_NS = 20_000_000
IDLE = LoadingOutput(State.IDLE)
LOOKS = LoadingOutput(State.IDENTIFICATION)
TARGET = Target(np.array([[10.0, -2.0], [10.0, 2.0]]), np.array([10.0, 0.0]), 0.0, START_NS)
DIGS = LoadingOutput(State.EXCAVATION, "dig", pedals=Pedals(0.5), target=TARGET, attempts=1)


def way() -> Directive:
    line = np.column_stack([np.arange(0.0, 20.0, 0.5), np.zeros(40)])
    path = path_of(line, 2.0)
    return Directive(0, 1, path, float(path[-1, -1]))


class NowStub(NamedTuple):
    """What of perception's pose the feed reads."""

    stamp_ns: int
    T_odom_base: FloatArray


class Scripted:
    """A loading task that says what it is told to, and keeps what it hears."""

    def __init__(self) -> None:
        self.out = IDLE
        self.heard: list[LoadingInput] = []

    def update(self, given: LoadingInput) -> LoadingOutput:
        self.heard.append(given)
        return self.out


class Bench:
    def __init__(self, taught: Directive | None) -> None:
        self.task, self.journal, self.lines = Scripted(), Journal(), list[Event]()
        self.journal.listeners.append(self.lines.append)
        self.process = Loads(cast("LoadingTask", self.task), taught, self.journal.of("loading"))
        self.now_ns = START_NS

    def turn(self, out: LoadingOutput, *told: tuple[str, Any]) -> dict[str, Outgoing]:
        self.now_ns += TICK_NS
        self.task.out = out
        said = self.process.step(self.now_ns, [Received(topic, self.now_ns, one) for topic, one in told])
        return {one.topic: one for one in said}

    def heard(self) -> LoadingInput:
        return self.task.heard[-1]


def orders(loading: int) -> tuple[str, Orders]:
    return ORDERS, Orders(START_NS, 1, "DP1", loaded=False, loading=loading)


def test_without_orders_the_machine_is_not_its_own() -> None:
    bench = Bench(None)
    assert set(bench.turn(LOOKS)) == {LOADING}
    assert bench.heard().mission is None


def test_with_orders_navigation_goes_through_it() -> None:
    bench, asked = Bench(None), way()
    said = bench.turn(LOOKS._replace(directive=asked), orders(3), (APPROACH, Asked(START_NS, asked, "driving")))
    assert bench.heard().mission == Mission(3)
    assert bench.heard().approach is asked
    directive = said[DIRECTIVE].message
    assert (directive.directive.stamp_ns, directive.cause) == (bench.now_ns, State.IDENTIFICATION.value)
    assert said[LOADING].message.number == 3
    stamps = [bench.now_ns] + [bench.now_ns for _ in range(10) if DIRECTIVE in bench.turn(LOOKS)]
    assert np.diff(stamps).tolist() == [100_000_000, 100_000_000]  # a directive each 100 ms, not each turn


def test_while_it_digs_the_pile_is_no_obstacle() -> None:
    bench = Bench(None)
    said = bench.turn(DIGS, orders(1))
    assert said[PEDALS].message.pedals.propel == 0.5
    np.testing.assert_allclose(said[PEDALS].message.touched_m, mouth_of(TARGET))
    np.testing.assert_allclose(said[DIRECTIVE].message.touched_m, mouth_of(TARGET))
    assert bench.turn(IDLE, orders(0)).keys() == {LOADING}


def test_up_to_the_pile_guidance_takes_its_banks_for_no_walls_but_the_guard_does() -> None:
    bench = Bench(None)
    nears = LoadingOutput(State.POSITIONING, "approach", directive=way(), target=TARGET)
    asked = bench.turn(nears, orders(1))[DIRECTIVE].message
    np.testing.assert_allclose(asked.pile_m, mouth_of(TARGET))
    assert asked.touched_m is None
    looks = Bench(None).turn(LOOKS._replace(target=TARGET), orders(1))[DIRECTIVE].message
    assert looks.pile_m is None


def test_the_mouth_reaches_before_the_toe_and_behind_it() -> None:
    corners = mouth_of(TARGET)
    assert corners[:, 0].min() < 9.0
    assert corners[:, 0].max() > 15.0
    assert np.abs(corners[:, 1]).max() == pytest.approx(2.1)
    area = 0.5 * float(np.sum(corners[:, 0] * np.roll(corners[:, 1], -1) - np.roll(corners[:, 0], -1) * corners[:, 1]))
    assert area > 0.0  # counterclockwise


@pytest.mark.parametrize(("word", "kind"), [({"go_on": True}, GO_ON), ({"gave_up": "enough"}, ABORT)])
def test_an_answer_names_the_open_request(word: dict[str, Any], kind: str) -> None:
    bench = Bench(None)
    bench.turn(LOOKS, orders(1), (STATION_SAYS, Word(START_NS, **word)))
    assert bench.heard().answer is None  # nothing was asked
    request = Request(4, START_NS, "loading", "excavation", "no fill", (), {}, "load by hand")
    said = bench.turn(LOOKS._replace(state=State.LOADING_ASSISTANCE, request=request))
    assert said[LOADING].message.request == request
    bench.turn(LOOKS, (STATION_SAYS, Word(START_NS, **word)))
    assert bench.heard().answer is not None
    answer = bench.heard().answer
    assert answer is not None
    assert (answer.number, answer.kind) == (4, kind)
    bench.turn(LOOKS)
    assert bench.heard().answer is None  # once


def test_an_emergency_stays_until_it_is_released() -> None:
    bench = Bench(None)
    bench.turn(LOOKS, (STATION_SAYS, Word(START_NS, emergency="button")))
    bench.turn(LOOKS, (STATION_SAYS, Word(START_NS)))
    assert bench.heard().emergency
    bench.turn(LOOKS, (STATION_SAYS, Word(START_NS, release=True)))
    assert not bench.heard().emergency


def test_on_a_taught_way_the_mission_begins_once_the_pose_has_held_for_a_second() -> None:
    bench, taught = Bench(way()), way()
    joints = Joints(START_NS, {"articulation": 0.0, "boom_lift": 0.0, "bucket_tilt": 0.0}, {})
    pose = NowStub(START_NS, np.eye(4))
    bench.turn(IDLE, (MACHINE_SAYS, Health(START_NS, True, "autonomous", True, ())))
    assert bench.heard().mission is None
    bench.turn(IDLE, (JOINTS, joints), (TACHOMETER, Tachometer(START_NS, 0.0)), (POSE, pose))
    turns = [bench.heard().mission is not None for _ in range(60) if bench.turn(IDLE) is not None]
    assert turns.index(True) * TICK_NS * 1e-9 == pytest.approx(1.0, abs=0.05)
    x, y = draw_point_of(taught)
    assert (x, y) == pytest.approx((float(taught.path[-1, 0]) + 7.5, 0.0))
    assert bench.heard().mission == Mission(1, (x, y))
    assert bench.turn(LoadingOutput(State.DONE))[MISSION].message.text == "done"


def test_the_journal_has_states_and_the_fill_its_deviation() -> None:
    bench = Bench(None)
    began = Note("state", State.CHARGING.value, State.EXCAVATION.value, "toe")
    notes = (began, Note("weighed", cause="shaken", values={"fill_std": 0.03}))
    said = bench.turn(DIGS._replace(notes=notes, fill=0.9), orders(1))
    assert [(one.event, one.after or one.cause) for one in bench.lines] == [
        ("state", "excavation"),
        ("weighed", "shaken"),
    ]
    assert said[LOADING].message.fill_std == pytest.approx(0.03)
    assert math.isnan(Bench(None).turn(IDLE)[LOADING].message.fill_std)

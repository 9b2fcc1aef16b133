"""Executives without a simulator: what they hear becomes a mission's input, what the mission asks becomes orders."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from lhdmap.driving.bodies import bodies_of
from lhdmap.haulage.mission_io import Buckets, MissionInput, MissionOutput
from lhdmap.haulage.records import Cycle, Interval, Phase
from lhdmap.haulage.states import Event, State
from lhdmap.loading.states import State as Loading
from lhdmap.machine import Machine
from lhdmap.messages import Joints, Text
from lhdmap.navigation.along import Located
from lhdmap.navigation.presence import Presence
from lhdmap.navigation.progress import Allowed
from lhdmap.replay.journal import Event as Line
from lhdmap.replay.journal import Journal
from lhdmap.replay.process import (
    CYCLE,
    DUMPING,
    LOADING,
    LOCATED,
    MACHINE_SAYS,
    MISSION,
    NAVIGATING,
    ORDERS,
    POSE,
    SITE_POSE,
    STATION_SAYS,
    Outgoing,
    Process,
    Received,
)
from lhdmap.replay.processes.executive import Executive, SharedMap
from lhdmap.replay.processes.feed import JOINTS
from lhdmap.replay.processes.ordered import OrderedNavigation, straight_left_m
from lhdmap.replay.processes.site_executive import SiteExecutive
from lhdmap.replay.processes.told import DumpingNow, Health, LoadingNow, Navigating, Orders, Word
from lhdmap.simulation.history import START_NS

from tests.haulage.plans import map_of_plan

TICK_NS = 100_000_000
TO_LOAD = MissionOutput(State.ROAD, 0, Phase.TRAM, "DP1", False, 0, "", "go", "", False, "", 1, "T1", "")
AT_LOAD = TO_LOAD._replace(state=State.LOAD, phase=Phase.LOAD, goal="", task=1, begin="load", motion="stop")
TO_DUMP = TO_LOAD._replace(phase=Phase.HAUL, goal="OP1", loaded=True, task=1)
AT_DUMP = AT_LOAD._replace(state=State.DUMP, phase=Phase.DUMP, loaded=True, task=2, begin="dump")


class Scripted:
    """A mission task that says what it is told to, and keeps what it hears."""

    def __init__(self, out: MissionOutput) -> None:
        self.out = out
        self.heard: list[MissionInput] = []

    def update(self, given: MissionInput) -> MissionOutput:
        self.heard.append(given)
        return self.out


class Bench:
    """An executive that is told messages, turn by turn."""

    def __init__(self, process: Process, task: Scripted, lines: list[Line]) -> None:
        self.process, self.task, self.lines = process, task, lines
        self.now_ns = START_NS

    def turn(self, out: MissionOutput, *told: tuple[str, Any]) -> list[Outgoing]:
        self.now_ns += TICK_NS
        self.task.out = out
        inbox: Sequence[Received] = [Received(topic, self.now_ns, message) for topic, message in told]
        return list(self.process.step(self.now_ns, inbox))

    def orders(self, out: MissionOutput, *told: tuple[str, Any]) -> Orders:
        given = next(one.message for one in self.turn(out, *told) if one.topic == ORDERS)
        assert isinstance(given, Orders)
        return given

    @property
    def heard(self) -> MissionInput:
        return self.task.heard[-1]


def located(x_m: float = 3.0, status: str = "tracking") -> Located:
    return Located(START_NS, status, np.array([x_m, 1.0, 0.5]), np.zeros(3), np.eye(3) * 1e-4, 0.0)


class Control:
    """A drive that counts how often it is asked for a directive."""

    state, goal, reason, on_last_leg, left_m = "driving", "DP1", "", True, 20.0

    def __init__(self) -> None:
        self.steps, self.allowed = 0, Allowed()
        self.waits_for = ""

    def knows(self, located: Located) -> bool:
        return located.status == "tracking"

    def wait_for_place(self, _now_ns: int, goal: str, _located: Located, *, loaded: bool) -> None:
        self.waits_for = f"{goal}, {loaded}"

    def go(self, *_told: Any, **_more: Any) -> None:
        pass

    def step(self, *_told: Any) -> None:
        self.steps += 1


HEALTH = Health(START_NS, True, "autonomous", True, ())


@pytest.fixture
def underground() -> Bench:
    journal, lines, task = Journal(), list[Line](), Scripted(TO_LOAD)
    journal.listeners.append(lines.append)
    made = Executive(task, [Buckets("DP1", "OP1", 1)], map_of_plan("cycle"), 10.0, journal.of("mission"))
    bench = Bench(made, task, lines)
    assert bench.turn(TO_LOAD, (LOCATED, located())) == []  # nothing is asked before the machine has said how it is
    bench.turn(TO_LOAD, (MACHINE_SAYS, HEALTH))
    return bench


@pytest.fixture
def surface() -> Bench:
    journal, lines, task = Journal(), list[Line](), Scripted(TO_LOAD)
    journal.listeners.append(lines.append)
    bench = Bench(SiteExecutive(task, [Buckets("L1", "D1", 1)], 28.0, journal.of("mission")), task, lines)
    assert bench.turn(TO_LOAD) == []
    return bench


def navigating(number: int, left_m: float, state: str = "driving") -> tuple[str, Navigating]:
    return NAVIGATING, Navigating(START_NS, state, number, "DP1", "", left_m)


def loading(number: int, state: Loading, fill: float = 0.0, attempts: int = 1) -> tuple[str, LoadingNow]:
    return LOADING, LoadingNow(START_NS, number, state, "", attempts, fill, 0.05, None)


def test_another_goal_is_another_order_and_the_same_goal_is_not(underground: Bench) -> None:
    first = underground.orders(TO_LOAD)
    assert (first.goal, first.loaded, first.loading, first.dumping) == ("DP1", False, 0, 0)
    assert underground.orders(TO_LOAD).number == first.number
    assert underground.orders(TO_DUMP).number == first.number + 1


def test_the_pile_is_looked_for_while_the_machine_still_drives(underground: Bench) -> None:
    number = underground.orders(TO_LOAD).number
    assert underground.orders(TO_LOAD, navigating(number, 60.0)).loading == 0
    near = underground.orders(TO_LOAD, navigating(number, 20.0))
    assert (near.loading, near.goal, near.number) == (1, "DP1", number)
    underground.turn(TO_LOAD, loading(1, Loading.IDENTIFICATION))
    assert underground.heard.navigation.state == "driving"
    underground.turn(TO_LOAD, loading(1, Loading.CHARGING))
    assert underground.heard.navigation.state == "arrived"  # the loading task has the machine


def test_the_pile_is_not_looked_for_before_the_last_change_of_gear(underground: Bench) -> None:
    number = underground.orders(TO_LOAD).number
    turning = navigating(number, straight_left_m(20.0, last_leg=False))
    assert underground.orders(TO_LOAD, turning).loading == 0
    assert underground.orders(TO_LOAD, navigating(number, straight_left_m(20.0, last_leg=True))).loading == 1


@pytest.mark.parametrize(
    ("state", "number", "stepped"),
    [(Loading.IDENTIFICATION, 1, 1), (Loading.EXCAVATION, 1, 0), (Loading.EXCAVATION, 2, 1), (Loading.DONE, 1, 1)],
)
def test_navigation_does_not_count_a_machine_that_digs_as_stuck(state: Loading, number: int, stepped: int) -> None:
    control = Control()
    made = OrderedNavigation(control, Journal().of("navigation"))  # type: ignore[arg-type]
    said = [
        (JOINTS, Joints(START_NS, {"articulation": 0.0}, {"articulation": 0.0})),
        (POSE, SimpleNamespace(stamp_ns=START_NS, T_odom_base=np.eye(4))),
        (LOCATED, located()),
        (MACHINE_SAYS, HEALTH),
        (ORDERS, Orders(START_NS, 1, "DP1", loaded=False, loading=1)),
        loading(number, state),
    ]
    list(made.step(START_NS, [Received(topic, START_NS, message) for topic, message in said]))
    assert control.steps == stepped


def test_an_order_without_a_known_place_is_taken_up_and_not_forgotten() -> None:
    """The mission stood in silence to its end: navigation did not know of the order, and so could not ask for help."""
    control = Control()
    made = OrderedNavigation(control, Journal().of("navigation"))  # type: ignore[arg-type]
    said = [
        (JOINTS, Joints(START_NS, {"articulation": 0.0}, {"articulation": 0.0})),
        (POSE, SimpleNamespace(stamp_ns=START_NS, T_odom_base=np.eye(4))),
        (LOCATED, located(status="unknown")),
        (MACHINE_SAYS, HEALTH),
        (ORDERS, Orders(START_NS, 1, "OP1", loaded=True)),
    ]
    out = list(made.step(START_NS, [Received(topic, START_NS, message) for topic, message in said]))
    assert control.waits_for == "OP1, True"
    assert [one.message.number for one in out if one.topic == NAVIGATING] == [1]


def test_a_report_of_another_task_is_not_heard(underground: Bench) -> None:
    number = underground.orders(TO_LOAD).number
    underground.turn(TO_LOAD, navigating(number, 20.0))
    underground.turn(AT_LOAD, loading(7, Loading.DONE, 0.9))
    assert underground.heard.loading.state == ""
    underground.turn(AT_LOAD, loading(1, Loading.DONE, 0.9, attempts=2))
    told = underground.heard.loading
    assert (told.task, told.state, told.attempts) == (1, "done", 2)
    assert told.mass_t == pytest.approx(9.0)


def test_dumping_is_begun_by_its_number_and_its_report_counts_by_it(underground: Bench) -> None:
    assert underground.orders(AT_DUMP).dumping == 2
    underground.turn(AT_DUMP, (DUMPING, DumpingNow(START_NS, 1, "done")))
    assert underground.heard.dumping.state == ""
    underground.turn(AT_DUMP, (DUMPING, DumpingNow(START_NS, 2, "failed", "time limit")))
    assert (underground.heard.dumping.state, underground.heard.dumping.reason) == ("failed", "time limit")


def test_a_place_that_is_not_known_is_not_told(underground: Bench) -> None:
    underground.turn(TO_LOAD, (LOCATED, located(status="lost")))
    assert underground.heard.pose_map is None
    underground.turn(TO_LOAD, (LOCATED, located(4.0)))
    assert underground.heard.pose_map == (4.0, 1.0, 0.5)


def test_the_station_stops_answers_and_ends(underground: Bench) -> None:
    underground.turn(TO_LOAD, (STATION_SAYS, Word(START_NS, emergency="button", go_on=True)))
    assert (underground.heard.estop, underground.heard.answer) == (True, "go_on")
    underground.turn(TO_LOAD, (STATION_SAYS, Word(START_NS)))
    assert (underground.heard.estop, underground.heard.answer) == (True, "")
    underground.turn(TO_LOAD, (STATION_SAYS, Word(START_NS, release=True, gave_up="enough")))
    assert (underground.heard.estop, underground.heard.abort) == (False, True)


def among_others(task: Scripted, free: set[str]) -> Bench:
    """Return the executive of a machine that shares the map with others, and may be in some nodes."""
    machine, topology = Machine(), map_of_plan("cycle")
    shares = SharedMap(lambda: frozenset(free), Presence(topology, bodies_of(machine), machine))
    return Bench(Executive(task, [], topology, 10.0, Journal().of("mission"), shares=shares), task, [])


def test_a_machine_among_others_is_told_where_it_may_be() -> None:
    task = Scripted(TO_LOAD)
    orders = among_others(task, {"T1.1", "I1"}).orders(TO_LOAD, (LOCATED, located()), (MACHINE_SAYS, HEALTH))
    assert orders.free == frozenset({"T1.1", "I1"})


@pytest.mark.parametrize(("its_own", "begun"), [({"T1.1"}, 0), ({"T1.1", "I1", "T1.2"}, 1)])
def test_loading_is_not_begun_before_the_draw_point_is_its_own(its_own: set[str], begun: int) -> None:
    bench = among_others(Scripted(TO_LOAD), its_own)
    number = bench.orders(TO_LOAD, (LOCATED, located()), (MACHINE_SAYS, HEALTH)).number
    assert bench.orders(TO_LOAD, navigating(number, 20.0)).loading == begun


@pytest.mark.parametrize(("x_m", "said"), [(20.0, "driving"), (45.0, "arrived")])
def test_a_machine_among_others_is_at_its_draw_point_by_its_place_not_by_who_drives_it(x_m: float, said: str) -> None:
    """The loading task takes the machine over some way before; sections are given back by where it truly is."""
    bench = among_others(Scripted(TO_LOAD), {"T1.1", "I1", "T1.2"})
    number = bench.orders(TO_LOAD, (LOCATED, located(5.0)), (MACHINE_SAYS, HEALTH)).number
    task = bench.orders(TO_LOAD, navigating(number, 20.0)).loading
    bench.turn(TO_LOAD, loading(task, Loading.POSITIONING), (LOCATED, located(x_m)))
    assert (bench.heard.navigation.state, bench.heard.navigation.goal) == (said, "DP1")
    assert ("T1.2" in bench.heard.inside) is (said == "arrived")


@pytest.mark.parametrize("bench", ["underground", "surface"])
def test_both_write_the_same_lines_and_say_how_far_it_is(bench: str, request: pytest.FixtureRequest) -> None:
    made: Bench = request.getfixturevalue(bench)
    pose = (SITE_POSE, type("Pose", (), {"x_m": 1.0, "y_m": 2.0, "heading_rad": 0.0})())
    cycle = Cycle("lhd", 1, "DP1", "OP1", (Interval(Phase.DUMP, 0, 1),), mass_t=9.0)
    made.turn(TO_DUMP, *([pose] if bench == "surface" else []))
    said = made.turn(AT_DUMP._replace(cycle=cycle, events=(Event.DUMPED,), cause="why"))
    assert [one.message for one in said if one.topic == CYCLE] == [cycle]
    states = [one for one in made.lines if one.event == "state"]
    assert (states[-1].after, states[-1].cause, states[-1].values["place"]) == ("dump", "why", "T1")
    assert [one.cause for one in made.lines if one.event == "event"] == [Event.DUMPED.value]
    assert next(one for one in made.lines if one.event == "cycle").values["mass_t"] == 9.0
    done = made.turn(TO_LOAD._replace(state=State.IDLE, phase=Phase.IDLE, goal="", left=0))
    assert [one.message.text for one in done if one.topic == MISSION and isinstance(one.message, Text)] == ["done"]
    assert [one for one in made.turn(made.task.out) if one.topic == MISSION] == []


def test_help_on_a_site_is_asked_for_answered_and_begins_the_drive_anew(surface: Bench) -> None:
    pose = (SITE_POSE, type("Pose", (), {"x_m": 1.0, "y_m": 2.0, "heading_rad": 0.0})())
    before = surface.orders(TO_LOAD, pose).number
    asks = TO_LOAD._replace(state=State.ASSIST, phase=Phase.ASSISTANCE, asks="no way to the dock")
    said = surface.turn(asks)
    health = next(one.message for one in said if one.topic == MACHINE_SAYS)
    assert (health.asks, health.armed, health.standing) == ("no way to the dock", True, True)
    assert surface.orders(asks).number == before
    answered = surface.orders(asks, (STATION_SAYS, Word(START_NS, go_on=True)))
    assert surface.heard.answer == "go_on"
    assert (answered.number, answered.goal) == (before + 1, "DP1")
    on = surface.orders(TO_LOAD, (STATION_SAYS, Word(START_NS, go_on=True)))  # the link is late
    assert on.number == before + 1

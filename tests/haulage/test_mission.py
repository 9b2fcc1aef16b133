"""Missions on the paper's site and on a map: stages, holds, help, closed ways, orders one after the other, bad input."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.errors import UsageError
from lhdmap.haulage.mission import MissionTask
from lhdmap.haulage.mission_io import Buckets, MissionInput, Navigation, Report
from lhdmap.haulage.of_map import layout_of_map
from lhdmap.haulage.records import Cycle, Phase
from lhdmap.haulage.states import Event, State

from tests.haulage.drives import DUMP_S, LOAD_S, TICK_NS, Drive
from tests.haulage.plans import map_of_plan
from tests.haulage.sites import hejase

ORDER = (Buckets("L1", "D1", 2),)


@pytest.fixture
def drive() -> Drive:
    return Drive(hejase())


def until(drive: Drive, state: State, **given: Any) -> None:
    for _ in range(20_000):
        if drive.tick(ORDER, **given).state == state:
            return
    raise AssertionError(f"never in {state}")


def test_two_buckets_and_home(drive: Drive) -> None:
    last = drive.run(ORDER, 3000.0)
    assert last.state == State.IDLE
    assert [one.number for one in drive.cycles] == [1, 2]
    for one in drive.cycles:
        assert one.seconds(Phase.LOAD) == pytest.approx(LOAD_S, abs=0.3)
        assert one.seconds(Phase.DUMP) == pytest.approx(DUMP_S, abs=0.3)
        assert (one.load, one.dump, one.mass_t, one.fill, one.attempts) == ("L1", "D1", 10.0, 0.91, 1)
        assert one.seconds(Phase.HAUL) > 100.0
    first, second = drive.cycles
    assert first.seconds(Phase.TRAM) > 0.0 == first.seconds(Phase.RETURN)
    assert second.seconds(Phase.RETURN) > 0.0 == second.seconds(Phase.TRAM)


def test_intervals_follow_each_other_without_a_gap_and_add_up(drive: Drive) -> None:
    drive.run(ORDER, 3000.0)
    rest = drive.task.rest()
    assert rest is not None
    parts = [part for one in (*drive.cycles, rest) for part in one.intervals]
    assert all(a.to_ns == b.from_ns for a, b in pairwise(parts))
    assert parts[0].from_ns == 1_000_000_000 + TICK_NS
    assert sum(part.distance_m for part in parts) == pytest.approx(drive.odometer_m, rel=1e-9)


def test_an_emergency_stop_holds_and_the_mission_goes_on_after_the_reset(drive: Drive) -> None:
    until(drive, State.ROAD)
    stopped = drive.tick(ORDER, estop=True)
    assert (stopped.motion, stopped.goal, stopped.phase) == ("stop", "", Phase.STOPPED)
    for _ in range(50):
        assert drive.tick(ORDER, estop=True, obstacle=True).phase == Phase.STOPPED
    assert drive.tick(ORDER, obstacle=True).phase == Phase.OBSTACLE  # no tick of motion between the two
    assert drive.tick(ORDER).motion == "go"
    assert drive.run(ORDER, 3000.0).state == State.IDLE
    assert len(drive.cycles) == 2


def test_without_a_permit_the_machine_goes_to_the_end_of_its_edge_and_waits(drive: Drive) -> None:
    until(drive, State.ROAD)
    output = drive.tick(ORDER, permit=False)
    assert output.motion == "to_end"
    end = drive.layout.edges[drive.task.status.edge].end
    assert output.goal == end
    drive.s_m = drive.layout.edges[drive.task.status.edge].length_m + 0.5  # it has driven there
    drive.tick(ORDER, permit=False)
    waits = drive.tick(ORDER, permit=False)
    assert (waits.state, waits.phase) == (State.ROAD, Phase.TRAFFIC)
    assert drive.tick(ORDER, permit=True).state == State.JUNCTION_OFF
    assert drive.run(ORDER, 3000.0).state == State.IDLE


def test_a_busy_point_is_waited_for_in_the_queue(drive: Drive) -> None:
    until(drive, State.QUEUE, point_free=False)
    output = drive.tick(ORDER, point_free=False)
    assert (output.goal, output.phase) == ("A1 queue", Phase.QUEUE_LOAD)
    assert drive.tick(ORDER, point_free=True).state == State.DOCK


def test_loading_that_fails_is_tried_again_and_then_helped_with(drive: Drive) -> None:
    drive.fails = ["failed", "failed", "failed"]
    until(drive, State.ASSIST)
    assert drive.events.count(Event.LOAD_FAILED) == 3
    output = drive.tick(ORDER, answer="done")
    assert output.loaded
    assert output.state == State.AREA_OUT
    assert drive.run(ORDER, 3000.0).state == State.IDLE
    assert len(drive.cycles) == 2


def test_help_of_loading_itself_counts_as_assistance(drive: Drive) -> None:
    until(drive, State.LOAD)
    helped = drive.tick(ORDER, loading=Report(drive.number, "assistance", reason="boulder"))
    assert (helped.state, helped.phase) == (State.LOAD, Phase.ASSISTANCE)


def test_a_report_of_the_task_before_does_not_count(drive: Drive) -> None:
    until(drive, State.LOAD)
    assert drive.tick(ORDER, loading=Report(drive.number - 1, "done", 9.0)).state == State.LOAD


def test_a_lost_place_asks_for_help_and_goes_on_where_the_machine_is(drive: Drive) -> None:
    until(drive, State.ROAD)
    lost = drive.tick(ORDER, navigation=Navigation("assistance", "L1", "place not known for long"))
    assert (lost.state, lost.asks) == (State.ASSIST, "place not known for long")
    edge = next(k for k, one in enumerate(drive.layout.edges) if (one.start, one.end) == ("A1 in", "A1 queue"))
    line = drive.layout.edges[edge].line_m
    assert line is not None
    (x, y), (u, v) = line[5, :2], line[6, :2] - line[5, :2]
    output = drive.tick(ORDER, answer="go_on", pose_map=(float(x), float(y), math.atan2(v, u)))
    assert drive.task.status.edge == edge
    assert output.state == State.AREA_IN


def test_a_closed_dock_is_waited_for_before_the_queue_point_is_left(drive: Drive) -> None:
    until(drive, State.AREA_IN)
    for _ in range(400):
        output = drive.tick(ORDER, closed=("L1",))
    assert output.phase == Phase.NO_ROUTE
    assert output.motion != "go"
    assert drive.run(ORDER, 3000.0).state == State.IDLE
    assert len(drive.cycles) == 2


def test_abort_keeps_the_load_and_the_next_order_dumps_it_first(drive: Drive) -> None:
    until(drive, State.LOAD)
    until(drive, State.ROAD)
    assert drive.tick(ORDER, abort=True).state == State.ABORTED
    again = (*ORDER, Buckets("L1", "D1", 1))
    output = drive.tick(again)
    assert output.loaded
    assert output.goal == "D1"
    assert drive.run(again, 3000.0).state == State.IDLE
    assert [one.finished for one in drive.cycles] == [True]


def test_orders_follow_each_other_without_a_way_home() -> None:
    drive = Drive(hejase())
    drive.run((Buckets("L1", "D1", 1), Buckets("L1", "D1", 2)), 4000.0)
    assert len(drive.cycles) == 3
    assert drive.states.count(State.IDLE) == 1


def test_service_is_done_after_the_dump_and_the_mission_goes_on(drive: Drive) -> None:
    until(drive, State.LOAD)
    until(drive, State.REFUEL, service_due=True)
    assert len(drive.cycles) == 1
    assert drive.tick(ORDER, service_due=True).phase == Phase.REFUEL
    assert drive.run(ORDER, 3000.0).state == State.IDLE
    assert len(drive.cycles) == 2


def test_a_dock_that_is_missed_is_tried_again_from_the_queue_point(drive: Drive) -> None:
    until(drive, State.DOCK)
    missed = drive.tick(ORDER, navigation=Navigation("missed", "L1"))
    assert (missed.state, missed.goal) == (State.QUEUE, "A1 queue")
    for _ in range(20):
        assert drive.tick(ORDER, navigation=Navigation("driving", "A1 queue")).state == State.QUEUE
    assert drive.tick(ORDER, navigation=Navigation("arrived", "A1 queue")).state == State.DOCK
    drive.tick(ORDER, navigation=Navigation("missed", "L1"))
    drive.tick(ORDER, navigation=Navigation("arrived", "A1 queue"))
    helped = drive.tick(ORDER, navigation=Navigation("missed", "L1"))
    assert (helped.state, drive.events.count(Event.DOCK_MISSED)) == (State.ASSIST, 3)


def test_help_that_navigation_got_of_itself_needs_no_other_answer(drive: Drive) -> None:
    until(drive, State.ROAD)
    for _ in range(30):
        helped = drive.tick(ORDER, navigation=Navigation("assistance", "L1", "no other route"))
        assert (helped.state, helped.phase, helped.motion) == (State.ASSIST, Phase.ASSISTANCE, "stop")
    assert helped.goal == "D1"
    assert drive.tick(ORDER).state == State.ROAD
    drive.run(ORDER, 3000.0)
    assert sum(one.seconds(Phase.ASSISTANCE) for one in drive.cycles) == pytest.approx(3.0, abs=0.2)


def test_loading_that_was_given_up_is_not_gone_on_with_by_itself(drive: Drive) -> None:
    drive.fails = ["failed", "failed", "failed"]
    until(drive, State.ASSIST)
    for _ in range(30):
        assert drive.tick(ORDER).state == State.ASSIST
    assert drive.tick(ORDER, answer="done", estop=True).state == State.ASSIST


@settings(deadline=None, max_examples=25)
@given(
    st.lists(st.sampled_from(["estop", "obstacle", "no permit", "busy", "nan", "frozen", "help", "ok"]), max_size=40)
)
def test_whatever_is_told_time_is_whole_and_the_bucket_is_dumped_at_a_dump(told: list[str]) -> None:
    drive = Drive(hejase())
    words: dict[str, dict[str, Any]] = {
        "estop": {"estop": True}, "obstacle": {"obstacle": True}, "no permit": {"permit": False}, "ok": {},
        "busy": {"point_free": False}, "nan": {"pose_map": (math.nan, 0.0, 0.0), "odometer_m": math.nan},
        "frozen": {"pose_map": (0.0, 0.0, 0.0)}, "help": {"answer": "go_on"},
    }  # fmt: skip
    for word in told:
        for _ in range(30):
            output = drive.tick(ORDER, **words[word])
            assert not (output.begin == "dump" and not output.loaded)
            assert not (output.begin == "load" and output.loaded)
    rest = drive.task.rest()
    parts = [part for one in (*drive.cycles, *((rest,) if rest else ())) for part in one.intervals]
    assert all(a.to_ns == b.from_ns for a, b in pairwise(parts))


def test_a_mission_on_a_map_follows_the_nodes_that_localization_tells() -> None:
    layout = layout_of_map(map_of_plan("level"), "level")
    task = MissionTask(layout)
    seen, now_ns = [], 0
    nodes = [layout.edges[k].node for k in layout.route("P1", "DP1") or []]
    for node in nodes:
        now_ns += TICK_NS
        output = task.update(
            MissionInput(now_ns, node=node, navigation=Navigation("driving"), orders=(Buckets("DP1", "OP1"),))
        )
        seen.append(output.state)
        assert output.goal == "DP1"
    assert seen[-1] == State.DOCK
    output = task.update(
        MissionInput(
            now_ns + TICK_NS, node=nodes[-1], navigation=Navigation("arrived", "DP1"), orders=(Buckets("DP1", "OP1"),)
        )
    )
    assert (output.state, output.begin, output.task) == (State.LOAD, "load", 1)
    now_ns += 2 * TICK_NS
    output = task.update(
        MissionInput(
            now_ns,
            node=nodes[-1],
            navigation=Navigation("arrived", "DP1"),
            loading=Report(1, "done", 9.5),
            orders=(Buckets("DP1", "OP1"),),
        )
    )
    assert (output.goal, output.loaded, output.phase) == ("OP1", True, Phase.HAUL)
    output = task.update(
        MissionInput(now_ns + TICK_NS, navigation=Navigation("arrived", "OP1"), orders=(Buckets("DP1", "OP1"),))
    )
    assert (output.state, output.begin, output.task) == (State.DUMP, "dump", 2)
    output = task.update(MissionInput(now_ns + 2 * TICK_NS, dumping=Report(2, "done"), orders=(Buckets("DP1", "OP1"),)))
    assert output.cycle is not None
    assert output.cycle.mass_t == 9.5
    assert output.goal == "P1"


def test_a_closed_tunnel_is_gone_round() -> None:
    layout = layout_of_map(map_of_plan("level"), "level")
    task = MissionTask(layout)
    shortest = layout.route("DP1", "OP1")
    assert shortest is not None
    closed = next(layout.edges[k].node for k in shortest if layout.edges[k].kind == State.ROAD)

    def told(now_ns: int, **more: Any) -> State:
        orders = (Buckets("DP1", "OP1"),)
        return task.update(MissionInput(now_ns, orders=orders, closed=(closed,), **more)).state

    assert told(1, navigation=Navigation("arrived", "DP1")) == State.LOAD
    told(2, loading=Report(1, "done"))
    nodes = [layout.edges[task.status.edge].node]
    for now_ns in range(3, 60):
        following = task.machine.next_edge(task.status)
        if following is None:
            break
        nodes.append(layout.edges[following].node)
        last = told(now_ns, node=nodes[-1], navigation=Navigation("driving"))
    assert last == State.DOCK
    assert closed not in nodes
    assert len(nodes) > len(shortest)


def test_orders_are_named_in_their_cycles_and_must_be_on_the_map() -> None:
    layout = layout_of_map(map_of_plan("level"), "level")
    task, orders = MissionTask(layout), (Buckets("DP1", "OP1"), Buckets("DP5", "OP2"))
    at = "DP1"
    cycles: list[Cycle] = []
    for now_ns in range(1, 12):
        done = Report(task.update(MissionInput(now_ns, orders=orders)).task, "done")
        output = task.update(
            MissionInput(now_ns, navigation=Navigation("arrived", at), orders=orders, loading=done, dumping=done)
        )
        at, cycles = output.goal or at, cycles + ([output.cycle] if output.cycle else [])
    assert [(one.load, one.dump) for one in cycles] == [("DP1", "OP1"), ("DP5", "OP2")]
    with pytest.raises(UsageError, match="'DP11' is no point to load; did you mean"):
        task.update(MissionInput(99, orders=(*orders, Buckets("DP11", "OP1"))))

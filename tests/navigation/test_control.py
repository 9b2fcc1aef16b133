"""Navigation control: legs one after the other, stuck and backing up, closed ways, a place that is not known, other modes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lhdmap.navigation.control import ARRIVED, ASSISTANCE, BACKING, DRIVING, HALTED, RESTING
from lhdmap.topology.model import Waypoint

from tests.movement.mines import with_connection
from tests.navigation.drives import Rod
from tests.topology.maps import connection, ladder, pose


def at(x: float, y: float, heading_deg: float) -> np.ndarray:
    return np.array([x, y, math.radians(heading_deg)])


def test_it_drives_to_the_goal_and_says_so() -> None:
    rod = Rod(at(6.0, 0.0, 0.0), ladder())
    rod.go("t1.end", "t1.start")
    assert rod.run() == ARRIVED
    assert rod.pose == pytest.approx([54.0, 0.0, 0.0], abs=0.3)
    assert {gear for gear, *_ in rod.places} == {1}


def test_a_start_anywhere_in_a_tunnel_takes_the_nearer_end() -> None:
    rod = Rod(at(40.0, 0.3, 0.0), ladder())
    rod.go("t2.end")
    assert rod.said[0][2]["begin"] == "t1.end" or rod.control.legs[0].begin in ("t1.end", "t1.start")
    assert rod.run() == ARRIVED
    assert min(x for _, x, _ in rod.places) > 35.0  # not back to the other end
    assert rod.pose[:2] == pytest.approx([60.0, 6.0], abs=0.4)


def test_round_a_sharp_corner_it_changes_gear_once_with_a_rest() -> None:
    rod = Rod(at(10.0, 0.0, 180.0), with_connection(ladder(), "i1.t1", "i1.t2", feasible=False))
    rod.go("t2.start")
    assert [leg.gear for leg in rod.control.legs] == [1, -1]
    assert rod.run() == ARRIVED
    assert RESTING in rod.states
    assert rod.states.count(DRIVING) >= 2


def test_stuck_it_backs_up_twice_then_takes_another_way() -> None:
    rod = Rod(at(6.0, 0.0, 0.0), ladder(), stops=lambda there: 29.0 < there[0] < 31.0 and abs(there[1]) < 3.0)
    rod.go("t2.end", "t1.start")
    assert rod.control.legs[0].targets[0].point == "t1.end"
    state = rod.run(600.0)
    assert rod.states.count(BACKING) == 2
    assert "closed" in rod.states
    assert state == ARRIVED, rod.control.reason
    assert rod.pose[:2] == pytest.approx([60.0, 6.0], abs=4.0)
    assert max(y for _, _, y in rod.places) > 25.0  # by the detour


def test_without_another_way_it_asks_and_goes_on_once_it_is_free() -> None:
    topology = ladder()
    rod = Rod(at(0.0, -6.0, -90.0), topology, stops=lambda there: there[1] < -15.0)
    rod.go("DP1", "t3.start")
    assert rod.run(400.0) == ASSISTANCE
    assert rod.states.count(BACKING) == 2
    assert "no route" in rod.control.reason
    rod.stops = lambda _: False
    rod.control.go_on(rod.located())
    assert rod.control.state == ASSISTANCE  # the way is still closed
    rod.control.go_on(rod.located(), reopened=True)
    assert rod.run() == ARRIVED


def test_what_has_come_into_the_way_is_waited_for() -> None:
    rod = Rod(at(6.0, 0.0, 0.0), ladder())
    rod.go("t1.end", "t1.start")
    rod.stops = lambda there: there[0] > 20.0
    rod.control.allowed.sight_m = 1.0
    rod.run(8.0 + rod.settings.wait_s - 3.0)
    assert rod.states.count(BACKING) == 0
    rod.stops = lambda _: False
    assert rod.run() == ARRIVED
    assert rod.states.count(BACKING) == 0


def test_a_narrow_pass_in_sight_is_not_waited_for() -> None:
    rod = Rod(at(6.0, 0.0, 0.0), ladder(), stops=lambda there: there[0] > 20.0)
    rod.go("t1.end", "t1.start")
    rod.control.allowed.sight_m = 20.0
    assert rod.run(8.0 + rod.settings.stuck_s + 1.0, until=BACKING) == BACKING


def test_a_machine_that_may_not_move_is_not_stuck() -> None:
    rod = Rod(at(6.0, 0.0, 0.0), ladder(), stops=lambda _: True)
    rod.go("t1.end", "t1.start")
    rod.control.allowed.may_move = False
    assert rod.run(60.0) == DRIVING


def test_it_halts_where_the_place_is_not_known_and_goes_on_once_it_is() -> None:
    rod = Rod(at(6.0, 0.0, 0.0), ladder())
    rod.go("t1.end", "t1.start")
    rod.run(5.0)
    rod.status = "lost"
    assert rod.step() is None
    assert rod.control.state == HALTED
    rod.run(3.0)
    rod.status = "tracking"
    assert rod.run() == ARRIVED
    assert rod.states.count(ASSISTANCE) == 0


def test_it_asks_where_the_place_stays_unknown() -> None:
    rod = Rod(at(6.0, 0.0, 0.0), ladder())
    rod.go("t1.end", "t1.start")
    rod.status = "lost"
    assert rod.run(60.0) == ASSISTANCE
    assert "place not known" in rod.control.reason


@pytest.mark.parametrize(("status", "ends"), [("tracking", ARRIVED), ("unknown", ASSISTANCE)])
def test_a_goal_given_while_the_place_is_not_known_waits_for_it_and_asks_for_help_after_some_time(
    status: str, ends: str
) -> None:
    rod = Rod(at(6.0, 0.0, 0.0), ladder(), status="unknown")
    rod.control.wait_for_place(rod.now_ns, "t1.end", rod.located())
    assert rod.run(5.0) == HALTED
    rod.status = status
    assert rod.run(120.0) == ends
    assert ("place not known" in rod.control.reason) == (ends == ASSISTANCE)


def test_a_missed_end_is_an_overrun() -> None:
    rod = Rod(at(6.0, 0.0, 0.0), ladder())
    rod.go("t1.end", "t1.start")
    rod.run(2.0)
    for _ in range(2000):  # the place on the map stands still while the odometry goes on
        rod.now_ns += 100_000_000
        motion = rod.motion()
        rod.control.step(rod.now_ns, motion._replace(x_m=motion.x_m + rod.now_ns * 1e-9, speed_mps=1.0), rod.located())
        if rod.control.state == ASSISTANCE:
            break
    assert "overrun" in rod.control.reason


def test_another_goal_in_the_other_gear_rests_first() -> None:
    topology = ladder()
    goals = (*topology.waypoints, Waypoint("w2", "P1", "t1", pose(20.0, 0.0, 0.0), "park"))
    points = {**{one.id: one.pose for one in topology.access_points}, **{one.id: one.pose for one in goals}}
    more = [connection(points, "t1.start", "w2"), connection(points, "w2", "t1.end")]
    rod = Rod(at(6.0, 0.0, 0.0), replace(topology, waypoints=goals, connections=(*topology.connections, *more)))
    rod.go("t1.end", "t1.start")
    rod.run(12.0)
    assert rod.pose[0] > 25.0
    rod.go("w2")
    assert rod.control.state == RESTING
    assert rod.run() == ARRIVED
    assert rod.pose[:2] == pytest.approx([20.0, 0.0], abs=0.4)


def test_time_in_which_somebody_else_had_the_machine_is_no_sign_of_being_stuck() -> None:
    """A machine that had dug for half a minute was taken for stuck as it looked at its pile again."""
    rod = Rod(at(6.0, 0.0, 0.0), ladder(), stops=lambda there: there[0] > 20.0)
    rod.go("t1.end", "t1.start")
    rod.run(8.0)
    rod.now_ns += 30_000_000_000
    assert rod.run(0.5 * rod.settings.stuck_s, until=BACKING) == DRIVING
    assert rod.run(rod.settings.stuck_s, until=BACKING) == BACKING


def test_what_somebody_else_has_driven_is_no_overrun() -> None:
    """A machine that had gone to and fro before its pile asked for help as navigation had it again."""
    rod = Rod(at(6.0, 0.0, 0.0), ladder())
    rod.go("t1.end", "t1.start")
    rod.run(2.0)
    for _ in range(30):  # charges of 5 m, each by somebody else; navigation has it for a turn between them
        rod.now_ns += 5_000_000_000
        motion = rod.motion()
        rod.control.step(
            rod.now_ns, motion._replace(x_m=motion.x_m + 5.0 * (rod.now_ns // 5_000_000_000 % 2)), rod.located()
        )
    assert rod.control.state == DRIVING

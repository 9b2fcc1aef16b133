"""Stops of a simulated machine: before the queue ends, as far as the table says, on the path, latched."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from lhdmap.driving.model import drive_model
from lhdmap.driving.motion import Setpoint, Setpoints
from lhdmap.executor.limits import speed_bound
from lhdmap.executor.notes import Stop
from lhdmap.machine import Machine
from lhdmap.machine_sections import Brakes, Drive
from lhdmap.messages import Command

from tests.executor.bench import SECOND, STEP_S, Bench, bend_over_way, even, motion_of

FULL_KG = 11_000.0


@pytest.mark.parametrize("gear", [1, -1])
@pytest.mark.parametrize("load_kg", [0.0, FULL_KG])
@pytest.mark.parametrize("grade", [0.0, 0.1, -0.1])
@pytest.mark.parametrize("speed", [0.8, 2.0, 4.0])
def test_the_machine_stands_before_the_last_command(gear: int, load_kg: float, grade: float, speed: float) -> None:
    """Eq. (20), in both gears (errata: |u_v|)."""
    bench = Bench(load_kg=load_kg, grade=grade)
    bench.roll(gear * speed)
    bench.drive(4.0, lambda now: even(gear * speed, now))
    uphill = gear * grade > 0.0  # where the engine does not give every speed
    if grade == 0.0:
        assert gear * bench.state.speed_mps > 0.9 * speed
    end_ns = bench.state.time_ns + round(bench.executor.queue.left_s(bench.state.time_ns) * SECOND)
    assert bench.executor.state == "driving"
    bench.drive(6.0, until_rest=True)
    assert abs(bench.state.speed_mps) < 1e-3
    assert bench.state.time_ns <= end_ns
    if not uphill:
        assert end_ns - bench.state.time_ns < 0.9 * SECOND  # and not much before it has to
    bench.drive(1.5)
    assert bench.commands[-1].brake


@pytest.mark.parametrize("load_kg", [0.0, FULL_KG])
def test_a_short_queue_bounds_the_speed(load_kg: float) -> None:
    bench = Bench(load_kg=load_kg)
    bench.drive(8.0, lambda now: even(5.0, now, stages=7))  # 0.93 s
    bound = speed_bound(bench.model, 0.93, STEP_S)
    assert 0.5 < bound < bench.model.brake_mps2 * 0.93
    assert max(abs(one.speed_mps) for one in bench.states) <= bound + 0.01


TABLE = {
    4.0: "0.74 1.07 1.79 0.80 1.13 1.86 1.01 1.34 2.07 1.27 1.60 2.32",
    6.4: "1.42 1.96 3.11 1.58 2.12 3.27 2.11 2.65 3.80 2.77 3.31 4.46",
    10.0: "2.78 3.62 5.42 3.17 4.00 5.81 4.46 5.29 7.10 6.07 6.90 8.71",
    15.0: "5.34 6.59 9.30 6.21 7.46 10.2 9.10 10.4 13.1 12.7 14.0 16.7",
    20.0: "8.66 10.3 13.9 10.2 11.9 15.5 15.4 17.0 20.6 21.8 23.5 27.1",
}
"""Metres from a fault to standstill (guidance findings, Q6): brake 2.5, 2.0, 1.2, 0.8 m/s2, reactions of 0.05, 0.35, 1 s each."""


@pytest.mark.parametrize("kmh", TABLE)
@pytest.mark.parametrize("brake", [2.5, 2.0, 1.2, 0.8])
def test_stopping_distances_are_those_of_the_table(kmh: float, brake: float) -> None:
    """The table's deceleration is all that holds the machine back: no rolling resistance beside it."""
    machine = Machine(drive=Drive(rolling_resistance=0.0), brakes=Brakes(deceleration_mps2=brake))
    rows = np.array([float(one) for one in TABLE[kmh].split()]).reshape(4, 3)
    wanted = rows[[2.5, 2.0, 1.2, 0.8].index(brake)]
    for reaction_s, way_m in zip((0.05, 0.35, 1.0), wanted, strict=True):
        bench = Bench(machine)
        bench.roll(kmh / 3.6)
        bench.drive(0.5, lambda now: even(kmh / 3.6, now, stages=80))
        fault = len(bench.states) - 1
        bench.drive(reaction_s, lambda now: even(kmh / 3.6, now, stages=80))
        bench.drive(20.0, stop=Stop.FULL, until_rest=True)
        assert bench.way_m(fault) == pytest.approx(way_m, rel=0.1)
        assert bench.way_m(fault) == pytest.approx(bench.model.stopping_m(kmh / 3.6, reaction_s), rel=0.05)


def in_a_bend(
    kmh: float,
    brake: float,
    gear: int,
    hand: Callable[[Command], Command] = lambda command: command,
    *,
    seen: bool = True,
) -> tuple[float, float]:
    """Return how far the leading edge is off its path at standstill, m, and the joint, degrees: a stop where a bend begins."""
    machine = Machine(brakes=Brakes(deceleration_mps2=brake))
    way, bend = bend_over_way(8.0)
    slope, speed, start_s = np.gradient(bend, way), kmh / 3.6, 1.0
    lag_s = drive_model(machine).steering_lag_s

    def plan(now_ns: int) -> Setpoints:
        return even(
            gear * speed,
            now_ns,
            lambda t: speed * float(np.interp(speed * (t - start_s + lag_s), way, slope, left=0.0)),
        )

    freely, stopped = Bench(machine), Bench(machine)
    freely.roll(gear * speed)
    stopped.roll(gear * speed)
    freely.drive(start_s + 10.0, plan)
    stopped.drive(start_s + 0.25, plan)
    stopped.drive(10.0, stop=Stop.FULL, until_rest=True, hand=hand, seen=seen)
    assert stopped.state.speed_mps == 0.0
    ways = np.concatenate([[0.0], np.cumsum([abs(one.speed_mps) * STEP_S for one in freely.states[1:]])])
    at = np.searchsorted(ways, stopped.way_m())
    wanted, found = freely.states[at], stopped.state
    apart = np.subtract(edge(found.x_m, found.y_m, found.yaw_rad), edge(wanted.x_m, wanted.y_m, wanted.yaw_rad))
    across = -apart[0] * math.sin(wanted.yaw_rad) + apart[1] * math.cos(wanted.yaw_rad)
    return abs(float(across)), math.degrees(found.articulation_rad - wanted.articulation_rad)


def edge(x: float, y: float, yaw: float) -> tuple[float, float]:
    return x + 3.2 * math.cos(yaw), y + 3.2 * math.sin(yaw)


@pytest.mark.parametrize(("kmh", "brake"), [(6.4, 2.5), (6.4, 1.2), (10.0, 2.5), (10.0, 1.2)])
@pytest.mark.parametrize("gear", [1, -1])
def test_a_brake_keeps_the_machine_on_its_path(kmh: float, brake: float, gear: int) -> None:
    across_m, bend_deg = in_a_bend(kmh, brake, gear)
    assert across_m < 0.03
    assert abs(bend_deg) < 0.3


def test_it_keeps_to_it_blind() -> None:
    """The motion is lost when the brake is asked for: what was commanded tells where it is."""
    across_m, bend_deg = in_a_bend(10.0, 2.5, 1, seen=False)
    assert across_m < 0.1
    assert abs(bend_deg) < 1.0


def test_a_held_joint_leaves_the_path() -> None:
    """What the findings warn of is there in this simulation too."""
    across_m, _ = in_a_bend(10.0, 1.2, 1, lambda command: command._replace(steering_rate_rps=0.0))
    assert across_m > 0.4


def test_a_service_stop_is_by_the_drive_and_ends_on_the_brake() -> None:
    bench = Bench()
    bench.roll(3.0)
    bench.drive(1.0, lambda now: even(3.0, now, stages=80))
    before = len(bench.states)
    bench.drive(6.0, stop=Stop.SERVICE)
    assert bench.state.speed_mps == pytest.approx(0.0, abs=1e-3)
    speeds = np.array([one.speed_mps for one in bench.states[before:]])
    assert np.diff(speeds).min() / STEP_S > -1.6  # 1.5 by the drive, and a little rolling
    moving = [
        command
        for command, state in zip(bench.commands[before:], bench.states[before:], strict=False)
        if state.speed_mps > 0.1
    ]
    assert not any(command.brake for command in moving)
    assert bench.commands[-1].brake


def test_an_emergency_stop_wins_and_latches() -> None:
    bench = Bench()
    bench.drive(6.0, lambda now: even(3.0, now))
    bench.executor.stop("button")
    assert not bench.executor.release("too early")
    bench.drive(3.0, lambda now: even(3.0, now))
    assert bench.state.speed_mps == 0.0
    assert all(command.brake and command.propel == 0.0 for command in bench.commands[-300:])
    assert bench.executor.release("operator")
    bench.drive(1.0)
    assert bench.state.speed_mps == 0.0  # the queue was emptied: letting go moves nothing
    bench.drive(3.0, lambda now: even(3.0, now))
    assert bench.state.speed_mps > 1.0


def test_an_emergency_stop_that_is_asked_for_once_holds() -> None:
    bench = Bench()
    bench.drive(6.0, lambda now: even(3.0, now))
    bench.drive(STEP_S, stop=Stop.EMERGENCY)
    bench.drive(4.0, lambda now: even(3.0, now))
    assert bench.state.speed_mps == 0.0
    assert bench.executor.emergency == "test"


def test_a_held_machine_gets_no_faster() -> None:
    bench = Bench()
    bench.drive(3.0, lambda now: even(1.0, now))
    bench.drive(3.0, lambda now: even(4.0, now), stop=Stop.HOLD)
    assert bench.state.speed_mps < 1.02
    bench.drive(1.0, lambda now: even(0.5, now), stop=Stop.HOLD)
    bench.drive(3.0, lambda now: even(4.0, now), stop=Stop.HOLD)
    assert bench.state.speed_mps < 0.7
    bench.drive(5.0, lambda now: even(2.0, now))
    assert bench.state.speed_mps == pytest.approx(2.0, abs=0.05)


def test_gears_change_at_standstill_alone() -> None:
    bench = Bench()
    bench.drive(6.0, lambda now: even(2.0, now))
    bench.drive(12.0, lambda now: even(-2.0, now))
    assert bench.state.speed_mps == pytest.approx(-2.0, abs=0.05)
    for command, state in zip(bench.commands, bench.states, strict=False):
        assert command.propel * state.speed_mps >= 0.0 or abs(state.speed_mps) < 0.06


def test_a_plan_goes_on_where_it_comes_back_in_time() -> None:
    """An overrun that the queue carries is no stop; one that it does not ends, and the drive goes on with the next plan."""
    bench = Bench()
    bench.drive(8.0, lambda now: even(2.0, now))
    bench.drive(2.0)
    assert bench.state.speed_mps == pytest.approx(2.0, abs=0.1)
    bench.drive(1.0)  # the bound is reached: it brakes
    assert bench.executor.state in ("braking", "standing")
    bench.drive(6.0, lambda now: even(2.0, now))
    assert bench.state.speed_mps == pytest.approx(2.0, abs=0.05)


def test_ramps_are_followed_and_jerk_is_limited() -> None:
    bench = Bench()

    def plan(now_ns: int) -> Setpoints:
        times = [now_ns + round((0.03 + 0.15 * k) * SECOND) for k in range(40)]
        return tuple(
            Setpoint(at, max(min(0.6 * at / SECOND, 3.0, 0.6 * (14.0 - at / SECOND)), 0.0), 0.0) for at in times
        )

    bench.drive(15.0, plan)
    times = np.array([one.time_ns / SECOND for one in bench.states])
    wanted = np.clip(np.minimum(0.6 * (times - 0.25), 0.6 * (14.25 - times)), 0.0, 3.0)
    miss = np.abs(np.array([one.speed_mps for one in bench.states]) - wanted)
    assert miss[times < 13.0].max() < 0.1
    speeds = np.array([one.propel for one in bench.commands]) * bench.model.top_speed_mps
    assert np.abs(np.diff(speeds)).max() / STEP_S < 1.6 + bench.model.drive_lag_s * 4.1


def test_a_steering_command_is_limited_and_has_a_dead_zone() -> None:
    bench = Bench()
    bench.drive(1.0, lambda now: even(1.0, now, lambda t: 5.0))
    rates = np.array([one.steering_rate_rps for one in bench.commands])
    assert rates.max() == pytest.approx(bench.model.max_rate_rps)
    assert np.abs(np.diff(rates)).max() <= math.radians(181.0) * STEP_S
    quiet = Bench()
    quiet.drive(1.0, lambda now: even(1.0, now, lambda t: math.radians(0.25)))
    assert all(one.steering_rate_rps == 0.0 for one in quiet.commands)


def test_what_is_no_motion_is_not_believed() -> None:
    bench = Bench()
    bench.drive(4.0, lambda now: even(2.0, now))
    way = bench.executor.keeper.way_m

    wrong = motion_of(bench.state)._replace(speed_mps=math.nan)
    command = bench.executor.step(bench.state.time_ns, wrong)
    assert all(map(math.isfinite, (command.propel, command.steering_rate_rps)))
    assert bench.executor.keeper.way_m == way

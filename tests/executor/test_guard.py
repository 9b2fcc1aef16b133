"""The guard against a sweep by brute force, and what it must let pass."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.driving.bodies import bodies_of
from lhdmap.driving.model import drive_model
from lhdmap.driving.motion import Motion
from lhdmap.executor.guard import Guard, Swept
from lhdmap.executor.settings import ExecutorSettings
from lhdmap.kinematics import T_base_rear, heading_rate
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray

MACHINE = Machine()
MODEL, BODIES, SETTINGS = drive_model(MACHINE), bodies_of(MACHINE), ExecutorSettings()
GUARD = Guard(MODEL, BODIES, SETTINGS)
LATE_S = 0.05 + MODEL.dead_time_s


def moving(speed: float, bend: float = 0.0, rate: float = 0.0) -> Motion:
    return Motion(0, 0.0, 0.0, 0.0, bend, rate, speed)


def signed(points: FloatArray, box: FloatArray) -> FloatArray:
    """Distance of points (N, 2) from a box, negative inside."""
    over = np.maximum(box[0] - points, points - box[1])
    outside: FloatArray = np.hypot(*np.maximum(over, 0.0).T)
    return np.where((over <= 0.0).all(axis=1), over.max(axis=1), outside)


def swept_by_hand(
    motion: Motion, points: FloatArray, held_s: float, pull: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Step both bodies along the braking path in small steps: ways (K,) and distances (K, N) of the points."""
    x, y, heading, bend, rate = 0.0, 0.0, 0.0, motion.articulation_rad, motion.articulation_rate_rps
    speed, gear = abs(motion.speed_mps), math.copysign(1.0, motion.speed_mps)
    way, t, step = 0.0, 0.0, 0.008
    ways, apart = [], []
    while True:
        c, s = math.cos(heading), math.sin(heading)
        front = (points - [x, y]) @ np.array([[c, -s], [s, c]])
        rear = (
            np.column_stack([front, np.zeros(len(front)), np.ones(len(front))])
            @ np.linalg.inv(T_base_rear(bend, MACHINE)).T
        )
        apart.append(np.minimum(signed(front, BODIES.front_box_m), signed(rear[:, :2], BODIES.rear_box_m)))
        ways.append(way)
        if speed <= 0.0:
            return np.array(ways), np.array(apart)
        turned = rate if t < held_s and abs(bend + rate * step) <= MODEL.max_articulation_rad else 0.0
        heading += heading_rate(gear * speed, bend, turned, MACHINE) * step
        bend += turned * step
        x, y, way = (
            x + gear * speed * math.cos(heading) * step,
            y + gear * speed * math.sin(heading) * step,
            way + speed * step,
        )
        if t >= LATE_S:
            brake = 0.9 * MODEL.brake_mps2 * min((t - LATE_S) / MODEL.brake_ramp_s, 1.0)
            speed = max(speed + (pull - brake) * step, 0.0)
        t += step


@settings(max_examples=30, deadline=None)
@given(
    st.floats(-4.0, 4.0),
    st.floats(-0.6, 0.6),
    st.floats(-0.2, 0.2),
    st.integers(0, 2**31),
    st.sampled_from([0.0, 0.6]),
)
def test_it_finds_what_a_sweep_by_hand_finds(speed: float, bend: float, rate: float, seed: int, pull: float) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-12.0, 12.0, (40, 2)) * [1.0, 0.4]
    motion = moving(speed, bend, rate)
    start = swept_by_hand(moving(0.0, bend), points, 0.0)[1][0]
    points = points[start > 0.1]  # what is nearer has rules of its own
    if len(points) == 0:
        return
    nearest = math.inf
    for held_s in (LATE_S, 1e9):
        ways, apart = swept_by_hand(motion, points, held_s, pull)
        nearest = min(nearest, float((apart - SETTINGS.margin_growth * ways[:, None]).min()))
    found = GUARD.sweep(motion, points, pull_mps2=math.copysign(pull, speed))
    if nearest < SETTINGS.margin_m - 0.03:
        assert found.contact
    if nearest > SETTINGS.margin_m + 0.03:
        assert not found.contact


@pytest.mark.parametrize("gear", [1, -1])
@pytest.mark.parametrize("kmh", [2.0, 6.4, 20.0])
def test_it_stops_in_time_and_not_before(gear: int, kmh: float) -> None:
    """A wall across the way: free as long as the machine can stop before it."""
    speed = kmh / 3.6
    edge = 3.2 if gear > 0 else 3.4 + 3.11
    need = MODEL.stopping_m(speed, 0.05)
    wall = np.column_stack([np.zeros(40), np.linspace(-1.5, 1.5, 40)])

    def at(gap: float) -> Swept:
        return GUARD.sweep(moving(gear * speed), wall + np.array([gear * (edge + gap), 0.0]))

    assert at(need).contact
    assert at(need).hit
    assert at(need).free_m < need
    assert at(1.15 * need + 0.3).free_m == math.inf
    assert at(0.5 * need).at_m is not None


def test_a_person_beside_the_tunnel_does_not_stop_it_and_one_in_the_way_does() -> None:
    person = np.array([[7.2, 0.9], [7.25, 0.95]])
    assert not GUARD.sweep(moving(1.0), person).contact
    assert GUARD.sweep(moving(3.5), person).hit
    assert not GUARD.sweep(moving(3.5), person + np.array([0.0, 0.8])).contact
    assert not GUARD.sweep(moving(-3.5), person).contact
    assert GUARD.sweep(moving(3.5, rate=0.0, bend=0.2), person + np.array([-1.4, 1.3])).hit  # the bend sweeps over it


def test_at_standstill_what_is_asked_for_counts() -> None:
    wall = np.column_stack([np.full(20, 3.3), np.linspace(-1.0, 1.0, 20)])
    assert not GUARD.sweep(moving(0.0), wall).contact
    assert GUARD.sweep(moving(0.0), wall, commanded_mps=1.0).contact
    assert not GUARD.sweep(moving(0.0), wall, commanded_mps=-1.0).contact


def test_returns_of_the_machine_itself_do_not_hold_it() -> None:
    own = np.array([[0.5, 0.2], [2.9, -1.0], [-2.0, 0.3]])
    found = GUARD.sweep(moving(2.0), own)
    assert not found.contact
    assert found.own == 3


@pytest.mark.parametrize("depth", [0.0, 0.05, 0.09])
def test_what_touches_holds_it_unless_it_leaves(depth: float) -> None:
    touching = np.array([[3.2 - depth, 0.3], [3.2 - depth, 0.35]])
    assert GUARD.sweep(moving(0.0), touching, commanded_mps=0.5).contact
    assert not GUARD.sweep(moving(0.0), touching, commanded_mps=-0.5).contact
    beside = np.array([[0.0, 1.225 - depth]])
    assert GUARD.sweep(moving(0.3), beside).contact  # it would scrape along


def test_a_wall_that_is_near_all_along_does_not_hold_it() -> None:
    x = np.arange(-8.0, 12.0, 0.05)
    near = np.column_stack([x, np.full(len(x), 1.225 + 0.015)])
    assert not GUARD.sweep(moving(0.5), near).contact
    assert not GUARD.sweep(moving(-0.5), near).contact
    assert GUARD.sweep(moving(0.5, rate=0.1), near).contact  # towards it
    ahead = np.column_stack([np.full(20, 3.2 + 0.1), np.linspace(-1.0, 1.0, 20)])
    assert GUARD.sweep(moving(0.5), np.concatenate([near, ahead])).hit


def test_the_plan_is_what_it_brakes_on() -> None:
    """A machine in a bend that the plan ends: with the joint held it would meet the wall."""
    way = np.linspace(0.0, 8.0, 80)
    plan = np.column_stack([way, np.clip(0.3 - 0.15 * way, 0.0, None)])
    held, ahead = moving(3.0, bend=0.3), np.array([[5.8, 2.4], [5.85, 2.4]])
    assert GUARD.sweep(held, ahead).contact
    assert not GUARD.sweep(held, ahead, plan=plan).contact


def test_no_points_are_no_contact() -> None:
    found = GUARD.sweep(moving(5.0), np.zeros((0, 2)))
    assert not found.contact
    assert found.free_m == math.inf
    assert found.stop_m == pytest.approx(MODEL.stopping_m(5.0, 0.05), rel=0.1)


@pytest.mark.parametrize("speed", [1.8, 5.5, -5.5])
def test_a_look_takes_a_millisecond(speed: float) -> None:
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-20, 20, 1500), rng.choice([-1.8, 1.8], 1500) + rng.normal(0, 0.05, 1500)])
    GUARD.sweep(moving(speed), points)
    spent = []
    for _ in range(40):
        before = time.thread_time()
        GUARD.sweep(moving(speed), points)
        spent.append(time.thread_time() - before)
    assert float(np.median(spent)) < 0.003  # 0.2 to 0.9 ms where nobody else computes

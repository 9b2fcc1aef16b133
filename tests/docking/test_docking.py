"""Docking: closed forms, ways that the joint can make and the apron has room for, refusals, and what is driven."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.docking.dubins import end_of, words
from lhdmap.docking.kernel import driven, inside
from lhdmap.docking.planner import DockPlan, least_radius_m, plan_dock
from lhdmap.docking.room import Room, room_of
from lhdmap.docking.settings import DockingSettings
from lhdmap.errors import InputError
from lhdmap.messages import FloatArray
from lhdmap.tracking.kernel import moved

from tests.docking.aprons import apron, dock_on, docked, rear_of, start_on
from tests.tracking.machines import BODIES, LENGTHS, MODELS

SETTINGS = DockingSettings()
coordinates, angles = st.floats(-20.0, 20.0), st.floats(-7.0, 7.0)


@given(coordinates, coordinates, angles, coordinates, coordinates, angles, st.floats(3.0, 12.0))
def test_words_lead_to_the_goal(x: float, y: float, a: float, u: float, v: float, b: float, radius: float) -> None:
    found = words((x, y, a), (u, v, b), radius)
    assert len(found) >= 2
    for word in found:
        end = end_of((x, y, a), word, radius)
        assert math.dist(end[:2], (u, v)) < 1e-5
        assert abs(math.remainder(end[2] - b, 2.0 * math.pi)) < 1e-6
        assert min(word.lengths_m) >= 0.0


@pytest.mark.parametrize(
    ("goal", "length"),
    [
        ((10.0, 0.0, 0.0), 10.0),
        ((5.0, 5.0, 0.5 * math.pi), 0.5 * math.pi * 5.0),
        ((0.0, 10.0, math.pi), math.pi * 5.0),
        ((0.0, -10.0, math.pi), math.pi * 5.0),
        ((20.0, 0.0, 0.0), 20.0),
        ((10.0, 10.0, 0.0), math.pi * 5.0),
    ],
)
def test_the_shortest_word_is_known(goal: tuple[float, float, float], length: float) -> None:
    found = words((0.0, 0.0, 0.0), goal, 5.0)[0].length_m
    assert found == pytest.approx(length, abs=1e-6)


def test_driven_is_the_machine() -> None:
    """The way's kernel against the stepped machine, without lag."""
    start = np.array([1.0, 2.0, 0.3, 0.1])
    states = driven(
        start, np.array([[1.0, 0.5, 4.0], [-1.0, -0.4, 6.0]]), np.array([400.0, 600.0]), 0.15, LENGTHS["truck"]
    )
    state = (1.0, 2.0, 0.3, 0.1, 0.0)
    for before, after in itertools.pairwise(states):
        step = after[4] - before[4]
        rate = (after[3] - before[3]) / abs(step)
        state = moved(
            (*state[:4], rate), math.copysign(1.0, step), rate, abs(step), (*LENGTHS["truck"], 1e-9), (0.0, 0.0)
        )
    assert states[-1, :4] == pytest.approx(state[:4], abs=1e-6)


def test_inside_a_polygon_with_a_notch() -> None:
    corners = np.array(
        [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [6.0, 10.0], [6.0, 4.0], [4.0, 4.0], [4.0, 10.0], [0.0, 10.0]]
    )
    assert inside(2.0, 8.0, corners)
    assert not inside(5.0, 8.0, corners)
    assert inside(5.0, 3.0, corners)
    assert not inside(-1.0, 3.0, corners)


def yard(name: str, width: float, height: float, blocked: FloatArray | None = None) -> tuple[Room, FloatArray]:
    room = room_of(apron(width, height), MODELS[name], BODIES[name], SETTINGS.margin_m, blocked)
    return room, dock_on(width, height, MODELS[name], -float(BODIES[name].rear_box_m[0, 0]))


def anywhere(name: str, width: float, height: float, seed: int) -> tuple[Room, FloatArray, FloatArray, DockPlan]:
    room, dock = yard(name, width, height)
    start = start_on(room, width, height, MODELS[name], np.random.default_rng([seed, 5]))
    return room, start, dock, plan_dock(start, dock, room, MODELS[name], SETTINGS)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("size", [(45.0, 40.0), (35.0, 24.0)], ids=["wide", "tight"])
def test_a_way_is_one_that_the_machine_can_go(name: str, seed: int, size: tuple[float, float]) -> None:
    room, start, dock, plan = anywhere(name, *size, seed)
    model = MODELS[name]
    assert plan.reason == ""
    assert plan.cusps <= (1 if size[0] > 40.0 else 3)
    share = plan.radius_m / least_radius_m(model)
    assert share == pytest.approx(2.0) or share == pytest.approx(1.3)
    begin, end = plan.legs[0].at(plan.legs[0].from_m), plan.legs[-1].at(plan.legs[-1].to_m)
    assert begin[[0, 1, 2, 4]] == pytest.approx(rear_of(start, model), abs=0.01)
    goal = rear_of(np.append(dock, 0.0), model)
    assert end[:2] == pytest.approx(goal[:2], abs=0.01)
    assert abs(math.remainder(end[2] - goal[2], 2.0 * math.pi)) < 1e-3
    for leg in plan.legs:
        low, high = sorted((leg.from_m, leg.to_m))
        driven_rows = leg.rows[math.ceil(low * 10) : math.floor(high * 10) + 1]
        states = np.ascontiguousarray(driven_rows[:, [0, 1, 2, 4]])
        assert room.free(states)
        assert np.abs(states[:, 3]).max() <= model.max_articulation_rad
        assert np.abs(driven_rows[:, 5]).max() * SETTINGS.speed_mps <= model.max_rate_rps


@pytest.mark.parametrize("name", MODELS)
def test_the_last_metres_are_straight(name: str) -> None:
    _, _, _, plan = anywhere(name, 45.0, 40.0, 1)
    leg = plan.legs[-1]
    assert leg.gear == -1
    last = leg.rows[math.ceil(leg.to_m * 10) : math.ceil(leg.to_m * 10) + 57]
    assert np.abs(last[:, 4]).max() < 1e-6
    assert plan.straight_m >= 4.0


@pytest.mark.parametrize("name", MODELS)
def test_legs_go_on_where_the_last_one_ended(name: str) -> None:
    plans = [anywhere(name, 35.0, 24.0, seed)[3] for seed in range(4)]
    pairs = [(one, two) for plan in plans for one, two in zip(plan.legs[:-1], plan.legs[1:], strict=True)]
    assert pairs
    for one, two in pairs:
        assert one.gear == -two.gear
        assert one.at(one.to_m)[[0, 1, 2, 4]] == pytest.approx(two.at(two.from_m)[[0, 1, 2, 4]], abs=0.01)


def test_a_dock_can_be_faced_too() -> None:
    room, _ = yard("loader", 45.0, 40.0)
    dock = np.array([22.0, 34.0, 0.5 * math.pi])
    plan = plan_dock(np.array([20.0, 10.0, 0.2, 0.0]), dock, room, MODELS["loader"], SETTINGS, gear=1)
    assert plan.legs[-1].gear == 1
    goal = rear_of(np.append(dock, 0.0), MODELS["loader"])
    assert plan.legs[-1].at(plan.legs[-1].to_m)[:2] == pytest.approx(goal[:2], abs=0.01)


@pytest.mark.parametrize(
    ("start", "blocked", "told"),
    [
        ((1.0, 1.0, 0.0, 0.0), None, "where the machine stands"),
        ((20.0, 15.0, 0.0, 0.0), [(22.5, 35.0)], "the dock has no room"),
        ((10.0, 10.0, 0.0, 0.0), [(22.5, 26.0)], "the last straight of 4 m"),
    ],
)
def test_who_cannot_says_why_before_moving(
    start: tuple[float, ...], blocked: list[tuple[float, float]], told: str
) -> None:
    room, dock = yard("truck", 45.0, 40.0, None if blocked is None else np.array(blocked))
    plan = plan_dock(np.array(start), dock, room, MODELS["truck"], SETTINGS)
    assert plan.legs == ()
    assert told in plan.reason


def test_where_nobody_turns_round_is_said_after_a_search() -> None:
    room = room_of(apron(17.0, 3.4), MODELS["loader"], BODIES["loader"], 0.4)
    plan = plan_dock(np.array([10.0, 1.7, 0.0, 0.0]), np.array([8.0, 1.7, math.pi]), room, MODELS["loader"], SETTINGS)
    assert "all that can be reached was searched" in plan.reason


def test_what_is_not_finite_is_refused() -> None:
    room, dock = yard("truck", 45.0, 40.0)
    with pytest.raises(InputError, match="finite"):
        plan_dock(np.array([math.nan, 10.0, 0.0, 0.0]), dock, room, MODELS["truck"], SETTINGS)
    with pytest.raises(InputError, match="polygon"):
        room_of(np.zeros((2, 2)), MODELS["truck"], BODIES["truck"], 0.4)


@pytest.mark.parametrize("name", MODELS)
def test_a_way_is_driven_into_the_dock(name: str) -> None:
    _, start, dock, plan = anywhere(name, 45.0, 40.0, 2)
    bare = room_of(apron(45.0, 40.0), MODELS[name], BODIES[name], 0.0)
    row = docked(MODELS[name], plan, rear_of(start, MODELS[name]) + np.array([0.6, -0.5, 0.1, 0.04]), dock, 3, bare)
    assert row["arrived"]
    assert row["off_m"] < 0.10
    assert row["off_deg"] < 1.0
    assert row["in_room"]

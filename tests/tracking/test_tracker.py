"""The tracker in closed loop: figures of the findings, recovery, dead time, stops; and the paper's law beside it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from lhdmap.driving.motion import Motion
from lhdmap.errors import InputError
from lhdmap.messages import FloatArray
from lhdmap.tracking.equations import equilibrium
from lhdmap.tracking.settings import TrackingSettings
from lhdmap.tracking.tracker import Tracker

from tests.tracking.machines import LENGTHS, MODELS
from tests.tracking.paths import turn
from tests.tracking.plant import CALM, Drive, Errors, Plant, drive, placed

SETTINGS = TrackingSettings()
LINE = turn(1.0, ends_m=100.0)[:1000]


def turned(name: str, kmh: float, errors: Errors, *, step: bool = False, method: str = "both") -> Drive:
    """A turn of 90° with 20 m before and after it."""
    rows = turn(kmh / 3.6, step=step, ends_m=20.0)
    tracker = Tracker(MODELS[name], dataclasses.replace(SETTINGS, method=method))
    waypoints = rows[::10, :2]
    curve = tracker.follow(waypoints if kmh > 0 else waypoints[::-1], kmh / 3.6)
    x, y, heading, _, bent, _ = curve.at(curve.from_m).tolist()
    return drive(tracker, Plant(placed(x, y, heading, bent), MODELS[name], errors), rows, 120.0)


def both(out: Drive) -> FloatArray:
    table = out.table()
    moving = table[np.abs(table[:, 6]) > 0.3]
    total: FloatArray = moving[:, 7] + moving[:, 8]
    return total


@pytest.mark.parametrize(
    ("name", "kmh", "rms", "most"),
    [
        ("truck", 10, 0.05, 0.15),
        ("loader", 10, 0.05, 0.15),
        ("truck", 30, 0.09, 0.30),
        ("loader", 20, 0.09, 0.30),
        ("truck", -5, 0.04, 0.12),
        ("loader", -8, 0.04, 0.12),
    ],
)
def test_both_axles_follow_with_noise_and_slip(name: str, kmh: float, rms: float, most: float) -> None:
    out = turned(name, kmh, Errors(seed=3))
    assert out.arrived
    assert np.sqrt(np.mean(both(out) ** 2)) < rms
    assert np.abs(both(out)).max() < most


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("kmh", [10, -5])
def test_a_step_of_curvature_is_followed_without_overshoot(name: str, kmh: float) -> None:
    out = turned(name, kmh, CALM, step=True)
    rest = equilibrium(1 / 12, LENGTHS[name])[4]
    assert np.abs(out.table()[:, 4]).max() < 1.12 * rest
    assert np.abs(both(out)).max() < 0.03
    own = abs(LENGTHS[name][1] ** 2 - LENGTHS[name][0] ** 2) / 48.0
    assert np.abs(out.table()[:, 7:9]).max() < own + 0.15


@pytest.mark.parametrize("off_s", [-0.1, 0.1])
def test_a_dead_time_that_is_off_is_borne(off_s: float) -> None:
    out = turned("truck", 20, Errors(dead_s=off_s, seed=1))
    assert out.arrived
    assert np.sqrt(np.mean(both(out) ** 2)) < 0.15


def test_the_law_as_printed_loses_the_path_in_reverse() -> None:
    rows = turned("truck", -5, Errors(seed=1), method="paper").table()
    assert np.abs(rows[:, 7:9]).max() > 5.0


def test_the_law_as_printed_is_worse_forward() -> None:
    ours, printed = (both(turned("truck", 10, Errors(seed=1), method=method)) for method in ("both", "paper"))
    assert np.sqrt(np.mean(printed**2)) > 2.5 * np.sqrt(np.mean(ours**2))


def test_circles_follow_forward_too() -> None:
    out = turned("loader", 10, Errors(seed=1), method="circles")
    assert out.arrived
    assert np.sqrt(np.mean(both(out) ** 2)) < 0.08


def beside_line(name: str, kmh: float, aside: float, heading: float, bent: float) -> tuple[Tracker, Plant]:
    tracker = Tracker(MODELS[name], SETTINGS)
    tracker.follow(LINE[::20, :2] if kmh > 0 else LINE[::-20, :2], kmh / 3.6)
    start = placed(8.0 if kmh > 0 else 85.0, aside, math.radians(heading), math.radians(bent))
    plant = Plant(start, MODELS[name], Errors(seed=2))
    plant.speed = kmh / 3.6
    return tracker, plant


@pytest.mark.parametrize(("name", "kmh"), [("truck", 30), ("loader", 20), ("loader", -8)])
def test_it_comes_back_from_five_metres(name: str, kmh: float) -> None:
    out = drive(*beside_line(name, kmh, 5.0, -20.0 if kmh > 0 else 20.0, 10.0), LINE, 90.0)
    assert out.arrived
    assert np.abs(out.table()[-60:, 7:9]).max() < 0.15
    assert np.abs(out.table()[:, 4]).max() <= MODELS[name].max_articulation_rad + 1e-6


@pytest.mark.parametrize("kmh", [8, -5])
def test_it_stops_at_the_end(kmh: float) -> None:
    out = drive(*beside_line("truck", kmh, 0.0, 0.0, 0.0), LINE, 90.0)
    x1 = out.table()[-1, 1]
    leading = x1 + sum(LENGTHS["truck"]) if kmh > 0 else x1
    assert leading == pytest.approx(LINE[980, 0] if kmh > 0 else LINE[19, 0], abs=0.1)


def test_setpoints_reach_far_enough_to_stop() -> None:
    """The executor brakes where a queue ends before a full brake does."""
    tracker, plant = beside_line("truck", 30, 0.0, 0.0, 0.0)
    step = tracker.step(0, plant.measured())
    assert step.setpoints[0].at_ns == 0
    assert (step.setpoints[-1].at_ns - step.setpoints[0].at_ns) * 1e-9 > 4.0
    assert (step.speed_mps, step.steering_rate_rps) == (
        step.setpoints[0].speed_mps,
        step.setpoints[0].steering_rate_rps,
    )


def test_bad_input_stops_it_and_goes_no_further() -> None:
    tracker = Tracker(MODELS["truck"], SETTINGS)
    assert tracker.step(0, None).reason == "no path"
    tracker.follow(LINE[::10, :2], 5.0)
    assert tracker.step(0, None).reason == "no motion"
    assert tracker.step(0, Motion(0, math.nan, 0.0, 0.0, 0.0, 0.0, 0.0)).reason == "no motion"
    assert tracker.step(0, Motion(0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0)).state == "tracking"
    late = tracker.step(700_000_000, Motion(0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0))  # frozen: the same stamp again
    assert (late.state, late.speed_mps, late.steering_rate_rps) == ("stopped", 0.0, 0.0)
    assert "old" in late.reason


def test_a_machine_elsewhere_is_not_driven_to_the_path() -> None:
    tracker, plant = beside_line("truck", 10, 30.0, 0.0, 0.0)
    assert "30.0 m from the path" in tracker.step(0, plant.measured()).reason


def test_one_wrong_pose_is_not_believed() -> None:
    tracker, plant = beside_line("truck", 20, 0.0, 0.0, 0.0)
    rates = []
    for k in range(60):
        motion = plant.measured()
        step = tracker.step(plant.now_ns, motion._replace(y_m=motion.y_m + 3.0) if k == 40 else motion)
        rates.append(step.steering_rate_rps)
        plant.sent.append(step.setpoints[0])
        for _ in range(5):
            plant.step()
    assert abs(rates[40] - rates[39]) < 0.02


@pytest.mark.parametrize("speeds", [0.0, math.nan, np.array([1.0, -1.0, 1.0])])
def test_wrong_speeds_are_refused(speeds: float | FloatArray) -> None:
    with pytest.raises(InputError, match="speeds"):
        Tracker(MODELS["truck"], SETTINGS).follow(np.array([[0.0, 0.0], [5.0, 0.0], [10.0, 0.0]]), speeds)


def test_a_path_that_bends_too_much_is_refused_before_moving() -> None:
    from tests.tracking.paths import bend, exact, straight

    tight = exact(np.concatenate([straight(15.0), bend(3.0, 150.0, 2.0), straight(15.0)]))
    with pytest.raises(InputError, match=r"bends (more|too much)"):
        Tracker(MODELS["loader"], SETTINGS).follow(tight[::5, :2], 1.0)


def test_the_same_drive_gives_the_same_commands() -> None:
    one, two = (turned("loader", 10, Errors(seed=5)).table() for _ in range(2))
    assert (one == two).all()


def test_slip_and_the_joints_offset_are_found() -> None:
    tracker, plant = beside_line("truck", 25, 0.0, 0.0, 0.0)
    plant = Plant(plant.state, MODELS["truck"], Errors(seed=4, slip_of=lambda way: math.radians(1.0)))
    plant.speed = 25 / 3.6
    out = drive(tracker, plant, LINE, 9.0)
    assert np.degrees(out.table()[-60:, 10].mean()) == pytest.approx(1.0, abs=0.35)
    assert math.degrees(tracker.filter.state[6]) == pytest.approx(0.5, abs=0.25)
    assert np.abs(both(out)[-40:]).mean() < 0.12


@pytest.mark.parametrize("gear", [1, -1])
def test_a_machine_that_rolls_the_other_way_is_steered_for_how_it_moves(gear: int) -> None:
    """Beside the path by 0.5 m: forward the joint turns towards it, backwards the heading has to turn the other way."""
    rates = {}
    for moves in (1.0, -1.0):
        tracker = Tracker(MODELS["truck"], SETTINGS)
        tracker.follow(LINE[::20, :2] if gear > 0 else LINE[::-20, :2], gear * 2.0)
        for k in range(3):
            motion = Motion(k * 50_000_000, 50.0 + 0.05 * moves * k, 0.0, 0.06, 0.0, 0.0, moves)
            step = tracker.step(motion.stamp_ns, motion)
        rates[moves] = step.steering_rate_rps
    assert rates[1.0] < 0.0 < rates[-1.0]

"""Several machines in one mine: rays meet the bodies of the others, bodies that overlap touch."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.machine import Machine, load_machine
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.simulation.company import Among, Company, depth_m, ranges_to_box
from lhdmap.simulation.vehicle.bodies import Boxes
from lhdmap.simulation.vehicle.state import VehicleState, state_of_row


class Open:
    """A world without walls."""

    origin_m = np.array([100.0, 0.0, 0.0])

    def near(self, position_m: FloatArray) -> Open:
        return self

    def dust(self, position_m: FloatArray) -> float:
        return 0.0

    def cast(self, rays: Float32Array) -> Float32Array:
        return np.full(len(rays), np.inf, dtype=np.float32)


def box(x: float, y: float, turned: float = 0.0, half: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Boxes:
    c, s = math.cos(turned), math.sin(turned)
    axes = np.array([[[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]])
    return Boxes(("body",), np.array([[x, y, 0.0]]), axes, np.array([half]))


def test_a_ray_meets_a_turned_box_where_its_side_is() -> None:
    one = box(10.0, 0.0, math.pi / 4.0)
    rays = np.array(
        [[0, 0, 0, 1, 0, 0], [0, 5, 0, 1, 0, 0], [10, 0, 0, 1, 0, 0], [20, 0, 0, -1, 0, 0]], dtype=np.float32
    )
    ranges = ranges_to_box(rays, one.centre_m[0], one.axes[0], one.half_m[0])
    assert ranges[[0, 3]] == pytest.approx(10.0 - math.sqrt(2.0), abs=1e-5)
    assert np.isinf(ranges[[1, 2]]).all()  # one passes it, one begins in it


@pytest.mark.parametrize(
    ("other", "depth"),
    [
        (box(1.5, 0.0), 0.5),
        (box(2.1, 0.0), 0.0),
        (box(2.3, 0.0, math.pi / 4.0), 1.0 + math.sqrt(2.0) - 2.3),
        (box(2.3, 2.3, math.pi / 4.0), 0.0),  # their bounding boxes overlap, they do not
    ],
)
def test_the_depth_of_an_overlap_is_the_least_way_out(other: Boxes, depth: float) -> None:
    assert depth_m(box(0.0, 0.0), 0, other, 0) == pytest.approx(depth, abs=1e-9)
    assert depth_m(other, 0, box(0.0, 0.0), 0) == pytest.approx(depth, abs=1e-9)


@pytest.fixture(scope="module")
def machine() -> Machine:
    return load_machine(None)


def standing(x_m: float, y_m: float = 0.0) -> VehicleState:
    return state_of_row(0, np.array([x_m, y_m, *np.zeros(16)]), ())


def test_a_machine_sees_the_others_and_not_itself(machine: Machine) -> None:
    company = Company({"lhd1": machine, "lhd2": machine})
    company.at("lhd1", standing(100.0))
    company.at("lhd2", standing(130.0))
    rays = np.array([[0.0, 0.0, 1.0, 1.0, 0.0, 0.0]], dtype=np.float32)
    sees = Among(Open(), company, "lhd1").near(np.array([100.0, 0.0, 1.0])).cast(rays)
    tail_m = machine.dimensions.wheelbase_m - float(machine.boxes("rear_link")[:, 0, 0].min())
    assert float(sees[0]) == pytest.approx(30.0 - tail_m, abs=0.05)
    company.at("lhd2", standing(300.0))
    assert np.isinf(Among(Open(), company, "lhd1").near(np.array([100.0, 0.0, 1.0])).cast(rays)).all()


def test_machines_that_overlap_touch_with_named_bodies(machine: Machine) -> None:
    company = Company({"lhd1": machine, "lhd2": machine})
    company.at("lhd1", standing(0.0))
    company.at("lhd2", standing(9.6))
    touched = company.touching("lhd1")
    assert touched
    assert all(one.other.startswith("lhd2 ") and 0.0 < one.depth_m < 0.2 for one in touched)
    company.at("lhd2", standing(11.0))
    assert company.touching("lhd1") == []

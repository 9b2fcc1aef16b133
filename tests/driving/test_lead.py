"""The leading body: driving in reverse is driving forward with the bodies exchanged."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.driving.bodies import bodies_of
from lhdmap.driving.kernel import stepped, trailing
from lhdmap.driving.lead import lead_of
from lhdmap.driving.model import drive_model
from lhdmap.driving.motion import Motion
from lhdmap.kinematics import T_base_rear, heading_rate
from lhdmap.machine import Machine

MACHINE = Machine()
MODEL, BODIES = drive_model(MACHINE), bodies_of(MACHINE)
ANGLES = st.floats(-0.69, 0.69)


def motion(heading: float, bend: float, speed: float, rate: float = 0.0) -> Motion:
    return Motion(0, 3.0, -2.0, heading, bend, rate, speed)


@given(st.floats(-3.0, 3.0), ANGLES)
def test_the_leading_axle_in_reverse_is_the_rear_one(heading: float, bend: float) -> None:
    state = lead_of(-1, MODEL, BODIES).state(motion(heading, bend, -1.0))
    rear = T_base_rear(bend, MACHINE)[:2, 3]
    c, s = math.cos(heading), math.sin(heading)
    assert state[:2] == pytest.approx((3.0 + c * rear[0] - s * rear[1], -2.0 + s * rear[0] + c * rear[1]))
    assert math.remainder(state[2] - (heading - bend + math.pi), 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert state[3] == -bend


@given(st.floats(-3.0, 3.0), ANGLES, st.sampled_from([1, -1]))
def test_base_and_lead_are_inverse(heading: float, bend: float, gear: int) -> None:
    lead = lead_of(gear, MODEL, BODIES)
    x, y, back = lead.base(lead.state(motion(heading, bend, 0.0)))
    assert (x, y) == pytest.approx((3.0, -2.0))
    assert math.remainder(back - heading, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


@given(ANGLES, st.floats(-3.0, 3.0), st.floats(-0.26, 0.26))
@settings(deadline=None)
def test_a_small_step_of_either_lead_is_the_same_motion_of_the_machine(bend: float, speed: float, rate: float) -> None:
    """Eq. (1) of the front body against the rear body's own steps."""
    start, dt = motion(0.4, bend, speed, rate), 1e-4
    turn = heading_rate(speed, bend, rate, MACHINE)
    wanted = (3.0 + speed * math.cos(0.4) * dt, -2.0 + speed * math.sin(0.4) * dt, 0.4 + turn * dt)
    for gear in (1, -1):
        lead = lead_of(gear, MODEL, BODIES)
        after = stepped(lead.state(start), lead.speed_mps(start), gear * rate, dt, lead.lead_m, lead.trail_m, 0.2)
        x, y, heading = lead.base(after)
        assert (x, y) == pytest.approx(wanted[:2], abs=1e-6)
        assert math.remainder(heading - wanted[2], 2 * math.pi) == pytest.approx(0.0, abs=1e-6)


def test_the_trailing_axle_hangs_on_the_joint() -> None:
    lead = lead_of(1, MODEL, BODIES)
    x, y, heading = trailing(lead.state(motion(0.3, 0.5, 0.0)), lead.lead_m, lead.trail_m)
    joint = np.array([3.0 - MODEL.front_m * math.cos(0.3), -2.0 - MODEL.front_m * math.sin(0.3)])
    assert math.hypot(x - joint[0], y - joint[1]) == pytest.approx(MODEL.rear_m)
    assert heading == pytest.approx(-0.2)


@pytest.mark.parametrize(
    ("kmh", "brake", "reaction", "wanted"),
    [(4, 2.5, 0.05, 0.74), (10, 2.5, 0.35, 3.62), (20, 2.5, 0.05, 8.66), (6.4, 2.0, 1.0, 3.27), (15, 1.2, 0.35, 10.4)],
)
def test_stopping_distances_of_the_findings(kmh: float, brake: float, reaction: float, wanted: float) -> None:
    model = MODEL._replace(brake_mps2=brake)
    assert model.stopping_m(kmh / 3.6, reaction) == pytest.approx(wanted, rel=0.03)


def test_the_outline_is_the_box_of_all_boxes_of_a_body() -> None:
    assert BODIES.front_m.min(axis=0) == pytest.approx([-1.5, -1.225])
    assert BODIES.front_m.max(axis=0) == pytest.approx([3.2, 1.225])
    assert BODIES.rear_m.min(axis=0) == pytest.approx([-3.11, -1.225])
    corners = {(-1.5, -1.225), (-1.5, 1.225), (3.2, -1.225), (3.2, 1.225)}
    assert corners <= {(round(float(x), 3), round(float(y), 3)) for x, y in BODIES.front_m}

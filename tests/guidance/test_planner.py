"""A cycle of guidance: the same problem in both gears, and what bounds its speeds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.driving.bodies import Bodies
from lhdmap.driving.kernel import State
from lhdmap.driving.lead import lead_of
from lhdmap.driving.motion import Motion
from lhdmap.guidance.directive import Directive, path_of
from lhdmap.guidance.planner import Guidance, Plan, method_of
from lhdmap.guidance.settings import GuidanceSettings
from lhdmap.messages import FloatArray

from tests.guidance.tunnels import BODIES, MODEL, narrow

SETTINGS = GuidanceSettings()
TURNED = Bodies(-BODIES.rear_m, -BODIES.front_m, -BODIES.rear_box_m[::-1], -BODIES.front_box_m[::-1])


def plan_of(gear: int, bodies: Bodies, state: State, line: FloatArray, walls: FloatArray) -> Plan:
    lead = lead_of(gear, MODEL, bodies)
    guidance = Guidance(MODEL, bodies, {1: 0.8, -1: 0.8}, SETTINGS, method_of(SETTINGS))
    motion = Motion(10**9, *lead.base(state), lead.gear * state[3], 0.0, 0.0)
    path = path_of(line, 2.5)
    return guidance.plan(10**9, motion, (), walls, Directive(10**9, gear, path, float(path[-1, 5]) - 5.0))


def test_reverse_is_forward_with_the_bodies_exchanged() -> None:
    line, walls = narrow(8.0, 60.0, 0.25)
    state = (float(line[200, 0]), float(line[200, 1]) + 0.1, 0.05, 0.02, 0.0)
    there, back = plan_of(1, BODIES, state, line, walls), plan_of(-1, TURNED, state, line, walls)
    for one, other in zip(there.setpoints, back.setpoints, strict=True):
        assert one.at_ns == other.at_ns
        assert other.speed_mps == pytest.approx(-one.speed_mps, abs=1e-6)
        assert other.steering_rate_rps == pytest.approx(-one.steering_rate_rps, abs=1e-6)


def test_a_plan_ends_before_a_wall_across_the_way() -> None:
    """Nothing leads around it: the predicted way may go on, the speeds do not."""
    line, walls = narrow(8.0, 20.0, 0.3)
    across = np.column_stack([np.full(81, 24.0), np.linspace(-4.0, 4.0, 81)])
    state = (float(line[150, 0]), 0.0, 0.0, 0.0, 0.0)
    plan = plan_of(1, BODIES, state, line, np.vstack([walls, across]))
    t = np.array([one.at_ns for one in plan.setpoints]) * 1e-9
    v = np.array([one.speed_mps for one in plan.setpoints])
    gone = float((0.5 * (v[1:] + v[:-1]) * np.diff(t)).sum())
    nose = float(BODIES.front_m[:, 0].max())
    left = 24.0 - state[0] - nose - gone
    assert v[-1] ** 2 / 2.0 < left * SETTINGS.brake_mps2


def test_a_machine_that_is_boxed_in_does_not_steer_where_it_stands() -> None:
    line, walls = narrow(8.0, 20.0, 0.3)
    across = np.column_stack([np.full(81, 18.25), np.linspace(-4.0, 4.0, 81)])
    state = (float(line[150, 0]), 0.0, 0.0, 0.1, 0.0)
    plan = plan_of(1, BODIES, state, line, np.vstack([walls, across]))
    assert max(one.speed_mps for one in plan.setpoints) < 0.05
    assert max(abs(one.steering_rate_rps) for one in plan.setpoints) < math.radians(0.5)


def test_the_horizon_reaches_as_far_at_any_speed() -> None:
    line, walls = narrow(8.0, 60.0, 0.25)
    state = (float(line[150, 0]), 0.0, 0.0, 0.0, 0.0)
    plan = plan_of(1, BODIES, state, line, walls)
    way = np.hypot(*np.diff(plan.solution.states[:, :2], axis=0).T).sum()
    assert way > 0.9 * SETTINGS.reach_m


@pytest.mark.parametrize("leaves", [False, True])
def test_a_machine_that_leaves_a_pile_creeps_past_what_slid_down_beside_it(*, leaves: bool) -> None:
    """Deep in a pile its banks touch the front body; going back by the way it came makes that no worse."""
    x = np.arange(-30.0, 10.0, 0.1)
    walls = np.concatenate([np.column_stack([x, np.full(len(x), side * 2.4)]) for side in (-1.0, 1.0)])
    y0 = float(BODIES.front_box_m[1, 1])
    banks = np.array([[at, side * (y0 - 0.08)] for at in np.arange(0.8, 2.6, 0.1) for side in (-1.0, 1.0)])
    guidance = Guidance(MODEL, BODIES, {1: 0.8, -1: 0.8}, SETTINGS, method_of(SETTINGS))
    line = np.column_stack([np.arange(2.0, -28.0, -0.1), np.zeros(300)])
    directive = Directive(10**9, -1, path_of(line, 1.5), 20.0, leaves)
    plan = guidance.plan(10**9, Motion(10**9, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (), np.vstack([walls, banks]), directive)
    speeds = np.array([-one.speed_mps for one in plan.setpoints])
    assert plan.clearance_m < 0.0
    assert (speeds.max() > 0.2) == leaves
    assert speeds.max() < 0.6

"""What path tracking and docking do in small scenarios in which each of their settings acts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from lhdmap.docking.planner import plan_dock
from lhdmap.docking.room import room_of
from lhdmap.docking.settings import DockingSettings
from lhdmap.driving.motion import Motion, Setpoint
from lhdmap.messages import FloatArray
from lhdmap.tracking.settings import TrackingSettings
from lhdmap.tracking.tracker import Tracker

from tests.guidance.tunnels import BODIES, MODEL
from tests.tracking.paths import turn
from tests.tracking.plant import Errors, Plant, placed


def tracks(settings: TrackingSettings) -> Iterator[Any]:
    """Yield commands: a bend from 1.5 m beside it, with failing poses; and from 22 m beside the path."""
    rows = turn(10.0 / 3.6, step=True, ends_m=12.0)
    for aside in (1.5, 22.0):
        tracker = Tracker(MODEL, settings)
        curve = tracker.follow(
            rows[::10, :2] + 0.01 * np.random.default_rng(4).standard_normal((len(rows[::10]), 2)), 8.0
        )
        plant = Plant(placed(-3.4, aside, 0.1, 0.05), MODEL, Errors(seed=5))
        yield curve.rows
        yield from _commands(tracker, plant)


def _commands(tracker: Tracker, plant: Plant) -> Iterator[Any]:
    for k in range(600):
        motion: Motion | None = plant.measured()
        if 160 <= k < 164:
            motion = motion._replace(x_m=motion.x_m + 0.55) if motion else None
        if 200 <= k < 214 or k == 100:
            motion = None if k % 2 else Motion(plant.now_ns, math.nan, 0.0, 0.0, 0.0, 0.0, 0.0)
        step = tracker.step(plant.now_ns, motion)
        yield step.speed_mps, step.steering_rate_rps, step.setpoints, step.state, step.reason
        plant.sent.append(Setpoint(plant.now_ns, step.speed_mps, step.steering_rate_rps))
        for _ in range(5):
            plant.step()


def docks(settings: DockingSettings) -> Iterator[Any]:
    """Yield plans: with room, with little, with something before the dock, and in a drift in which nobody turns round."""
    nothing = np.zeros((0, 2))
    for width, height, start, dock, blocked in (
        (45.0, 40.0, (10.0, 12.0, 0.5, 0.1), (22.0, 32.95, -0.5 * math.pi), nothing),
        (30.0, 22.0, (10.0, 8.0, 2.5, 0.0), (15.0, 14.95, -0.5 * math.pi), nothing),
        (45.0, 40.0, (10.0, 12.0, 0.5, 0.0), (22.0, 32.9, -0.5 * math.pi), np.array([[22.0, 27.0]])),
        (20.0, 4.0, (10.0, 2.0, 0.0, 0.0), (9.0, 2.0, math.pi), nothing),
    ):
        room = room_of(apron(width, height), MODEL, BODIES, settings.margin_m, blocked)
        yield plan_dock(np.array(start), np.array(dock), room, MODEL, settings)


def apron(width_m: float, height_m: float) -> FloatArray:
    """A rectangle from the origin."""
    return np.array([[0.0, 0.0], [width_m, 0.0], [width_m, height_m], [0.0, height_m]])

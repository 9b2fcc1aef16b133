"""Aprons with a dock on their far side, starts on them, and plans driven by a machine with errors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from lhdmap.docking.planner import DockPlan
from lhdmap.docking.room import Room
from lhdmap.docking.run import LegRun
from lhdmap.docking.settings import DockingSettings
from lhdmap.driving.model import DriveModel
from lhdmap.messages import FloatArray
from lhdmap.tracking.settings import TrackingSettings
from lhdmap.tracking.tracker import Tracker

from tests.tracking.plant import Errors, Plant, drive, placed

Row = dict[str, Any]
SETTINGS = DockingSettings()
_EDGE_M = 0.05  # of the dock beyond the margin


def apron(width_m: float, height_m: float) -> FloatArray:
    """A rectangle from the origin."""
    return np.array([[0.0, 0.0], [width_m, 0.0], [width_m, height_m], [0.0, height_m]])


def dock_on(width_m: float, height_m: float, model: DriveModel, rear_m: float) -> FloatArray:
    """A dock in the middle of the far side: the machine's rear at it, `base_link` (3,)."""
    deep = SETTINGS.margin_m + _EDGE_M + rear_m + model.front_m + model.rear_m
    return np.array([0.5 * width_m, height_m - deep, -0.5 * math.pi])


def rear_of(pose: FloatArray, model: DriveModel) -> FloatArray:
    """The rear axle and the joint (4,) of x, y, heading of `base_link` and joint angle."""
    back = pose[2] - pose[3]
    x = pose[0] - model.front_m * math.cos(pose[2]) - model.rear_m * math.cos(back)
    y = pose[1] - model.front_m * math.sin(pose[2]) - model.rear_m * math.sin(back)
    return np.array([x, y, back, pose[3]])


def rocks(count: int, width_m: float, height_m: float, rng: np.random.Generator) -> FloatArray:
    """Outlines of round things of 1.6 m, not before the dock."""
    around = np.linspace(0.0, 2.0 * math.pi, 12, endpoint=False)
    circle = 0.8 * np.column_stack([np.cos(around), np.sin(around)])
    middles = [(rng.uniform(0.0, width_m), rng.uniform(0.0, 0.4 * height_m)) for _ in range(count)]
    return np.concatenate([circle + np.array(one) for one in middles]) if middles else np.zeros((0, 2))


def start_on(room: Room, width_m: float, height_m: float, model: DriveModel, rng: np.random.Generator) -> FloatArray:
    """Anywhere, any heading, straight, where the bodies fit."""
    while True:
        pose = np.array(
            [*rng.uniform((2.0, 2.0), (width_m - 2.0, height_m - 2.0)), rng.uniform(-math.pi, math.pi), 0.0]
        )
        if room.free(rear_of(pose, model)[None]):
            return pose


def docked(model: DriveModel, plan: DockPlan, start: FloatArray, dock: FloatArray, seed: int, room: Room) -> Row:
    """Drive a plan from a configuration of the rear axle (4,); errors at the dock, whether the bodies stayed in the room."""
    tracker = Tracker(model, TrackingSettings())
    x, y, heading, bend = start.tolist()
    plant = Plant(placed(x, y, heading, bend), model, Errors(seed=seed))
    out = drive(tracker, plant, plan.legs[-1].rows, 400.0, LegRun(tracker, plan.legs, SETTINGS.speed_mps))
    goal = rear_of(np.append(dock, 0.0), model)
    off = np.array(plant.state[:2]) - goal[:2]
    c, s = math.cos(goal[2]), math.sin(goal[2])
    turned = (plant.state[2] - goal[2] + math.pi) % (2.0 * math.pi) - math.pi
    left = room.first_miss(np.ascontiguousarray(out.table()[:, 1:5]), 1)
    return {
        "arrived": out.arrived, "off_m": float(np.hypot(*off)), "aside_m": float(abs(c * off[1] - s * off[0])),
        "off_deg": math.degrees(abs(turned)), "bend_deg": math.degrees(abs(plant.state[3])), "in_room": left < 0,
        "track": out.table()[::5, 1:5].round(3).tolist() if seed < 4 else [],
    }  # fmt: skip

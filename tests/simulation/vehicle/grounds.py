"""Floors whose truth is known, and short ways to command a machine."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from lhdmap.messages import Command, FloatArray
from lhdmap.simulation.vehicle.state import VehicleState
from lhdmap.simulation.vehicle.vehicle import Vehicle

STEP_S = 0.01


class Plane:
    """A floor that rises evenly: `along` per metre of x, `across` per metre of y."""

    def __init__(self, along: float = 0.0, across: float = 0.0, friction: float = 0.6) -> None:
        self.along, self.across, self.mu = along, across, friction

    def floor_height(self, points_m: FloatArray) -> FloatArray:
        return self.along * points_m[:, 0] + self.across * points_m[:, 1]

    def friction(self, position_m: FloatArray) -> float:
        return self.mu


class Waves:
    """A floor of waves, on two levels 5 m above each other."""

    def floor_height(self, points_m: FloatArray) -> FloatArray:
        x, y, z = points_m.T
        waves = 0.2 * np.sin(0.9 * x + 0.4) * np.cos(0.7 * y) + 0.05 * y
        return waves + 5.0 * np.round((z - waves) / 5.0)

    def friction(self, position_m: FloatArray) -> float:
        return 0.6


def command(
    propel: float = 0.0,
    steering_rps: float = 0.0,
    *,
    tilt: float = 0.0,
    lift: float = 0.0,
    rpm: bool = False,
    brake: bool = False,
) -> Command:
    return Command(0, propel, steering_rps, tilt, lift, rpm, brake)


def drive(
    vehicle: Vehicle, state: VehicleState, given: Command | Callable[[float], Command], seconds: float
) -> list[VehicleState]:
    """Return the states after each step of 10 ms; `given` is a command or a function of the middle of the step, s."""
    states = [state]
    for k in range(round(seconds / STEP_S)):
        now = given if isinstance(given, Command) else given((k + 0.5) * STEP_S)
        states.append(vehicle.step(states[-1], now, STEP_S))
    return states


def column(states: list[VehicleState], name: str) -> FloatArray:
    return np.array([getattr(state, name) for state in states])


def since_it_counts(states: list[VehicleState]) -> FloatArray:
    """Return the time of each state after the dead time of what was given at the first, s."""
    time_s: FloatArray = np.arange(len(states), dtype=float) * STEP_S - 0.25
    return time_s

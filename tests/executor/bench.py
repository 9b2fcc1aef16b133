"""A machine on a floor whose commands come from an executor."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from lhdmap.driving.model import DriveModel, drive_model
from lhdmap.driving.motion import Motion, Setpoint, Setpoints
from lhdmap.executor.executor import Executor
from lhdmap.executor.notes import Stop
from lhdmap.executor.settings import ExecutorSettings
from lhdmap.kinematics import articulation_along_path
from lhdmap.machine import Machine
from lhdmap.messages import Command, FloatArray
from lhdmap.simulation.vehicle.state import VehicleState
from lhdmap.simulation.vehicle.vehicle import Vehicle

from tests.simulation.vehicle.grounds import Plane

STEP_S = 0.01
_STAGE_S, _STAGES, _LEAD_S = 0.15, 25, 0.03
SECOND = 1_000_000_000


def motion_of(state: VehicleState) -> Motion:
    return Motion(
        state.time_ns,
        state.x_m,
        state.y_m,
        state.yaw_rad,
        state.articulation_rad,
        state.articulation_rate_rps,
        state.speed_mps,
    )


def even(
    speed_mps: float, now_ns: int, rate: Callable[[float], float] | None = None, stages: int = _STAGES
) -> Setpoints:
    """A plan of one speed; `rate` says the joint's rate at a time (s)."""
    times = [now_ns + round((_LEAD_S + k * _STAGE_S) * SECOND) for k in range(stages)]
    return tuple(Setpoint(at, speed_mps, 0.0 if rate is None else rate(at / SECOND)) for at in times)


class Bench:
    """A machine with its executor; `drive` runs it."""

    def __init__(self, machine: Machine | None = None, *, load_kg: float = 0.0, grade: float = 0.0) -> None:
        self.machine = machine or Machine()
        self.model: DriveModel = drive_model(self.machine, load_kg)
        self.executor = Executor(self.model, ExecutorSettings())
        self.vehicle = Vehicle(self.machine, Plane(along=grade))
        self.states = [self.vehicle.at_rest(0.0, 0.0, 0.0, near_z_m=0.0, load_kg=load_kg, time_ns=0)]
        self.commands: list[Command] = []
        self.pull_mps2 = -9.81 * math.sin(math.atan(grade))

    @property
    def state(self) -> VehicleState:
        return self.states[-1]

    def roll(self, speed_mps: float) -> None:
        """Let it roll at a speed, as if it had been driven so for long."""
        start = self.state._replace(speed_mps=speed_mps, wheel_speed_mps=speed_mps)
        given = Command(start.time_ns, speed_mps / self.model.top_speed_mps, 0.0, 0.0, 0.0, full_rpm=False, brake=False)
        self.states = [start._replace(pending=((start.time_ns, given),))]

    def drive(
        self,
        seconds: float,
        plan: Callable[[int], Setpoints] | None = None,
        stop: Stop = Stop.GO,
        *,
        seen: bool = True,
        until_rest: bool = False,
        hand: Callable[[Command], Command] = lambda command: command,
    ) -> None:
        """Drive; a plan is asked for each 50 ms. `seen`: whether the motion is; `hand` changes what the machine is told."""
        for k in range(round(seconds / STEP_S)):
            now_ns = self.state.time_ns
            if plan is not None and k % 5 == 0:
                self.executor.insert(plan(now_ns), now_ns)
            motion = motion_of(self.state) if seen else None
            command = self.executor.step(now_ns, motion, stop, "test", self.pull_mps2)
            self.commands.append(command)
            self.states.append(self.vehicle.step(self.state, hand(command), STEP_S))
            if until_rest and abs(self.state.speed_mps) < 1e-3:
                return

    def way_m(self, since: int = 0) -> float:
        """The way of the front axle from a state on."""
        places = np.array([(one.x_m, one.y_m, one.z_m) for one in self.states[since:]])
        return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())


def bend_over_way(radius_m: float, ramp_m: float = 4.0, length_m: float = 60.0) -> tuple[FloatArray, FloatArray]:
    """Way and joint angle from a straight into a bend over a ramp."""
    way = np.arange(0.0, length_m, 0.01)
    curvature = np.clip(way / ramp_m, 0.0, 1.0) / radius_m
    return way, articulation_along_path(curvature, 0.01, 1.7, 1.7)

"""Machines of a crew in plan: true executives, navigation and section control; who drives, digs and dumps is made up.

No scan and no guidance: the leading axle is on its path, the other one is drawn after it. What navigation believes is the truth.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from lhdmap.config import Settings
from lhdmap.driving.bodies import bodies_of
from lhdmap.driving.model import DriveModel, drive_model
from lhdmap.guidance.directive import HEADING, SPEED, WAY, Directive, X, Y
from lhdmap.loading.states import State
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, Joints, Tachometer
from lhdmap.navigation.along import Located, along_m
from lhdmap.pipeline.pose_now import PoseNow
from lhdmap.replay.assemble_mission import executive_of, navigation_of
from lhdmap.replay.crew_mission import CrewMission, Job
from lhdmap.replay.journal import Journal
from lhdmap.replay.namespace import InNamespace, JournalOf, Scribes
from lhdmap.replay.process import (
    APPROACH,
    DIRECTIVE,
    DUMPING,
    LOADING,
    LOCATED,
    MACHINE_SAYS,
    NAVIGATING,
    ORDERS,
    POSE,
    STATE,
    Outgoing,
    Process,
    Received,
)
from lhdmap.replay.processes.executive import EXECUTIVE
from lhdmap.replay.processes.feed import JOINTS, TACHOMETER
from lhdmap.replay.processes.navigator import NAVIGATION
from lhdmap.replay.processes.told import DumpingNow, Health, LoadingNow, Navigating, Orders
from lhdmap.replay.scenario import Scenario
from lhdmap.topology.model import TopologicalMap

from tests.replay.doubles import Unicycle

PERIOD_S = 0.1
_SLOWS_MPS2 = 0.5
_TAKES_OVER_M, _APPROACH_MPS, _DIGS_S, _BACK_M = 12.0, 1.0, 15.0, 8.0
_DUMPS_S = 15.0


class Planar(Process):
    """The machine, its loading and its dumping, and what perception would say of it; the pile is at the draw point.

    The loading task takes the machine over some way before the pile, and pulls back from it with a full bucket.
    """

    name, period_ns, priority = "plant", round(PERIOD_S * 1e9), 0
    reads = (DIRECTIVE, APPROACH, ORDERS, NAVIGATING)

    def __init__(self, pose_map: FloatArray, model: DriveModel) -> None:
        """`pose_map` (3,): of `base_link` at first."""
        self._model, self._speed_mps = model, 0.0
        self.front_m, self.heading_rad, self.rear_heading_rad = (
            pose_map[:2].copy(),
            float(pose_map[2]),
            float(pose_map[2]),
        )
        self._directive: Directive | None = None
        self._orders, self._left_m = Orders(0, 0, "", loaded=False), math.inf
        self._loading, self._digging_s, self._number = State.IDLE, 0.0, 0
        self._dumped_s, self._dump = 0.0, 0
        self._to_go_m = 0.0

    @property
    def joint_m(self) -> FloatArray:
        """Where the joint is (2,)."""
        return self.front_m - self._model.front_m * _unit(self.heading_rad)

    @property
    def rear_m(self) -> FloatArray:
        """Where the rear axle is (2,)."""
        return self.joint_m - self._model.rear_m * _unit(self.rear_heading_rad)

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Move, work, and say it."""
        for received in inbox:
            self._take(received)
        self._load()
        self._drive()
        T = np.eye(4)
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        T[:2, :2], T[:2, 3] = [[c, -s], [s, c]], self.front_m
        pose = np.array([*self.front_m, self.heading_rad])
        yield Outgoing(POSE, PoseNow(now_ns, T, np.eye(3) * 1e-4, 0.0, "scan"))
        yield Outgoing(LOCATED, Located(now_ns, "tracking", pose, pose, np.eye(3) * 1e-4, 0.0))
        bend_rad = math.remainder(self.heading_rad - self.rear_heading_rad, math.tau)
        yield Outgoing(JOINTS, Joints(now_ns, {"articulation": bend_rad}, {"articulation": 0.0}))
        yield Outgoing(TACHOMETER, Tachometer(now_ns, self._speed_mps))
        stands = self._speed_mps == 0.0
        yield Outgoing(MACHINE_SAYS, Health(now_ns, True, "autonomous", stands, ()))
        fill = 0.95 if self._loading == State.DONE else math.nan
        yield Outgoing(LOADING, LoadingNow(now_ns, self._number, self._loading, "", 1, fill, 0.01, None))
        if self._dump:
            done = self._dumped_s > _DUMPS_S
            yield Outgoing(DUMPING, DumpingNow(now_ns, self._dump, "done" if done else "busy"))
        x, y = self.front_m.tolist()
        yield Outgoing(
            STATE,
            Unicycle(now_ns, x, y, yaw_rad=self.heading_rad, articulation_rad=bend_rad, speed_mps=self._speed_mps),
        )

    def _take(self, received: Received) -> None:
        message = received.message
        if received.topic in (DIRECTIVE, APPROACH):
            self._directive = message.directive
        elif received.topic == NAVIGATING:
            assert isinstance(message, Navigating)
            self._left_m = message.left_m
        else:
            self._orders = message
            if message.dumping != self._dump:
                self._dump, self._dumped_s = message.dumping, 0.0

    def _load(self) -> None:
        """Go on with loading and dumping."""
        self._dumped_s += PERIOD_S
        orders = self._orders
        if orders.loading not in (0, self._number):
            self._number, self._loading, self._digging_s = orders.loading, State.IDENTIFICATION, 0.0
        elif not orders.loading:
            self._loading = State.IDLE
        if self._loading == State.IDENTIFICATION and self._left_m < _TAKES_OVER_M and self._directive is not None:
            self._loading, self._to_go_m = State.POSITIONING, self._left_m
        elif self._loading == State.POSITIONING and self._to_go_m <= 0.0:
            self._loading = State.EXCAVATION
        elif self._loading == State.EXCAVATION:
            self._digging_s += PERIOD_S
            if self._digging_s > _DIGS_S:
                self._loading, self._to_go_m = State.PULL_BACK, _BACK_M
        elif self._loading == State.PULL_BACK and self._to_go_m <= 0.0:
            self._loading = State.DONE

    def _drive(self) -> None:
        """Move for a period: straight where the loading task drives, else along the path."""
        if self._loading in (State.POSITIONING, State.PULL_BACK):
            sign = 1.0 if self._loading == State.POSITIONING else -1.0
            self.front_m = self.front_m + sign * _APPROACH_MPS * PERIOD_S * _unit(self.heading_rad)
            self._to_go_m -= _APPROACH_MPS * PERIOD_S
            self._speed_mps = sign * _APPROACH_MPS
            return
        self._speed_mps = 0.0
        told = self._directive
        if told is None or self._loading in (State.EXCAVATION, State.DONE):
            return
        lead_m = self.front_m if told.gear > 0 else self.rear_m
        at_m = along_m(told.path, *lead_m.tolist())
        left_m = min(told.stop_m, float(told.path[-1, WAY])) - at_m
        if left_m <= 0.0:
            return
        speed = min(float(np.interp(at_m, told.path[:, WAY], told.path[:, SPEED])), math.sqrt(2 * _SLOWS_MPS2 * left_m))
        step_m = min(max(speed, 0.1) * PERIOD_S, left_m)
        way = told.path[:, WAY]
        lead = np.array([np.interp(at_m + step_m, way, told.path[:, k]) for k in (X, Y)])
        self._lead_to(told.gear, lead, float(np.interp(at_m + step_m, way, told.path[:, HEADING])))
        self._speed_mps = told.gear * step_m / PERIOD_S

    def _lead_to(self, gear: int, lead_m: FloatArray, heading_rad: float) -> None:
        """Put the leading axle somewhere; the joint is where its body has it, and draws the other axle."""
        if gear > 0:
            rear_m = self.rear_m
            self.front_m, self.heading_rad = lead_m, heading_rad
            self.rear_heading_rad = math.atan2(*(self.joint_m - rear_m)[::-1])
            return
        front_m, self.rear_heading_rad = self.front_m, heading_rad + math.pi
        joint_m = lead_m + self._model.rear_m * _unit(self.rear_heading_rad)
        self.heading_rad = math.atan2(*(front_m - joint_m)[::-1])
        self.front_m = joint_m + self._model.front_m * _unit(self.heading_rad)


def _unit(heading_rad: float) -> FloatArray:
    return np.array([math.cos(heading_rad), math.sin(heading_rad)])


def crew_processes(
    scenario: Scenario,
    given: CrewMission,
    topology: TopologicalMap,
    starts: Mapping[str, FloatArray],
    journal: Journal,
) -> list[Process]:
    """Return the processes of all machines; `starts`: poses (3,) in `map` by name, the first machine's first."""
    made: list[Process] = []
    for number, (name, pose) in enumerate(starts.items()):
        scribes = JournalOf(journal, name) if number else journal
        own = machine_processes(scenario, given.jobs[name], topology, pose, scribes)
        made += [InNamespace(one, name) for one in own] if number else own
    return made


def machine_processes(
    scenario: Scenario, job: Job, topology: TopologicalMap, pose: FloatArray, journal: Scribes
) -> list[Process]:
    """Return the processes of one machine: as in a replay, but for what is made up."""
    machine = Machine()
    model = drive_model(machine, 0.0)
    return [
        Planar(pose, model),
        executive_of(scenario, topology, 1e-3 * machine.drive.payload_kg, journal.of(EXECUTIVE), job),
        navigation_of(topology, Settings(), (model, bodies_of(machine)), journal.of(NAVIGATION), job),
    ]

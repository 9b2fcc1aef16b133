"""`simulate_mine`: an operator drives a route through a mine; a log with its truth comes out.

plan -> network -> route -> legs -> operator ⇄ vehicle over the floor -> history -> sensors -> log
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.errors import InputError, LhdmapWarning, UsageError
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, GroundTruth, Record
from lhdmap.mine.network import Network
from lhdmap.mine.route import Start, parse_route, start_of
from lhdmap.mine.routes import RouteFinder
from lhdmap.mine.topology import Directory, topology_json
from lhdmap.mine.ways import Leg, legs_of
from lhdmap.outputs import OutputFiles
from lhdmap.roles import ROLES
from lhdmap.simulation.history import SECOND_NS, START_NS, Column, History
from lhdmap.simulation.mesh_file import write_ply
from lhdmap.simulation.mine_world.bumper import Bumper
from lhdmap.simulation.mine_world.world import MineWorld
from lhdmap.simulation.operator import Operator, OperatorSettings, wander_of
from lhdmap.simulation.sensing.faults import FaultSettings, with_faults
from lhdmap.simulation.sensing.sections import SensorSettings
from lhdmap.simulation.sensing.sensor import Due, Sensor
from lhdmap.simulation.sensing.suite import sensors_of
from lhdmap.simulation.vehicle.shaking import VIBRATION_DEG, Shaking
from lhdmap.simulation.vehicle.state import VehicleState
from lhdmap.simulation.vehicle.vehicle import Vehicle
from lhdmap.trajectory import Trajectory, write_tum

STEP_NS = SECOND_NS // 100
_COMMAND_STEPS = 5
_LOOK_STEPS = 10
_REST_STEPS = 100
_SLOWER = 1.6  # a drive with its bends and rests takes so much longer than its way at full speed
_LATE = 4.0  # times the expected duration: he will not arrive any more

Progress = Callable[[Iterator[Record], float], Iterator[Record]]


@dataclass(frozen=True, slots=True)
class MineDriveSettings:
    """A drive through a mine: where, how, and what is in the log."""

    route: str = ""
    start: str = ""
    seed: int = 0
    names: bool = False
    truth: bool = True
    operator: OperatorSettings = field(default_factory=OperatorSettings)
    sensors: SensorSettings = field(default_factory=SensorSettings)
    faults: tuple[FaultSettings, ...] = ()
    vibration_deg: float = VIBRATION_DEG


@dataclass(frozen=True, slots=True)
class SimulatedMineDrive:
    """What `simulate_mine` wrote and what was driven; `contacts` are the bodies that touched something, with where."""

    log: Path
    truth_file: Path
    topology_file: Path
    nodes_file: Path
    scans: int
    messages: int
    duration_s: float
    distance_m: float
    min_clearance_m: float
    contacts: tuple[str, ...]


class DriveGauge:
    """What is measured of a drive: its way, how near the bodies came to walls (1 m: not nearer), and what they touched."""

    def __init__(self, bumper: Bumper, directory: Directory) -> None:
        self._bumper, self._directory = bumper, directory
        self.distance_m, self.min_clearance_m = 0.0, 1.0
        self.contacts: list[str] = []

    def look(self, state: VehicleState) -> None:
        """Note how near the bodies are to walls, and what they touch."""
        self.min_clearance_m = self._bumper.clearance_m(state, self.min_clearance_m)
        if self.min_clearance_m > 0.0:
            return
        for touch in self._bumper.touching(state):
            where = self._directory.at(state.position_m)
            told = f"{touch.body} in {where.node} at {where.at_m:.0f} m"
            if told not in self.contacts:
                self.contacts.append(told)


class MineDrive:
    """An operator in a machine in a mine, step by step: `records` yields what the log gets."""

    def __init__(self, network: Network, machine: Machine, settings: MineDriveSettings) -> None:
        """Plan the route.

        Raises:
            UsageError: route or start are not in the plan, or there is no way.
        """
        self.network, self.machine, self.settings = network, machine, settings
        start = start_of(network, machine, settings.start or None)
        self.legs = planned(network, machine, start, settings.route, settings.operator, settings.seed)
        self.world = MineWorld(network, machine, view_m=settings.sensors.scanner.max_range_m + 5.0)
        self.directory = Directory(network)
        self._vehicle = Vehicle(machine, self.world, seed=settings.seed)
        x, y, z, yaw = network.tubes[start.tube].pose(start.at_m, start.facing).tolist()
        self.state = self._vehicle.at_rest(x, y, yaw, near_z_m=z, time_ns=START_NS)
        self._operator = Operator(self.legs, machine, settings.operator, seed=settings.seed)
        self._command = self._operator.command(self.state, START_NS)
        self._shaking = Shaking(math.radians(settings.vibration_deg), settings.seed)
        self.gauge = DriveGauge(Bumper(machine, self.world), self.directory)

    @property
    def expected_s(self) -> float:
        """How long the drive takes, about."""
        way_m = sum(leg.length_m for leg in self.legs)
        return _SLOWER * way_m / (self.settings.operator.speed_kmh / 3.6) + 8.0 * len(self.legs)

    def records(self) -> Iterator[Record]:
        """Yield all messages in the order of their log time, the truth always among them.

        Raises:
            InputError: the operator does not come to the end of his route.
        """
        history, due = History(SECOND_NS // STEP_NS), Due(self._sensors())
        for _ in self._states():
            history.append(self._row())
            yield from due.read(history, self.world)

    def drive(self) -> list[VehicleState]:
        """Drive without sensors; return the state each 0.1 s.

        Raises:
            InputError: as `records`.
        """
        return [state for step, state in enumerate(self._states()) if step % _LOOK_STEPS == 0]

    def _states(self) -> Iterator[VehicleState]:
        """Yield the state at each step, until the operator has rested for a moment at the end of his route."""
        after = 0
        for step in range(round(_LATE * (self.expected_s + 60.0) * SECOND_NS / STEP_NS)):
            yield self.state
            after += self._operator.done
            if after > _REST_STEPS:
                return
            self._advance(step)
        where = self.directory.at(self.state.position_m)
        raise InputError(
            f"the operator is stuck in '{where.node}' at {where.at_m:.0f} m, on leg {self._operator.leg + 1}"
        )

    def _sensors(self) -> list[Sensor]:
        settings = self.settings
        node = node_of(self.directory) if settings.names else None
        sensors = sensors_of(self.machine, settings.sensors, seed=settings.seed, node=node, truth=True)
        return with_faults(sensors, settings.faults, seed=settings.seed)

    def _row(self) -> FloatArray:
        return self._shaking.onto(self.state.row(), (self.state.time_ns - START_NS) / SECOND_NS)

    def _advance(self, step: int) -> None:
        if step % _COMMAND_STEPS == 0:
            self._command = self._operator.command(self.state, self.state.time_ns)
        self.state = self._vehicle.step(self.state, self._command, STEP_NS / SECOND_NS)
        self.gauge.distance_m += abs(self.state.speed_mps) * STEP_NS / SECOND_NS
        if step % _LOOK_STEPS == 0:
            self.gauge.look(self.state)


def planned(
    network: Network, machine: Machine, start: Start, route: str, operator: OperatorSettings, seed: int
) -> list[Leg]:
    """Return the legs of a route, or of a teaching drive through every drift where it is empty.

    Warns of drifts that a teaching drive cannot reach.

    Raises:
        UsageError: the route is not in the plan, there is no way, or none to drive.
    """
    planner = RouteFinder(network, machine)
    runs = planner.route(start, parse_route(route, network.plan)) if route else planner.teaching(start)
    way_m = sum(abs(run.to_m - run.from_m) for run in runs)
    pose = network.tubes[start.tube].pose(start.at_m, start.facing)
    legs = legs_of(network, runs, machine, start=pose, wander=wander_of(operator, way_m, seed))
    if not legs:
        where = (
            f"route {route}: the machine is there already" if route else "the machine fills the drift that it stands in"
        )
        raise UsageError(f"{where}; a way to drive was wanted")
    if not route and planner.left_out:
        warnings.warn(f"no way leads to {', '.join(planner.left_out)}: not driven through", LhdmapWarning, stacklevel=2)
    return legs


def node_of(directory: Directory) -> Callable[[int, FloatArray], str]:
    """Return what tells the node that a machine is in for a stamp and its state (20,): the operator's `/operation/node`."""

    def told(_stamp_ns: int, state: FloatArray) -> str:
        return directory.at(state[[Column.X, Column.Y, Column.Z]]).node

    return told


def simulate_mine(
    network: Network,
    machine: Machine,
    settings: MineDriveSettings,
    path: Path,
    *,
    mesh_path: Path | None = None,
    progress: Progress | None = None,
    force: bool = False,
) -> SimulatedMineDrive:
    """Simulate a drive into the log `path`; beside it `.truth.tum`, `.topology.json` and `.nodes.csv` (contract: mine plans).

    `mesh_path` takes the mine's surface (PLY, in `map`).

    Raises:
        UsageError: a file exists already (without `force`), the log's name does not end in .mcap, or there is no such route.
        InputError: the operator does not arrive.
    """
    if path.suffix != ".mcap":
        raise UsageError(f"{path}: logs are written as MCAP, so a name that ends in .mcap was wanted")
    truth_file, topology_file = path.with_suffix(".truth.tum"), path.with_suffix(".topology.json")
    nodes_file = path.with_suffix(".nodes.csv")
    drive = MineDrive(network, machine, settings)
    with OutputFiles(truth_file, topology_file, nodes_file, mesh_path, path, force=force) as files:
        if mesh_path is not None:
            write_ply(files.at(mesh_path), drive.world.meshes())
        table = topology_json(network, machine)
        files.at(topology_file).write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
        messages, truth = _written(drive, files.at(path), files.at(nodes_file), progress)
        write_tum(files.at(truth_file), truth)
    duration_s = (drive.state.time_ns - START_NS) / SECOND_NS
    return SimulatedMineDrive(
        path, truth_file, topology_file, nodes_file, len(truth.stamps_ns), messages, duration_s, drive.gauge.distance_m,
        drive.gauge.min_clearance_m, tuple(drive.gauge.contacts),
    )  # fmt: skip


def _written(drive: MineDrive, path: Path, nodes_file: Path, progress: Progress | None) -> tuple[int, Trajectory]:
    """Write log and nodes; return how many messages the log has, and the truth at the front scans."""
    from lhdmap.logs.writer import LogWriter

    topic, wanted = ROLES["ground_truth"].topic, drive.settings.truth
    rows: list[tuple[Any, ...]] = []
    messages = 0
    stream = drive.records()
    with LogWriter(path) as writer, nodes_file.open("w", encoding="utf-8") as nodes:
        nodes.write("stamp_ns,node,at_m\n")
        for record in progress(stream, drive.expected_s) if progress else stream:
            if isinstance(record.message, GroundTruth):
                truth = record.message
                rows.append((truth.stamp_ns, truth.position_m, truth.quaternion_xyzw))
                place = drive.directory.at(truth.position_m)
                nodes.write(f"{truth.stamp_ns},{place.node},{place.at_m:.2f}\n")
            if wanted or record.topic != topic:
                writer.write(record.topic, record.message, record.log_time_ns)
                messages += 1
    stamps = np.array([row[0] for row in rows], dtype=np.int64)
    positions, quaternions = (np.array([row[k] for row in rows]).reshape(len(rows), -1) for k in (1, 2))
    return messages, Trajectory(stamps, positions, quaternions)

"""The parts of a replay in a mine: world of its plan, stepped machine, sensors, an operator who drives a route."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lhdmap.config import Settings
from lhdmap.geometry import se2
from lhdmap.machine import Machine, load_machine
from lhdmap.messages import FloatArray
from lhdmap.mine.make_network import make_network
from lhdmap.mine.network import Network
from lhdmap.mine.plan import find_plan, load_plan
from lhdmap.mine.route import Start, start_of
from lhdmap.mine.stands import place_pose
from lhdmap.mine.topology import Directory
from lhdmap.mine.ways import Leg
from lhdmap.replay.faults import Position
from lhdmap.replay.parts import Autonomous, Parts, Touch
from lhdmap.replay.scenario import AUTONOMOUS, OPERATOR, TELEOPERATOR, Scenario
from lhdmap.replay.teaching import autonomous_of
from lhdmap.simulation.ground.mine import mine_piles
from lhdmap.simulation.ground.sections import load_ground
from lhdmap.simulation.ground.vehicle import LoadingVehicle
from lhdmap.simulation.history import START_NS
from lhdmap.simulation.mine_drive import node_of, planned
from lhdmap.simulation.mine_world.bumper import Bumper
from lhdmap.simulation.mine_world.world import MineWorld
from lhdmap.simulation.operator import Operator, OperatorSettings
from lhdmap.simulation.sensing.sections import SensorSettings
from lhdmap.simulation.sensing.suite import sensors_of
from lhdmap.simulation.vehicle.shaking import VIBRATION_DEG, Shaking
from lhdmap.simulation.vehicle.state import VehicleState
from lhdmap.simulation.vehicle.vehicle import Vehicle
from lhdmap.topology.model import AccessPoint, Waypoint

_DRAWN_M = 1.0
_KG = 1000.0  # of a tonne
_SLOWER = 1.4  # a drive with its bends and rests takes so much longer than its way at full speed
TOLD = {OPERATOR: "manual", TELEOPERATOR: "teleoperated"}
_BUCKET_S = 200.0  # about what one takes in the mines that ship: how far a run is, is told by it
_LEAST_CLEAR_M = 1.0  # what is farther is not measured


class BodyBumper:
    """What the boxes of a machine touch in a mine."""

    def __init__(self, machine: Machine, world: MineWorld) -> None:
        self._bumper = Bumper(machine, world)

    def touching(self, state: VehicleState) -> Sequence[Touch]:
        """Return the bodies that are in a wall."""
        found = self._bumper.touching(state)
        return [Touch(one.body, _point(one.point_m), one.depth_m) for one in found]

    def clearance_m(self, state: VehicleState) -> float:
        """Return the least distance of any body from a wall, at most 1 m."""
        return self._bumper.clearance_m(state, _LEAST_CLEAR_M)


def mine_parts(scenario: Scenario, folder: Path, settings: Settings) -> Parts:
    """Return the parts of a drive in a mine; a map that is wanted and not there is made, in `folder` where none is named.

    Raises:
        ConfigError: there is no such mine.
        UsageError: the route, the start or the goal is not in it.
    """
    machine = load_machine(Path(scenario.machine) if scenario.machine else None)
    network = make_network(load_plan(find_plan(scenario.mine)))
    start = start_of(network, machine, scenario.start or None)
    drives_itself = scenario.who == AUTONOMOUS
    operating = OperatorSettings(speed_kmh=scenario.speed_kmh, wander_m=scenario.wander_m)
    legs = _legs(scenario, network, machine, start, operating)
    autonomous = autonomous_of(scenario, network, machine, folder, settings) if drives_itself else None
    told = mode_of(TOLD[scenario.who]) if autonomous is None else autonomous.mode
    world = MineWorld(network, machine)
    vehicle = _vehicle(scenario, machine, world)
    places = places_of(network, machine)
    way_m = sum(leg.length_m for leg in legs)
    parts = Parts(
        machine=machine,
        world=world,
        vehicle=vehicle,
        start=_state(vehicle, network.tubes[start.tube].pose(start.at_m, start.facing), scenario),
        sensors=sensors_of(machine, SensorSettings(), seed=scenario.seed, mode=told, node=node_of(Directory(network))),
        operator=None if drives_itself else Operator(legs, machine, operating, seed=scenario.seed),
        bumper=BodyBumper(machine, world),
        shaking=Shaking(math.radians(VIBRATION_DEG), scenario.seed),
        changing=world,
        places=places,
        goal_m=places.get(scenario.goal) or _goal_m(autonomous, scenario.goal, network, machine),
        lines_m=walls_of(network),
        expected_s=_SLOWER * way_m / (scenario.speed_kmh / 3.6) + 10.0 + _buckets_s(scenario),
        settings=settings,
        autonomous=autonomous,
    )
    if scenario.machines == 1:
        return parts
    from lhdmap.replay.crew_parts import crew_of  # it needs what is here

    crew = crew_of(parts, scenario, network, world)
    return replace(next(iter(crew.values())), crew=crew)


def _buckets_s(scenario: Scenario) -> float:
    return _BUCKET_S * sum(one.buckets for one in scenario.mission)


def _vehicle(scenario: Scenario, machine: Machine, world: MineWorld) -> Vehicle | LoadingVehicle:
    """Return the machine; one with a mission digs in the mine's piles."""
    if scenario.kind != "mission":
        return Vehicle(machine, world, seed=scenario.seed)
    piles = mine_piles(world, load_ground(scenario.loading.ground), seed=scenario.seed)
    return LoadingVehicle(machine, world, piles, seed=scenario.seed)


def _legs(
    scenario: Scenario, network: Network, machine: Machine, start: Start, operating: OperatorSettings
) -> Sequence[Leg]:
    """Return the operator's legs; of a goal that the map alone has, he knows nothing."""
    named = {one.name for one in network.plan.places} | {one.name for one in network.plan.drifts}
    if scenario.who == AUTONOMOUS and scenario.goal not in named:
        return ()
    return planned(network, machine, start, scenario.route or scenario.goal, operating, scenario.seed)


def _goal_m(autonomous: Autonomous | None, goal: str, network: Network, machine: Machine) -> Position | None:
    """Return where a goal is that the map alone has: its frame is where the teaching drive began."""
    found = None if autonomous is None else autonomous.known.topology.called(goal)
    if not isinstance(found, (Waypoint, AccessPoint)):
        return None
    begin = start_of(network, machine, None)
    x0, y0, z0, yaw = network.tubes[begin.tube].pose(begin.at_m, begin.facing).tolist()
    x, y, _ = se2.compose(np.array([x0, y0, yaw]), found.pose[[0, 1, 3]]).tolist()
    return x, y, z0 + float(found.pose[2])


def _state(vehicle: Vehicle | LoadingVehicle, pose: FloatArray, scenario: Scenario) -> VehicleState:
    x, y, z, yaw = pose.tolist()
    return vehicle.at_rest(x, y, yaw, near_z_m=z, time_ns=START_NS, load_kg=_KG * scenario.load)


def mode_of(mode: str) -> Callable[[int, FloatArray], str]:
    """Return what says a mode that does not change."""

    def told(stamp_ns: int, state: FloatArray) -> str:  # noqa: ARG001  # a `Told`
        return mode

    return told


def places_of(network: Network, machine: Machine) -> dict[str, Position]:
    """Return where a machine stands at each place, and the nodes by their names."""
    places = {place.name: _point(place_pose(network, place, machine)) for place in network.plan.places if place.name}
    nodes = {node.name: _point(node.position_m) for node in network.nodes if node.name}
    return {**nodes, **places}


def walls_of(network: Network) -> list[FloatArray]:
    """Return the walls of all drifts as the plan has them: lines (N, 3), two of each."""
    lines = []
    for tube in network.tubes:
        if tube.kind == "turn":
            continue
        s = np.append(np.arange(0.0, tube.length_m, _DRAWN_M), tube.length_m)
        poses = tube.line.at(s)
        half = np.array([tube.half_width_m(float(one)) for one in s])
        across = np.column_stack([-np.sin(poses[:, 3]), np.cos(poses[:, 3]), np.zeros(len(s))])
        lines += [poses[:, :3] + side * half[:, None] * across for side in (1.0, -1.0)]
    return lines


def _point(values: FloatArray) -> Position:
    return float(values[0]), float(values[1]), float(values[2])

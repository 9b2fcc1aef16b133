"""The parts of a replay that loads: a machine some way before a draw point, on the path that an operator has taught."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from lhdmap.config import Settings
from lhdmap.errors import UsageError
from lhdmap.geometry import se2
from lhdmap.guidance.directive import Directive, path_of
from lhdmap.machine import Machine, load_machine
from lhdmap.messages import FloatArray
from lhdmap.mine.make_network import make_network
from lhdmap.mine.network import Network
from lhdmap.mine.plan import find_plan, load_plan
from lhdmap.mine.route import start_of
from lhdmap.mine.topology import Directory
from lhdmap.mine.ways import STEP_M, Leg
from lhdmap.replay.mine_parts import BodyBumper, places_of, walls_of
from lhdmap.replay.parts import Loading, Parts
from lhdmap.replay.processes.told import ModeNow
from lhdmap.replay.scenario import Scenario
from lhdmap.settings import nearest
from lhdmap.simulation.ground.mine import mine_piles
from lhdmap.simulation.ground.sections import load_ground
from lhdmap.simulation.ground.vehicle import LoadingVehicle
from lhdmap.simulation.history import START_NS
from lhdmap.simulation.mine_drive import node_of, planned
from lhdmap.simulation.mine_world.world import MineWorld
from lhdmap.simulation.operator import OperatorSettings
from lhdmap.simulation.sensing.sections import SensorSettings
from lhdmap.simulation.sensing.suite import sensors_of
from lhdmap.simulation.vehicle.shaking import VIBRATION_DEG, Shaking

_EXPECTED_S = 120.0  # two attempts and a half


def loading_parts(scenario: Scenario, settings: Settings) -> Parts:
    """Return the parts of a machine that is to fill its bucket at a draw point.

    Raises:
        ConfigError: there is no such mine or ground.
        UsageError: `start` is no draw point of the mine.
    """
    machine = load_machine(Path(scenario.machine) if scenario.machine else None)
    network = make_network(load_plan(find_plan(scenario.mine)))
    leg = approach_leg(scenario, network, machine)
    world = MineWorld(network, machine)
    piles = mine_piles(world, load_ground(scenario.loading.ground), seed=scenario.seed)
    vehicle = LoadingVehicle(machine, world, piles, seed=scenario.seed)
    x, y, z, heading = start_pose(leg, scenario).tolist()
    bend = float(leg.articulation_rad[0])
    mode = ModeNow("idle")
    return Parts(
        machine=machine,
        world=world,
        vehicle=vehicle,
        start=vehicle.at_rest(x, y, heading, near_z_m=z, articulation_rad=bend, time_ns=START_NS),
        sensors=sensors_of(machine, SensorSettings(), seed=scenario.seed, mode=mode, node=node_of(Directory(network))),
        operator=None,
        bumper=BodyBumper(machine, world),
        shaking=Shaking(math.radians(VIBRATION_DEG), scenario.seed),
        changing=world,
        places=places_of(network, machine),
        lines_m=walls_of(network),
        expected_s=_EXPECTED_S,
        settings=settings,
        loading=Loading(taught_way(leg, settings), mode),
    )


def approach_leg(scenario: Scenario, network: Network, machine: Machine) -> Leg:
    """Return the last `approach_m` of the way to the scenario's draw point, forwards.

    Raises:
        UsageError: `start` is no draw point of the mine, or no way leads to it.
    """
    names = [place.name for place in network.plan.places if place.kind == "draw_point"]
    if scenario.start not in names:
        raise UsageError(
            f"start = '{scenario.start}': kind = 'loading' wants a draw point of mine '{network.plan.name}'"
            f"{nearest(scenario.start, names) or ': ' + ', '.join(names)}"
        )
    begin = start_of(network, machine, None)
    legs = planned(
        network, machine, begin, scenario.start, OperatorSettings(speed_kmh=scenario.speed_kmh), scenario.seed
    )
    leg = legs[-1]
    kept = min(round(scenario.loading.approach_m / STEP_M) + 1, len(leg.x_m))
    x, y, z, heading, curvature, bend = (values[-kept:] for values in _samples(leg))
    return Leg(leg.gear, x, y, z, heading, curvature, bend, leg.stop)


def start_pose(leg: Leg, scenario: Scenario) -> FloatArray:
    """Return where the machine stands at first (4,): x, y, z, heading; beside the way and turned as the scenario says."""
    plan = scenario.loading
    pose = np.array([leg.x_m[0], leg.y_m[0], leg.heading_rad[0]])
    x, y, heading = se2.compose(pose, np.array([0.0, plan.offset_m, math.radians(plan.turned_deg)])).tolist()
    return np.array([x, y, float(leg.z_m[0]), heading])


def taught_way(leg: Leg, settings: Settings) -> Directive:
    """Return the way in `odom`, where the machine is taken to stand on it: of offset and turn it knows nothing."""
    start = np.array([leg.x_m[0], leg.y_m[0], leg.heading_rad[0]])
    line = se2.transform(se2.inverse(start), np.column_stack([leg.x_m, leg.y_m]))
    path = path_of(line, settings.loading.approach_kmh / 3.6)
    return Directive(0, 1, path, float(path[-1, -1]))


def _samples(leg: Leg) -> tuple[FloatArray, ...]:
    return leg.x_m, leg.y_m, leg.z_m, leg.heading_rad, leg.curvature_pm, leg.articulation_rad

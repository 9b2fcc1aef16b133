"""The parts of a replay that loads: a machine some way before a draw point, on the path that an operator has taught."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lhdmap.config import Settings
from lhdmap.errors import UsageError
from lhdmap.geometry import se2
from lhdmap.guidance.directive import Directive, path_of
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.mine.network import Network
from lhdmap.mine.route import start_of
from lhdmap.mine.ways import STEP_M, Leg
from lhdmap.replay.scenario import Scenario
from lhdmap.settings import nearest
from lhdmap.simulation.mine_drive import planned
from lhdmap.simulation.operator import OperatorSettings

_STRAIGHT_RAD = math.radians(1.0)


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
    fields = {name: values[-kept:] for name, values in leg._asdict().items() if isinstance(values, np.ndarray)}
    return leg._replace(**fields)


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


def without_load(scenario: Scenario) -> Scenario:
    """Return a scenario whose machine is empty."""
    return replace(scenario, load=0.0)

"""The map of an autonomous drive: taught first where there is none, by an operator who drives through the whole mine."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from lhdmap.config import Settings
from lhdmap.errors import LhdmapWarning, UsageError
from lhdmap.localization.starting import poses_about, poses_anywhere, poses_in
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.mine.network import Network
from lhdmap.pipeline.build import BuildRequest, build_map
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.replay.parking import parks_of
from lhdmap.replay.parts import Autonomous
from lhdmap.replay.processes.navigator import Errand
from lhdmap.replay.processes.told import ModeNow
from lhdmap.replay.scenario import Scenario
from lhdmap.settings import nearest
from lhdmap.simulation.mine_drive import MineDriveSettings, simulate_mine
from lhdmap.simulation.operator import OperatorSettings
from lhdmap.topology.model import AccessPoint, TopologicalMap, Waypoint
from lhdmap.topology.work_places import with_work

_TEACH_KMH = 8.0
_SEED_APART = 1000  # the teaching drive is another drive


def autonomous_of(
    scenario: Scenario, network: Network, machine: Machine, folder: Path, settings: Settings
) -> Autonomous:
    """Return what a machine needs that drives to the scenario's goal; its map is made in `folder` where none is named.

    Raises:
        UsageError: start or goal are not on the map.
    """
    path = Path(scenario.map) if scenario.map else folder / "map"
    if not path.is_dir():
        teach(scenario, network, machine, path, settings)
    known = KnownMap.read(path)
    if scenario.mission:
        known = known._replace(topology=_for_mission(known.topology, scenario, network))
    start, pose = _start(known.topology, scenario.start)
    for goal in (scenario.goal, *(one.goal for one in scenario.modes)):
        if goal:
            _known(known.topology, goal, "goal")
    return Autonomous(known, pose, Errand(start, scenario.goal, scenario.load > 0.0), ModeNow("idle"))


def _for_mission(topology: TopologicalMap, scenario: Scenario, network: Network) -> TopologicalMap:
    """Return the map with the mission's places as what they are for.

    Raises:
        UsageError: a place is no point of the map, or there is nowhere to park.
    """
    sources, dumps = zip(*((one.source, one.to) for one in scenario.mission), strict=True)
    parks = parks_of(scenario, network) if scenario.machines > 1 else [scenario.start]
    topology = with_work(topology, sources, dumps, parks)
    if not any(one.purpose == "park" for one in topology.waypoints):
        raise UsageError('mission: the map has no place to park: let it begin at one (start = "P1")')
    return topology


def teach(scenario: Scenario, network: Network, machine: Machine, path: Path, settings: Settings) -> None:
    """Drive through the mine by hand, with names, and build its map at `path`; the log stays beside it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    log = path.with_name(f"{path.name}_teaching.mcap")
    drive = MineDriveSettings(
        seed=scenario.seed + _SEED_APART, names=True, truth=False, operator=OperatorSettings(speed_kmh=_TEACH_KMH)
    )
    driven = simulate_mine(network, machine, drive, log, force=True)
    if driven.contacts:
        warnings.warn(f"the teaching drive touched: {', '.join(driven.contacts)}", LhdmapWarning, stacklevel=2)
    build_map(BuildRequest([log], path, settings=settings, machine=machine))


def _start(topology: TopologicalMap, name: str) -> tuple[str, FloatArray]:
    """Return the point that a drive begins at, empty: where the machine is found; and its pose (4,: x, y, yaw, z), or several."""
    if not name:
        return "", np.zeros(4)  # where the teaching drive began
    found = topology.called(name)
    if found is None:
        return "", poses_anywhere(topology)
    if isinstance(found, (Waypoint, AccessPoint)):
        return "", np.concatenate([found.pose[None, [0, 1, 3, 2]], poses_about(topology, found)])
    return "", poses_in(topology, found.id)


def start_on(topology: TopologicalMap, name: str) -> FloatArray:
    """Return poses (4,) or (N, 4) on the map that a machine at a place begins with."""
    return _start(topology, name)[1]


def _known(topology: TopologicalMap, name: str, key: str) -> None:
    if topology.called(name) is None:
        raise UsageError(f"{key} = '{name}': not on the map{nearest(name, topology.names())}")

"""The other machines of a mission: in the same mine as the first one, each with a place to park, sensors and chance of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from lhdmap.errors import UsageError
from lhdmap.mine.network import Network
from lhdmap.mine.route import start_of
from lhdmap.mine.topology import Directory
from lhdmap.replay.mine_parts import BodyBumper
from lhdmap.replay.parking import parks_of
from lhdmap.replay.parts import Parts, Touch
from lhdmap.replay.processes.told import ModeNow
from lhdmap.replay.scenario import Errand, Scenario
from lhdmap.replay.teaching import start_on
from lhdmap.simulation.company import Among, Company, Stepped
from lhdmap.simulation.ground.vehicle import LoadingVehicle
from lhdmap.simulation.history import START_NS
from lhdmap.simulation.mine_drive import node_of
from lhdmap.simulation.mine_world.world import MineWorld
from lhdmap.simulation.sensing.sections import SensorSettings
from lhdmap.simulation.sensing.suite import sensors_of
from lhdmap.simulation.vehicle.shaking import VIBRATION_DEG, Shaking
from lhdmap.simulation.vehicle.state import VehicleState

FIRST = "lhd1"
_SEED_APART = 7919  # machines of one scenario are no copies of each other


def crew_of(first: Parts, scenario: Scenario, network: Network, world: MineWorld) -> dict[str, Parts]:
    """Return the parts of all machines by name, `first` among them; they see and touch each other.

    Raises:
        UsageError: there are fewer places to park than machines.
    """
    names = [f"lhd{k}" for k in range(1, scenario.machines + 1)]
    company = Company(dict.fromkeys(names, first.machine))
    parks = parks_of(scenario, network)
    begin = start_of(network, first.machine, None)
    origin = network.tubes[begin.tube].pose(begin.at_m, begin.facing)
    crew = {}
    for number, (name, park) in enumerate(zip(names, parks, strict=True)):
        own = first if number == 0 else _like(first, scenario, network, world, park, number)
        assert isinstance(own.start, VehicleState)  # noqa: S101  # that of a machine that digs is one
        company.at(name, own.start)
        crew[name] = replace(
            own,
            park=park,
            T_mine_map=origin,
            world=Among(world, company, name),
            vehicle=Stepped(own.vehicle, company, name),
            bumper=CrewBumper(BodyBumper(own.machine, world), company, name),
        )
    return crew


def errands_of(scenario: Scenario, names: Sequence[str]) -> Mapping[str, tuple[Errand, ...]]:
    """Return the errands of each machine; one without any has those of the first.

    Raises:
        UsageError: a machine has errands between different points, or there is no machine of that number.
    """
    own = {name: tuple(one for one in scenario.mission if one.machine == k) for k, name in enumerate(names, start=1)}
    for one in scenario.mission:
        if one.machine > len(names):
            raise UsageError(f"mission: machine = {one.machine}, there are {len(names)}")
    first = own[names[0]]
    for name, errands in own.items():
        if len(names) > 1 and len({(one.source, one.to) for one in errands or first}) != 1:
            raise UsageError(
                f"mission of {name}: one draw point and one dump were wanted, as sections are held for both"
            )
    return {name: errands or first for name, errands in own.items()}


def _like(first: Parts, scenario: Scenario, network: Network, world: MineWorld, park: str, number: int) -> Parts:
    """Return the parts of another machine of the same kind at a park."""
    seed = scenario.seed + _SEED_APART * number
    begin = start_of(network, first.machine, park)
    given, vehicle = first.autonomous, first.vehicle
    if given is None or not isinstance(vehicle, LoadingVehicle):
        raise UsageError("several machines: kind = 'mission' was wanted")
    mode = ModeNow("idle")
    other = LoadingVehicle(first.machine, world, vehicle.piles.for_another(seed), seed=seed)
    x, y, z, yaw = network.tubes[begin.tube].pose(begin.at_m, begin.facing).tolist()
    return replace(
        first,
        vehicle=other,
        start=other.at_rest(x, y, yaw, near_z_m=z, time_ns=START_NS),
        sensors=sensors_of(first.machine, SensorSettings(), seed=seed, mode=mode, node=node_of(Directory(network))),
        shaking=Shaking(math.radians(VIBRATION_DEG), seed),
        autonomous=given._replace(start=start_on(given.known.topology, park), mode=mode),
    )


class CrewBumper:
    """What the bodies of one machine touch: walls, and bodies of others; clearances are those of walls."""

    def __init__(self, walls: BodyBumper, company: Company, name: str) -> None:
        self._walls, self._company, self._name = walls, company, name

    def touching(self, state: VehicleState) -> Sequence[Touch]:
        """Return the bodies that are in a wall or in another machine."""
        met = self._company.touching(self._name)
        machines = [Touch(f"{one.body} with {one.other}", tuple(one.point_m.tolist()), one.depth_m) for one in met]
        return [*self._walls.touching(state), *machines]

    def clearance_m(self, state: VehicleState) -> float:
        """Return the least distance of any body from a wall, at most 1 m."""
        return self._walls.clearance_m(state)

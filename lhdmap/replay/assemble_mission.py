"""A mission as processes: the executive, and what a drive and a loading are made of."""

from __future__ import annotations

from lhdmap.config import Settings
from lhdmap.driving.bodies import Bodies, bodies_of
from lhdmap.driving.model import DriveModel, drive_model
from lhdmap.executor.control import Control
from lhdmap.haulage.layout import checked
from lhdmap.haulage.mission import MissionTask
from lhdmap.haulage.mission_io import Buckets
from lhdmap.haulage.of_map import layout_of_map
from lhdmap.movement.routes import RoutePlanner
from lhdmap.navigation.control import NavigationControl
from lhdmap.replay.assemble_loading import guidance_of, task_of
from lhdmap.replay.assemble_station import station_of
from lhdmap.replay.crew_mission import Job
from lhdmap.replay.journal import Scribe
from lhdmap.replay.namespace import Scribes
from lhdmap.replay.parts import Autonomous, Parts
from lhdmap.replay.process import Process
from lhdmap.replay.processes.dumps import DUMPS, Dumps
from lhdmap.replay.processes.execute import EXECUTOR, PERIODS_S, Execute
from lhdmap.replay.processes.executive import EXECUTIVE, Executive, SharedMap
from lhdmap.replay.processes.guide import GUIDANCE, Guide
from lhdmap.replay.processes.load import LOADS, Loads
from lhdmap.replay.processes.locating import Locating
from lhdmap.replay.processes.navigator import NAVIGATION
from lhdmap.replay.processes.ordered import OrderedNavigation
from lhdmap.replay.processes.perception import PERCEPTION
from lhdmap.replay.processes.scouting import PileAhead
from lhdmap.replay.scenario import Scenario
from lhdmap.topology.model import TopologicalMap


def mission_processes(
    scenario: Scenario, parts: Parts, given: Autonomous, journal: Scribes, job: Job | None = None
) -> list[Process]:
    """Return what runs a mission: perception on the map and of piles, executive, navigation, loading, dumping, and what drives.

    `job`: of a machine among others.
    """
    machine, settings = parts.machine, parts.settings
    full_kg = machine.drive.payload_kg
    models = drive_model(machine, 0.0), drive_model(machine, full_kg)
    bodies, topology = bodies_of(machine), given.known.topology
    control = Control(models[0], bodies, settings.executor, PERIODS_S)
    guidance = guidance_of(machine, models[0], bodies, settings)
    return [
        Locating(given.known, settings, machine, given.start, journal.of(PERCEPTION), pile=PileAhead(settings)),
        executive_of(scenario, topology, 1e-3 * full_kg, journal.of(EXECUTIVE), job),
        navigation_of(topology, settings, (models[0], bodies), journal.of(NAVIGATION), job),
        Loads(task_of(scenario.loading, settings, machine), None, journal.of(LOADS)),
        Dumps(journal.of(DUMPS), machine.linkage),
        Guide(guidance, settings.executor.jumps, journal.of(GUIDANCE), models=models),
        Execute(control, machine, given.mode, journal.of(EXECUTOR), models=models),
        station_of(scenario, parts, journal, scenario.assists),
    ]


def navigation_of(
    topology: TopologicalMap,
    settings: Settings,
    body: tuple[DriveModel, Bodies],
    scribe: Scribe,
    job: Job | None = None,
) -> OrderedNavigation:
    """Return what drives to the goals of a mission; of a machine among others, on routes that keep out of others' places."""
    planner = RoutePlanner(topology, settings.movement)
    control = NavigationControl(planner, *body, settings.navigation, scribe.goes)
    control.allowed.avoid = () if job is None else job.avoid
    return OrderedNavigation(control, scribe)


def executive_of(
    scenario: Scenario, topology: TopologicalMap, full_t: float, scribe: Scribe, job: Job | None = None
) -> Executive:
    """Return who gives the orders of a mission; `full_t`: a full bucket, `job`: of a machine among others."""
    if job is not None:
        task = job.task
        return Executive(task, job.orders, topology, full_t, scribe, shares=SharedMap(lambda: task.free, job.presence))
    layout = checked(layout_of_map(topology, scenario.mine))
    alone = MissionTask(layout, park=scenario.start if scenario.start in layout.of("park") else "")
    orders = [Buckets(one.source, one.to, one.buckets) for one in scenario.mission]
    return Executive(alone, orders, topology, full_t, scribe)

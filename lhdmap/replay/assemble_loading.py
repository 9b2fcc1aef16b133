"""A scenario that loads, as processes."""

from __future__ import annotations

from lhdmap.config import Settings
from lhdmap.driving.bodies import Bodies, bodies_of
from lhdmap.driving.model import DriveModel, drive_model
from lhdmap.executor.control import Control
from lhdmap.guidance.planner import Guidance, method_of
from lhdmap.loading.attempts import Attempts
from lhdmap.loading.charge import Charge
from lhdmap.loading.digging_parts import Controllers
from lhdmap.loading.excavation import DigSettings, excavation_of
from lhdmap.loading.shake import Shake
from lhdmap.loading.task import LoadingTask
from lhdmap.loading.weighing import Weighing
from lhdmap.machine import Machine
from lhdmap.replay.assemble_station import station_of
from lhdmap.replay.journal import Journal
from lhdmap.replay.parts import Loading, Parts
from lhdmap.replay.process import Process
from lhdmap.replay.processes.execute import EXECUTOR, PERIODS_S, Execute
from lhdmap.replay.processes.guide import GUIDANCE, Guide
from lhdmap.replay.processes.load import LOADS, Loads
from lhdmap.replay.processes.perception import PERCEPTION
from lhdmap.replay.processes.scouting import Scouting
from lhdmap.replay.scenario import LoadingPlan, Scenario


def loading_processes(scenario: Scenario, parts: Parts, given: Loading, journal: Journal) -> list[Process]:
    """Return what loads: perception of the pile, the loading task, guidance, executor, and the station that arms it."""
    machine, settings = parts.machine, parts.settings
    model, bodies = drive_model(machine, 0.0), bodies_of(machine)
    control = Control(model, bodies, settings.executor, PERIODS_S)
    return [
        Scouting(settings, machine, journal.of(PERCEPTION)),
        Loads(task_of(scenario.loading, settings, machine), given.way, journal.of(LOADS)),
        Guide(guidance_of(machine, model, bodies, settings), settings.executor.jumps, journal.of(GUIDANCE)),
        Execute(control, machine, given.mode, journal.of(EXECUTOR)),
        station_of(scenario, parts, journal),
    ]


def guidance_of(machine: Machine, model: DriveModel, bodies: Bodies, settings: Settings) -> Guidance:
    """Return guidance with its settings."""
    eyes_m = {1: machine.mounts["lidar_front"].position_m[0], -1: -machine.mounts["lidar_rear"].position_m[0]}
    return Guidance(model, bodies, eyes_m, settings.guidance, method_of(settings.guidance))


def task_of(plan: LoadingPlan, settings: Settings, machine: Machine) -> LoadingTask:
    """Return the loading task with the scenario's controllers."""
    dig = excavation_of(
        DigSettings(settings.excavation, settings.excavation_paper, settings.excavation_tuned), plan.method
    )
    charge = Charge(settings.charging, plan.detector)
    controllers = Controllers(charge, dig, Shake(settings.weighing, settings.excavation), Weighing(settings.weighing))
    rule = Attempts(settings.attempts, 1e-3 * machine.drive.payload_kg)
    return LoadingTask(drive_model(machine, 0.0), bodies_of(machine), controllers, rule, settings.loading)

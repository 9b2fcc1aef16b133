"""A mission on a surface site, as processes: executive, driver, timed loading and dumping."""

from __future__ import annotations

from lhdmap.haulage.mission import MissionTask
from lhdmap.haulage.mission_io import Buckets
from lhdmap.replay.journal import Journal
from lhdmap.replay.lane_tally import LaneTally
from lhdmap.replay.parts import Haulage, Parts
from lhdmap.replay.process import Process
from lhdmap.replay.processes.executive import EXECUTIVE
from lhdmap.replay.processes.site_driver import SITE_DRIVER, SiteDriver
from lhdmap.replay.processes.site_executive import SiteExecutive
from lhdmap.replay.processes.site_work import SITE_WORK, SiteWork
from lhdmap.replay.processes.station import Station
from lhdmap.replay.scenario import ModeAt, Scenario
from lhdmap.replay.site_drive import SiteDrive
from lhdmap.replay.site_sight import SiteSight
from lhdmap.tracking.tracker import Tracker


def haulage_processes(scenario: Scenario, parts: Parts, given: Haulage, journal: Journal) -> list[Process]:
    """Return what runs a mission on a site."""
    layout, plan, machine = given.ground.layout, scenario.haulage, parts.machine
    full_t = 1e-3 * machine.drive.payload_kg
    orders = [Buckets(layout.of("load")[0], layout.of("dump")[0], scenario.cycles)]
    mission = MissionTask(layout, machine.name, given.park, parts.settings.haulage.tries)
    tracker = Tracker(given.ground.models[0], parts.settings.tracking)
    drive = SiteDrive(given.ground, tracker, given.park)
    top_mps = machine.dimensions.max_speed_kmh / 3.6
    return [
        SiteExecutive(mission, orders, full_t, journal.of(EXECUTIVE)),
        SiteDriver(drive, tracker, SiteSight(given.ground.bodies), top_mps, journal.of(SITE_DRIVER)),
        SiteWork(plan.load_s, plan.dump_s, full_t, journal.of(SITE_WORK)),
        Station(
            (ModeAt(),), scenario.rearm_s, scenario.assist_s, journal.of(Station.name), scenario.assists, backs_up=False
        ),
    ]


def lane_of(parts: Parts) -> LaneTally | None:
    """Return what counts the lane; None: there is no site."""
    given = parts.haulage
    return None if given is None else LaneTally(given.ground, given.half_lane_m)

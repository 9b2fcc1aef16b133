"""The one place where a scenario becomes parts, and parts become processes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from lhdmap.config import Settings
from lhdmap.console.link import MachineLink
from lhdmap.driving.bodies import bodies_of
from lhdmap.driving.model import drive_model
from lhdmap.errors import ConfigError, UsageError
from lhdmap.executor.control import Control
from lhdmap.movement.routes import RoutePlanner
from lhdmap.navigation.control import NavigationControl
from lhdmap.replay.assemble_haulage import haulage_processes, lane_of
from lhdmap.replay.assemble_loading import guidance_of, loading_processes
from lhdmap.replay.assemble_mission import mission_processes
from lhdmap.replay.assemble_station import station_of
from lhdmap.replay.crew_mission import Job, crew_mission, section_watch
from lhdmap.replay.crew_parts import FIRST
from lhdmap.replay.engine import Engine, overrun_targets
from lhdmap.replay.faults import Faults
from lhdmap.replay.journal import Journal
from lhdmap.replay.judges import Judges
from lhdmap.replay.link import ConsoleRadio, Link
from lhdmap.replay.load_tally import LoadTally
from lhdmap.replay.namespace import InNamespace, JournalOf, Scribes
from lhdmap.replay.parts import Autonomous, Parts
from lhdmap.replay.process import MACHINE, STATION, Process
from lhdmap.replay.processes.driver import Driver
from lhdmap.replay.processes.execute import EXECUTOR, PERIODS_S, Execute
from lhdmap.replay.processes.film import Film
from lhdmap.replay.processes.guide import GUIDANCE, Guide
from lhdmap.replay.processes.locating import Locating
from lhdmap.replay.processes.monitor import Monitor
from lhdmap.replay.processes.navigator import NAVIGATION, Navigator
from lhdmap.replay.processes.perception import PERCEPTION, Perception
from lhdmap.replay.processes.plant import Plant
from lhdmap.replay.processes.recorder import Recorder
from lhdmap.replay.processes.section_watch import SECTION_WATCH
from lhdmap.replay.scenario import HAULAGE, TELEOPERATOR, Scenario
from lhdmap.replay.verdict import Tally
from lhdmap.settings import nearest


def parts_of(scenario: Scenario, folder: Path, settings: Settings | None = None) -> Parts:
    """Return world, machine, sensors and operator of a scenario; a map that is to be made goes into `folder`.

    Raises:
        UsageError: there is no such place or route, or this version does not replay the kind.
        ConfigError: there is no such mine.
    """
    if scenario.kind not in _REPLAYED:
        raise UsageError(f"kind = '{scenario.kind}': this version replays {', '.join(map(repr, _REPLAYED))}")
    if bool(scenario.mission) != (scenario.kind == "mission"):
        raise UsageError(f"kind = '{scenario.kind}': kind = 'mission' wants a mission, and no other does")
    if scenario.kind == HAULAGE:
        from lhdmap.replay.haulage_parts import haulage_parts

        return haulage_parts(scenario, settings or Settings())
    from lhdmap.replay.loading_parts import loading_parts  # what a mine needs takes a second to load
    from lhdmap.replay.mine_parts import mine_parts

    if scenario.kind == "loading":
        return loading_parts(scenario, settings or Settings())
    return mine_parts(scenario, folder, settings or Settings())


_REPLAYED = ("tram", "loading", "mission", HAULAGE)


class Watchers(NamedTuple):
    """Who watches a run: the film for the page, the recorder of the log, and others that a caller adds.

    `others`: films of the other machines of a crew.
    """

    film: Film
    recorder: Recorder | None = None
    more: Sequence[Process] = ()
    others: Mapping[str, Film] = MappingProxyType({})


class Run(NamedTuple):
    """A run that is ready to go."""

    engine: Engine
    monitor: Monitor
    faults: Faults
    link: Link
    judges: Judges


def assemble(
    scenario: Scenario, parts: Parts, journal: Journal, watchers: Watchers, *, withhold_truth: bool = False
) -> Run:
    """Return the engine with all processes of a scenario.

    Raises:
        ConfigError: a fault has a target or a place that is not there.
    """
    faults = Faults(scenario.faults, journal, parts.places)
    link = Link(scenario.link, faults, scenario.seed)
    if isinstance(parts.attendant, MachineLink):
        parts.attendant.crosses(ConsoleRadio(scenario.link, faults, scenario.seed, link))
    monitor = _monitor(scenario, parts, journal)
    monitors, sections = {FIRST: monitor}, None
    processes: list[Process] = [Plant(parts, faults, link, journal.of(Plant.name), scenario.seed)]
    if parts.haulage is not None:
        processes += haulage_processes(scenario, parts, parts.haulage, journal)
    elif parts.loading is not None:
        processes += loading_processes(scenario, parts, parts.loading, journal)
    elif parts.autonomous is not None and scenario.mission:
        given = crew_mission(scenario, parts.crew) if parts.crew else None
        job = None if given is None else given.jobs[FIRST]
        processes += mission_processes(scenario, parts, parts.autonomous, journal, job)
        if given is not None:
            sections = section_watch(given, parts.crew, journal.of(SECTION_WATCH))
            others = {name: own for name, own in parts.crew.items() if name != FIRST}
            monitors |= {name: _monitor(scenario, own, JournalOf(journal, name)) for name, own in others.items()}
            for name, own in others.items():
                made = _other(scenario, own, given.jobs[name], JournalOf(journal, name))
                made += [monitors[name], *([watchers.others[name]] if name in watchers.others else [])]
                processes += [InNamespace(one, name) for one in made]
            processes.append(sections)
    elif parts.autonomous is not None:
        processes += _autonomous(scenario, parts, parts.autonomous, journal)
    elif scenario.perception:
        processes.append(Perception(parts.settings, parts.machine, journal.of(Perception.name)))
    site = STATION if scenario.who == TELEOPERATOR else MACHINE
    if parts.operator is not None:
        processes.append(Driver(parts.operator, journal.of(Driver.name), site=site))
    processes += [*watchers.more, watchers.film, monitor]
    processes += [] if watchers.recorder is None else [watchers.recorder]
    _check(scenario, parts, processes)
    engine = Engine(processes, journal, faults=faults, link=link, withhold_truth=withhold_truth)
    return Run(engine, monitor, faults, link, Judges(monitors, sections))


def _monitor(scenario: Scenario, parts: Parts, journal: Scribes) -> Monitor:
    load = LoadTally(parts.machine.drive.payload_kg) if parts.loading is not None or scenario.mission else None
    tally = Tally(scenario.kind, scenario.limits, parts.goal_m)
    return Monitor(tally, journal.of(Monitor.name), load, lane_of(parts))


def _other(scenario: Scenario, parts: Parts, job: Job, journal: JournalOf) -> list[Process]:
    """Return the processes of another machine of a crew; faults of the scenario are those of the first one."""
    assert parts.autonomous is not None  # noqa: S101  # a mission drives itself
    plant = Plant(parts, Faults((), Journal()), None, journal.of(Plant.name), scenario.seed)
    return [plant, *mission_processes(scenario, parts, parts.autonomous, journal, job)]


def _autonomous(scenario: Scenario, parts: Parts, given: Autonomous, journal: Journal) -> list[Process]:
    """Return what drives the machine: perception on the map, navigation, guidance, executor, and the station that arms it."""
    machine, settings = parts.machine, parts.settings
    model, bodies = drive_model(machine, 1000.0 * scenario.load), bodies_of(machine)
    navigation = NavigationControl(
        RoutePlanner(given.known.topology, settings.movement, loaded=given.errand.loaded),
        model,
        bodies,
        settings.navigation,
        journal.of(NAVIGATION).goes,
    )
    guidance = guidance_of(machine, model, bodies, settings)
    control = Control(model, bodies, settings.executor, PERIODS_S)
    return [
        Locating(given.known, settings, machine, given.start, journal.of(PERCEPTION)),
        Navigator(navigation, given.errand, journal.of(NAVIGATION)),
        Guide(guidance, settings.executor.jumps, journal.of(GUIDANCE)),
        Execute(control, machine, given.mode, journal.of(EXECUTOR)),
        station_of(scenario, parts, journal, scenario.assists),
    ]


def _check(scenario: Scenario, parts: Parts, processes: Sequence[Process]) -> None:
    """Refuse faults whose target or place is not there."""
    known = overrun_targets(processes)
    for number, fault in enumerate(scenario.faults, start=1):
        if fault.kind == "overrun" and fault.target not in known:
            raise ConfigError(
                f"[[fault]] {number}: target = '{fault.target}': no such process{nearest(fault.target, known)}"
            )
        if fault.at and fault.at not in parts.places:
            raise ConfigError(f"[[fault]] {number}: at = '{fault.at}': no such place{nearest(fault.at, parts.places)}")

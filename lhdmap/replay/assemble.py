"""The one place where a scenario becomes parts, and parts become processes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from lhdmap.errors import ConfigError, UsageError
from lhdmap.replay.engine import Engine, overrun_targets
from lhdmap.replay.faults import Faults
from lhdmap.replay.journal import Journal
from lhdmap.replay.link import Link
from lhdmap.replay.parts import Parts
from lhdmap.replay.process import MACHINE, STATION, Process
from lhdmap.replay.processes.driver import Driver
from lhdmap.replay.processes.film import Film
from lhdmap.replay.processes.monitor import Monitor
from lhdmap.replay.processes.perception import Perception
from lhdmap.replay.processes.plant import Plant
from lhdmap.replay.processes.recorder import Recorder
from lhdmap.replay.scenario import TELEOPERATOR, Scenario
from lhdmap.replay.verdict import Tally
from lhdmap.settings import nearest


def parts_of(scenario: Scenario) -> Parts:
    """Return world, machine, sensors and operator of a scenario.

    Raises:
        UsageError: there is no such place or route, or this version does not replay the kind.
        ConfigError: there is no such mine.
    """
    if scenario.kind != "tram" or scenario.mission:
        what = f"kind = '{scenario.kind}'" + (" with a mission" if scenario.mission else "")
        raise UsageError(
            f"{what}: this version replays kind = 'tram', to a goal or along a route that an operator drives"
        )
    from lhdmap.replay.mine_parts import mine_parts  # what a mine needs takes a second to load

    return mine_parts(scenario)


class Watchers(NamedTuple):
    """Who watches a run: the film for the page, the recorder of the log, and others that a caller adds."""

    film: Film
    recorder: Recorder | None = None
    more: Sequence[Process] = ()


class Run(NamedTuple):
    """A run that is ready to go."""

    engine: Engine
    monitor: Monitor
    faults: Faults
    link: Link


def assemble(
    scenario: Scenario, parts: Parts, journal: Journal, watchers: Watchers, *, withhold_truth: bool = False
) -> Run:
    """Return the engine with all processes of a scenario.

    Raises:
        ConfigError: a fault has a target or a place that is not there.
    """
    faults = Faults(scenario.faults, journal, parts.places)
    link = Link(scenario.link, faults, scenario.seed)
    monitor = Monitor(Tally(scenario.kind, scenario.limits, parts.goal_m), journal.of(Monitor.name))
    processes: list[Process] = [Plant(parts, faults, link, journal.of(Plant.name), scenario.seed)]
    if scenario.perception:
        processes.append(Perception(parts.settings, parts.machine, journal.of(Perception.name)))
    site = STATION if scenario.driver == TELEOPERATOR else MACHINE
    if parts.operator is not None:
        processes.append(Driver(parts.operator, journal.of(Driver.name), site=site))
    processes += [*watchers.more, watchers.film, monitor]
    processes += [] if watchers.recorder is None else [watchers.recorder]
    _check(scenario, parts, processes)
    engine = Engine(processes, journal, faults=faults, link=link, withhold_truth=withhold_truth)
    return Run(engine, monitor, faults, link)


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

"""Missions and traffic for the probes: what they do with their settings."""

from __future__ import annotations

from collections.abc import Iterator

from lhdmap.haulage.fleet import Fleet
from lhdmap.haulage.machine import Errand, HaulageMachine, Status
from lhdmap.haulage.mission_io import Buckets, MissionInput, Navigation
from lhdmap.haulage.settings import HaulageSettings
from lhdmap.haulage.states import Event, State
from lhdmap.traffic.advice import Throughput, throughput, traffic_findings
from lhdmap.traffic.settings import TrafficSettings

from tests.haulage.plans import map_of_plan
from tests.haulage.sites import hejase

_FAILS = {State.DOCK: Event.DOCK_MISSED, State.LOAD: Event.LOAD_FAILED, State.DUMP: Event.DUMP_STUCK}


def tried(settings: HaulageSettings) -> list[int]:
    """Return how often docking, loading and dumping fail before somebody is asked to help."""
    machine = HaulageMachine(hejase(), tries=settings.tries)
    counts = []
    for state, event in _FAILS.items():
        at, count = _in(machine, state), 0
        while at.state != State.ASSIST:
            at = machine.step(machine.step(at, Event.POINT_FREE), event)
            count += 1
        counts.append(count)
    return counts


def _in(machine: HaulageMachine, state: State) -> Status:
    """Return the status of a mission when it first is in a state."""
    at = machine.step(machine.idle(), Event.DISPATCH)
    while at.state != state:
        event = {State.QUEUE: Event.POINT_FREE, State.LOAD: Event.LOADED}.get(at.state, Event.REACH)
        at = machine.step(at, event)
    return at


def asked(settings: HaulageSettings) -> Iterator[tuple[str, str]]:
    """Yield what a machine that drives from the park to its queue point wants and holds, half a metre after half a metre."""
    layout = hejase()
    fleet = Fleet(layout, {"lhd": Errand("L1", "D1", "P1")}, settings)
    orders = (Buckets("L1", "D1"),)
    edge = next(one for one in layout.edges if (one.start, one.end) == ("P1", "A1 queue"))
    assert edge.line_m is not None
    for k, (x, y) in enumerate(edge.line_m[:, :2].tolist()):
        told = MissionInput(1 + k, (x, y, 0.0), odometer_m=float(k), navigation=Navigation("driving"), orders=orders)
        yield fleet.update({"lhd": told})["lhd"].motion, fleet.control.place("lhd").section


def fleet(settings: TrafficSettings) -> Iterator[tuple[Throughput | None, list[str]]]:
    """Yield what three machines achieve on a level and on a decline, and what check-map says of them."""
    for topology, dump in ((map_of_plan("level"), "OP2"), (map_of_plan("decline"), "OP1")):
        yield throughput(topology, dump, 3, settings), [one.text for one in traffic_findings(topology, 3, settings)]

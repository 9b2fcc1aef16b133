"""The missions of several machines on one map: sections, the fleet that holds them, and who looks at them by the truth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from lhdmap.driving.bodies import bodies_of
from lhdmap.driving.model import drive_model
from lhdmap.errors import UsageError
from lhdmap.haulage.fleet import Fleet, Member
from lhdmap.haulage.joining import check_pull_back, ways_of, with_sections
from lhdmap.haulage.layout import Layout, checked, nodes_of_section
from lhdmap.haulage.machine import Errand
from lhdmap.haulage.mission_io import Buckets
from lhdmap.haulage.of_map import layout_of_map
from lhdmap.movement.routes import RoutePlanner
from lhdmap.navigation.begin import Errand as Way
from lhdmap.navigation.begin import Reach, route_from
from lhdmap.navigation.hold import ROOM_M
from lhdmap.navigation.leg import Leg, legs_of
from lhdmap.navigation.presence import Presence
from lhdmap.replay.crew_parts import errands_of
from lhdmap.replay.journal import Scribe
from lhdmap.replay.parts import Parts
from lhdmap.replay.processes.section_watch import SectionWatch
from lhdmap.replay.scenario import Scenario
from lhdmap.topology.model import TopologicalMap, Waypoint

_OUT_M = 1.0  # a section is given back so far after the machine has left it


class Job(NamedTuple):
    """What a machine of a fleet is to do, the fleet's word on it, what it is in, the nodes (ids) in which others work or park."""

    task: Member
    orders: Sequence[Buckets]
    presence: Presence
    avoid: tuple[str, ...]


class CrewMission(NamedTuple):
    """The jobs by machine, and the layout whose sections are held."""

    jobs: Mapping[str, Job]
    layout: Layout


def crew_mission(scenario: Scenario, crew: Mapping[str, Parts]) -> CrewMission:
    """Return the missions of a crew.

    Raises:
        UsageError: a place of a mission is not on the map, or sections cannot be held on it.
    """
    parts = next(iter(crew.values()))
    assert parts.autonomous is not None  # noqa: S101  # a mission drives itself
    topology, machine, navigation = parts.autonomous.known.topology, parts.machine, parts.settings.navigation
    model, bodies = drive_model(machine, 0.0), bodies_of(machine)
    nose_m, tail_m = float(bodies.front_m[:, 0].max()), model.wheelbase_m - float(bodies.rear_m[:, 0].min())
    planner = RoutePlanner(topology, parts.settings.movement)

    faces = {own.park: _heading_of(own) for own in crew.values()}

    def legs(start: str, goal: str) -> list[Leg]:
        begin, end = _waypoint(topology, start), _waypoint(topology, goal)
        way = Way(
            goal,
            faces.get(start, float(begin.pose[3])),
            tuple(node for node in avoid if node not in (begin.node, end.node)),
        )
        route = route_from(planner, begin.id, way, Reach(nose_m, tail_m, navigation.room_m))
        if not route.feasible:
            raise UsageError(f"mission: {route.reason}")
        return legs_of(topology, route, model.wheelbase_m, nose_m, navigation)

    parks = dict(zip(crew, (one.park for one in crew.values()), strict=True))
    wanted = errands_of(scenario, list(crew))
    errands = {name: Errand(ones[0].source, ones[0].to, parks[name]) for name, ones in wanted.items()}
    avoid = tuple(sorted({_waypoint(topology, point).node for errand in errands.values() for point in errand}))
    drives = {way: legs(*way) for errand in errands.values() for way in ways_of(errand)}
    least_m = tail_m + _OUT_M + tail_m + ROOM_M  # in reverse the rear is ahead of `base_link` by so much
    layout = with_sections(checked(layout_of_map(topology, scenario.mine)), topology, errands, drives, least_m)
    check_pull_back(layout, errands, parts.settings.loading.pull_back_m + tail_m)
    fleet = Fleet(layout, errands, parts.settings.haulage, tail_m + _OUT_M)
    orders = {name: [Buckets(one.source, one.to, one.buckets) for one in ones] for name, ones in wanted.items()}
    presence = Presence(topology, bodies, machine, _OUT_M)
    return CrewMission({name: Job(fleet.member(name), orders[name], presence, avoid) for name in crew}, layout)


def section_watch(given: CrewMission, crew: Mapping[str, Parts], scribe: Scribe) -> SectionWatch:
    """Return who looks at the sections of a crew's mission."""
    parts = next(iter(crew.values()))
    assert parts.autonomous is not None  # noqa: S101  # a mission drives itself
    held = {edge.held for edge in given.layout.edges}
    named = {node: one for one in held for node in nodes_of_section(one)}
    named |= {edge.node: edge.held for edge in given.layout.edges}
    section_of = {one: named.get(name, name) for one, name in given.layout.ids.items()}
    spaces = {name: "" if number == 0 else name for number, name in enumerate(crew)}
    origin = np.zeros(4) if parts.T_mine_map is None else parts.T_mine_map
    topology, bodies = parts.autonomous.known.topology, (bodies_of(parts.machine), parts.machine)
    return SectionWatch(spaces, topology, section_of, origin, bodies, scribe)


def _heading_of(parts: Parts) -> float:
    """Return how a machine stands at first, in the map: not always as it stood there in the teaching drive."""
    origin = np.zeros(4) if parts.T_mine_map is None else parts.T_mine_map
    return math.remainder(parts.start.yaw_rad - float(origin[3]), 2.0 * math.pi)


def _waypoint(topology: TopologicalMap, name: str) -> Waypoint:
    found = topology.called(name)
    if not isinstance(found, Waypoint):
        raise UsageError(f"'{name}': no point of the map; each machine needs a place to park that was taught")
    return found

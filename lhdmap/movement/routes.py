"""Routes over a topological map: `RoutePlanner(topology, settings).route("DP1", "OP1")`.

The cheapest sequence of movement states is searched (Section 3.2 of the topological paper), then timed exactly, then set beside
the next best ways through other nodes. Where there is none, the least that would have to change is told.
"""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.movement.alternatives import alternatives_of
from lhdmap.movement.blocks import blocks_on, toll_of, tolls_of_all
from lhdmap.movement.costs import Pace, pace_of
from lhdmap.movement.movement_map import MovementMap, movement_map
from lhdmap.movement.places import Place, avoided_ways, place
from lhdmap.movement.route import Block, Route
from lhdmap.movement.rules import STANDING_ALONG, STATE_COUNT
from lhdmap.movement.search import Indices, Landmarks, Searcher, landmarks_of
from lhdmap.movement.settings import MovementSettings
from lhdmap.movement.steps import Sequence, steps_of
from lhdmap.movement.ways import Bools, ways_of
from lhdmap.topology.model import TopologicalMap


@dataclass(frozen=True, slots=True)
class RouteOptions:
    """What a route is asked for with.

    `heading`, `goal_heading`: of the machine at start and goal: `along` or `against` that of the point, or degrees in the map;
    None: any. `avoid`: names of points or nodes, or `A:B`; `alternatives`: how many ways that lost are told.
    """

    heading: str | None = None
    goal_heading: str | None = None
    avoid: tuple[str, ...] = ()
    alternatives: int = 2


class RoutePlanner:
    """Plans routes over one map, for a machine that is loaded or empty; the movement map is built once."""

    def __init__(
        self, topology: TopologicalMap, settings: MovementSettings | None = None, *, loaded: bool = False
    ) -> None:
        self.topology = topology
        self.pace: Pace = pace_of(settings or MovementSettings(), loaded=loaded)
        self.ways = ways_of(topology)
        self.movement: MovementMap = movement_map(self.ways, self.pace)
        self._landmarks: Landmarks | None = None

    def prepare(self) -> None:
        """Measure landmarks, which make each route over a very large map several times quicker; takes seconds there."""
        self._landmarks = landmarks_of(self.movement)

    def route(self, start: str, goal: str, options: RouteOptions | None = None) -> Route:
        """Return the quickest route between two places, each the name or id of a point or a node.

        Raises:
            UsageError: a name or a heading is wrong.
        """
        asked = options or RouteOptions()
        begin = place(self.topology, start, asked.heading)
        end = place(self.topology, goal, asked.goal_heading, "--goal-heading")
        avoided = avoided_ways(self.topology, self.ways, asked.avoid)
        found = self.sequence(begin.standing(), end, toll_of(avoided))
        if found is None:
            return self._none(begin, end, avoided)
        route = self.told(found)
        if asked.alternatives:
            route = alternatives_of(self, route, found, begin, end, avoided, asked.alternatives)
        return replace(route, other_heading=self._other_heading(begin, end, avoided, route, asked))

    def sequence(
        self, sources: Indices, goal: Place, toll: FloatArray | None, *, everywhere: bool = False
    ) -> Sequence | None:
        """Return the cheapest sequence of states from standing at `sources` (S,) to a stop at the goal; None: there is none.

        `toll` (W,): what a way costs in addition; `everywhere`: blocked ways may be used.
        """
        searcher = self._searcher_of_all if everywhere else self._searcher
        goals = goal.arrivals()
        landmarks = None if everywhere else self._landmarks
        path = searcher.path(sources, goals, self._stop_costs(goals), toll, landmarks)
        if path is None:
            return None
        edges = (self._map_of_all if everywhere else self.movement).edges
        return Sequence(path.states, edges.way[path.edges]).stopped()

    def told(self, sequence: Sequence) -> Route:
        """Return a sequence as a route."""
        steps = steps_of(self.topology, self.ways, self.pace, sequence)
        return Route(
            True,
            "",
            steps[-1].at_m,
            steps[-1].at_s,
            sum(step.inversion for step in steps),
            sum(step.turn for step in steps),
            steps,
            _heading(int(sequence.states[0])),
            _heading(int(sequence.states[-1])),
        )

    def _stop_costs(self, goals: Indices) -> FloatArray:
        """Return what it costs to stop at goals (G,): nothing more where the state is a stop."""
        moving = goals % STATE_COUNT < STANDING_ALONG
        speed = self.pace.speed_mps(self._peak_mps[goals // STATE_COUNT], 1)
        lost = speed / (2.0 * self.pace.deceleration_mps2) + self.pace.inversion_s
        costs: FloatArray = np.where(moving, lost + 1e-6, 0.0)  # rather a stop of the rules
        return costs

    def _none(self, begin: Place, end: Place, avoided: Bools) -> Route:
        """Return why there is no route: the ways on the easiest path that are blocked, or that nothing leads there."""
        found = self.sequence(begin.standing(), end, tolls_of_all(self.ways, avoided), everywhere=True)
        if found is not None:
            blocks = tuple(blocks_on(self.topology, self.ways, found, avoided))
            return Route(False, f"{begin.name} to {end.name}: {_blocked_text(blocks)}", blocked_by=blocks)
        either = self.sequence(_any(begin).standing(), _any(end), toll_of(avoided))
        if either is None:
            return Route(False, f"{begin.name} to {end.name}: no connection of the map leads there")
        ends = f"{_heading(int(either.states[0]))} the start's, {_heading(int(either.states[-1]))} the goal's"
        return Route(
            False,
            f"{begin.name} to {end.name}: not with these headings, the machine cannot be turned on the way; it goes with "
            f"the heading {ends}",
        )

    def _other_heading(self, begin: Place, end: Place, avoided: Bools, route: Route, asked: RouteOptions) -> str:
        """Return in words what the route would be with the other heading at the start, where none was given."""
        first = route.states[0]
        if asked.heading is not None or len(begin.headings) > 1 or len(route.states) < 2:
            return ""
        other = -1 if first.state == "v" else 1
        found = self.sequence(begin.standing(other), end, toll_of(avoided))
        word = "along" if other > 0 else "against"
        if found is None:
            return f"{word}: no route"
        instead = self.told(found)
        return f"{word}: {instead.time_s - route.time_s:+.1f} s, {instead.inversions} inversions"

    @cached_property
    def _searcher(self) -> Searcher:
        return Searcher(self.movement.edges, len(self.ways.start))

    @cached_property
    def _map_of_all(self) -> MovementMap:
        return movement_map(self.ways, self.pace, blocked_too=True)

    @cached_property
    def _searcher_of_all(self) -> Searcher:
        return Searcher(self._map_of_all.edges, len(self.ways.start))

    @cached_property
    def _peak_mps(self) -> FloatArray:
        return self.ways.peak_mps


def route(
    topology: TopologicalMap,
    start: str,
    goal: str,
    options: RouteOptions | None = None,
    settings: MovementSettings | None = None,
    *,
    loaded: bool = False,
) -> Route:
    """Return the quickest route between two places of a map; see `RoutePlanner.route`, which is for several routes."""
    return RoutePlanner(topology, settings, loaded=loaded).route(start, goal, options)


def _any(one: Place) -> Place:
    return Place(one.name, dict.fromkeys(one.headings, (1, -1)))


def _heading(state: int) -> str:
    return "along" if state % STATE_COUNT == STANDING_ALONG else "against"


def _blocked_text(blocks: Items[Block]) -> str:
    told = [f"{one.start}:{one.end} is {one.why}{f' ({one.text})' if one.text else ''}" for one in blocks]
    return f"the way there is blocked: {'; '.join(told)}"

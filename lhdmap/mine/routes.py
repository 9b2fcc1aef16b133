"""Routes on a plan: drifts and places in order, with gears, become runs along edges, turns and inversions.

A search over (edge, direction of motion, gear): a machine never turns round in a drift, so its gear follows from the way it
came. To invert it drives past a node until it has all of its length behind it, and leaves by another branch.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence

from lhdmap.errors import UsageError
from lhdmap.machine import Machine
from lhdmap.mine.network import Branch, BranchTurn, Edge, Network
from lhdmap.mine.plan import BLIND
from lhdmap.mine.route import Start, Stop
from lhdmap.mine.route_search import RouteState, RouteStep, Starts, cheapest
from lhdmap.mine.runs import Run, joined, trimmed
from lhdmap.mine.stands import kept_free_m, overhang_m, place_end, stand_at

_INVERSION_M = 20.0  # what an inversion is worth, as a way
_REVERSE = 2.5  # a way in reverse against one forwards
_BEHIND_M = 1.0
_AT_NODE_M = 13.0  # so near a node a turn may leave an edge, or come into it
_TEACHING_REVERSE = 8.0  # a teaching drive goes forwards where it can
_WORKED = ("draw_point", "dump")
LEAST_RADIUS_M = 5.0
"""Turns of a smaller radius are not driven (guidance prototype, tightest bends)."""


class RouteFinder:
    """Finds routes of a machine through a network."""

    def __init__(self, network: Network, machine: Machine) -> None:
        self.network, self.machine = network, machine
        self._wheelbase_m, self._reverse = machine.dimensions.wheelbase_m, _REVERSE
        self.left_out: list[str] = []
        self._worked = {place_end(network, one)[:2] for one in network.plan.places if one.kind in _WORKED}
        self._turns: dict[tuple[int, Branch], list[BranchTurn]] = {}
        for turn in network.turns:
            if turn.tube < 0 or turn.radius_m >= LEAST_RADIUS_M:
                self._turns.setdefault((turn.node, turn.start), []).append(turn)
        self._edge_of = {
            (edge.tube, outward, round(s, 3)): index
            for index, edge in enumerate(network.edges)
            for outward, s in ((1, edge.start_m), (-1, edge.end_m))
        }

    def route(self, start: Start, stops: Sequence[Stop]) -> list[Run]:
        """Return the runs of a route.

        Raises:
            UsageError: there is no way to one of its elements.
        """
        runs, states = self._begin(start)
        for number, stop in enumerate(stops):
            last = number == len(stops) - 1
            reached = self._reaches(stop, first=number == 0, last=last)
            wanted = {state: first for state, first in states.items() if state.gear == stop.gear}
            found = self._search(wanted if number == 0 else states, reached) or self._search(states, reached)
            if found is None and last:  # a ring has no end
                found = self._search(states, self._reaches(stop, first=number == 0, last=False))
            if found is None:
                raise UsageError(
                    f"no way to '{stop.name}'{' in reverse' if stop.gear < 0 else ''}: no turn that leads there is wide enough"
                )
            state, driven = found
            runs = [*runs, *self._named(self._short_of_node(state, driven) if last else driven, stop)]
            states = {state: ()}
        return trimmed(self.network, joined(runs))

    def teaching(self, start: Start) -> list[Run]:
        """Return the runs of a drive through every edge that can be reached, each time the nearest; `left_out` are the others.

        A draw point or dump is reached bucket first where a way leads there so: else the machine never stands where it works.
        """
        self._reverse = _TEACHING_REVERSE
        runs, states = self._begin(start)
        state: RouteState | None = None
        left = {index for index, edge in enumerate(self.network.edges) if not self._blind(edge)}
        for covers in (self._covered_as_worked, self._covered):
            while left:
                found = self._search(states, functools.partial(_covers_any, covers, frozenset(left)))
                if found is None:
                    break
                state, driven = found
                runs += driven
                left -= {k for k in left for run in driven if covers(k, run)}
                states = {state: ()}
        self.left_out = sorted({self.network.tubes[self.network.edges[k].tube].name for k in left})
        runs = runs if state is None else self._past_node(state, runs)
        return trimmed(self.network, joined(runs))

    def _past_node(self, state: RouteState, runs: list[Run]) -> list[Run]:
        """Return runs that end at a node, and go on until all of the machine is past it: no bumper fits before the wall ahead.

        Where no branch takes a machine they end before that wall.
        """
        edge = self.network.edges[state.edge]
        if self._is_dead_end(edge, state.direction):
            return runs
        ways: list[list[Run]] = []
        for step in self._on(state, edge):
            ahead, direction = self.network.edges[step.state.edge], step.state.direction
            begin = ahead.start_m if direction > 0 else ahead.end_m
            there = begin + direction * self._depth(ahead, direction)
            if (self._end(ahead, direction, state.gear) - there) * direction >= 0.0:
                ways.append([*step.runs, Run(ahead.tube, begin, there, state.gear)])
        return [*runs, *min(ways, key=len)] if ways else self._short_of_node(state, runs)

    def _blind(self, edge: Edge) -> bool:
        place = self.network.tubes[edge.tube].place
        return place is not None and place.kind in BLIND

    def _covered_as_worked(self, index: int, run: Run) -> bool:
        """Return whether a run goes through an edge; where one works at its end, facing it."""
        facing = run.gear if run.to_m > run.from_m else -run.gear
        edge = self.network.edges[index]
        worked = {1: (edge.tube, edge.end_m), -1: (edge.tube, edge.start_m)}
        return self._covered(index, run) and worked[-facing] not in self._worked

    def _covered(self, index: int, run: Run) -> bool:
        """Return whether a run goes through an edge, but for what is about its nodes, and what a machine keeps from the rock."""
        edge, direction = self.network.edges[index], 1 if run.to_m > run.from_m else -1
        if run.tube != edge.tube:
            return False
        first = edge.start_m if direction > 0 else edge.end_m
        last = self._end(edge, direction, run.gear)
        begins = (run.from_m - first) * direction < _AT_NODE_M
        return begins and (run.to_m - last) * direction > -min(_AT_NODE_M, 0.4 * abs(last - first))

    def _begin(self, start: Start) -> tuple[list[Run], Starts]:
        """Return where a machine that stands somewhere can go to first, in both gears."""
        states: Starts = {}
        for index, edge in enumerate(self.network.edges):
            if edge.tube != start.tube or not edge.start_m - 0.01 <= start.at_m <= edge.end_m + 0.01:
                continue
            for gear in (1, -1):
                direction = start.facing * gear
                lead = start.at_m if gear > 0 else start.at_m - start.facing * self._wheelbase_m
                end = self._end(edge, direction, gear)
                if (end - lead) * direction > -self._wheelbase_m:
                    run = Run(edge.tube, lead, end, gear)
                    states[RouteState(index, direction, gear, False)] = (run,) if (end - lead) * direction > 0.0 else ()
            break
        return [], states

    def _end(self, edge: Edge, direction: int, gear: int) -> float:
        """Return where on its tube the leading axle is when an edge has been driven through: at the node, or before the rock."""
        node, s = (edge.end, edge.end_m) if direction > 0 else (edge.start, edge.start_m)
        if self.network.nodes[node].degree > 1:
            return s
        return s - direction * (kept_free_m(self.network, edge.tube, s) + overhang_m(self.machine, gear))

    def _steps(self, state: RouteState) -> Iterator[RouteStep]:
        edge = self.network.edges[state.edge]
        if state.entering:
            yield from self._through(state, edge)
            yield from self._short_inversion(state, edge)
        else:
            yield from self._on(state, edge)

    def _through(self, state: RouteState, edge: Edge) -> Iterator[RouteStep]:
        begin = edge.start_m if state.direction > 0 else edge.end_m
        end = self._end(edge, state.direction, state.gear)
        way = (end - begin) * state.direction
        if way > 0.0:
            run = Run(edge.tube, begin, end, state.gear)
            yield RouteStep(way * (1.0 if state.gear > 0 else self._reverse), state._replace(entering=False), (run,))

    def _short_inversion(self, state: RouteState, edge: Edge) -> Iterator[RouteStep]:
        """Drive into an edge until the whole machine is past the node, and come back in the other gear."""
        begin = edge.start_m if state.direction > 0 else edge.end_m
        depth = self._depth(edge, state.direction)
        if (self._end(edge, state.direction, state.gear) - begin) * state.direction < depth:
            return
        there = begin + state.direction * depth
        back = there - state.direction * self._wheelbase_m
        runs = (Run(edge.tube, begin, there, state.gear), Run(edge.tube, back, begin, -state.gear))
        yield RouteStep(2.0 * depth + _INVERSION_M, RouteState(state.edge, -state.direction, -state.gear, False), runs)

    def _depth(self, edge: Edge, direction: int) -> float:
        """Return how far into an edge a machine is past the node that it came in by, and past its turns, with all its length."""
        node = edge.start if direction > 0 else edge.end
        turns = (turn for turns in self._turns.values() for turn in turns)
        reach = max((one.end_at_m for one in turns if one.node == node and one.end.tube == edge.tube), default=0.0)
        return reach + self._wheelbase_m + _BEHIND_M

    def _on(self, state: RouteState, edge: Edge) -> Iterator[RouteStep]:
        """Go on from the end of an edge: into another one, or back in the other gear."""
        node, s = (edge.end, edge.end_m) if state.direction > 0 else (edge.start, edge.start_m)
        for turn in self._turns.get((node, Branch(edge.tube, s, -state.direction)), ()):
            following = self._edge_of.get((turn.end.tube, turn.end.outward, round(turn.end.s_m, 3)))
            if following is not None:
                runs = () if turn.tube < 0 else (self._turn_run(turn, edge, state.gear),)
                yield RouteStep(0.1, RouteState(following, turn.end.outward, state.gear, True), runs)
        if self.network.nodes[node].degree == 1:
            back = self._end(edge, state.direction, state.gear) - state.direction * self._wheelbase_m
            begin = edge.start_m if state.direction > 0 else edge.end_m
            other = (
                self._end(edge, -state.direction, -state.gear) if self._is_dead_end(edge, -state.direction) else begin
            )
            way = (back - other) * state.direction  # not positive: the rear axle is still in the turn
            if way > 0.0 or not self._is_dead_end(edge, -state.direction):
                cost = max(way, 0.0) * (1.0 if state.gear < 0 else self._reverse) + _INVERSION_M
                runs = (Run(edge.tube, back, other, -state.gear),) if way > 0.0 else ()
                yield RouteStep(cost, RouteState(state.edge, -state.direction, -state.gear, False), runs)

    def _is_dead_end(self, edge: Edge, direction: int) -> bool:
        return self.network.nodes[edge.end if direction > 0 else edge.start].degree == 1

    def _turn_run(self, turn: BranchTurn, edge: Edge, gear: int) -> Run:
        """Return the run through a turn's tube; which way follows from which of its ends is nearer to the edge."""
        tube = self.network.tubes[turn.tube]
        begin = self.network.tubes[edge.tube].pose(turn.start.s_m + turn.start.outward * turn.start_at_m)
        first, last = tube.pose(0.0), tube.pose(tube.length_m)
        ahead = ((first - begin)[:2] ** 2).sum() <= ((last - begin)[:2] ** 2).sum()
        return Run(turn.tube, 0.0, tube.length_m, gear) if ahead else Run(turn.tube, tube.length_m, 0.0, gear)

    def _short_of_node(self, state: RouteState, runs: list[Run]) -> list[Run]:
        """Return runs that end before the drift that theirs runs into: with the bumper before its walls."""
        edge = self.network.edges[state.edge]
        node = self.network.nodes[edge.end if state.direction > 0 else edge.start]
        if node.degree < 2 or not runs:
            return runs
        others = [branch for branch in node.branches if branch.tube != edge.tube]
        half_m = max((self.network.tubes[one.tube].half_width_m(one.s_m) for one in others), default=0.0)
        back_m = half_m + overhang_m(self.machine, state.gear)
        last = runs[-1]
        to_m = last.to_m - state.direction * min(back_m, 0.9 * abs(last.to_m - last.from_m))
        return [*runs[:-1], last._replace(to_m=to_m)]

    def _reaches(self, stop: Stop, *, first: bool, last: bool) -> Callable[[RouteStep], bool]:
        """Return what tells whether a step reaches an element of a route."""
        network = self.network
        place = next((one for one in network.plan.places if one.name == stop.name), None)
        if place is None:
            tube = network.tube(stop.name)
            return lambda step: (
                not step.state.entering
                and network.edges[step.state.edge].tube == tube
                and step.state.gear == stop.gear
                and any(self._through_drift(run, step.state, tube, stop.gear, first) for run in step.runs)
                and (not last or self._is_last(step.state))
            )
        if place.kind in (*BLIND, "passing_bay"):
            tube, at_m, _ = stand_at(network, place, self.machine)
            return lambda step: any(
                run.tube == tube
                and run.gear == stop.gear
                and min(run.from_m, run.to_m) <= at_m <= max(run.from_m, run.to_m)
                for run in step.runs
            )
        tube, end_m, direction = place_end(network, place)
        return lambda step: (
            not step.state.entering
            and step.state.gear == stop.gear
            and step.state.direction == direction
            and network.edges[step.state.edge].tube == tube
            and abs(
                (network.edges[step.state.edge].end_m if direction > 0 else network.edges[step.state.edge].start_m)
                - end_m
            )
            < 0.01
        )

    def _through_drift(self, run: Run, state: RouteState, tube: int, gear: int, first: bool) -> bool:
        """Return whether a run goes through an edge of a drift; the first of a drive may begin within it."""
        return run.tube == tube and run.gear == gear and (first or self._covered(state.edge, run))

    def _is_last(self, state: RouteState) -> bool:
        """Return whether the tube does not go on behind this edge."""
        edge = self.network.edges[state.edge]
        node, s = (edge.end, edge.end_m) if state.direction > 0 else (edge.start, edge.start_m)
        came = Branch(edge.tube, s, -state.direction)
        return not any(branch.tube == edge.tube and branch != came for branch in self.network.nodes[node].branches)

    def _named(self, runs: list[Run], stop: Stop) -> list[Run]:
        """Return runs whose last one stops at the place that the route names."""
        place = next((one for one in self.network.plan.places if one.name == stop.name), None)
        if place is None or not runs:
            return runs
        if place.kind in (*BLIND, "passing_bay"):
            _, at_m, _ = stand_at(self.network, place, self.machine)
            last = runs[-1]
            return [*runs[:-1], last._replace(to_m=at_m, stop=stop.name), last._replace(from_m=at_m)]
        return [*runs[:-1], runs[-1]._replace(stop=stop.name)]

    def _search(self, states: Starts, reached: Callable[[RouteStep], bool]) -> tuple[RouteState, list[Run]] | None:
        """Return the cheapest way from one of `states` to what is `reached`: where it ends, and the runs."""
        return cheapest(states, self._steps, reached, self._reverse)


def _covers_any(covers: Callable[[int, Run], bool], edges: frozenset[int], step: RouteStep) -> bool:
    return any(covers(k, run) for k in edges for run in step.runs)

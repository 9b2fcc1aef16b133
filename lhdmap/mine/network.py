"""The network of a plan: tubes, the nodes where they meet, the edges between nodes, and the turns from branch to branch.

    plan -> centre lines -> meetings -> nodes and branches -> edges, turns

A node with more than two branches is an intersection; one with two joins drifts end to end; one with one is a dead end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from lhdmap.errors import ConfigError
from lhdmap.messages import FloatArray
from lhdmap.mine.biarc import biarc
from lhdmap.mine.centre_line import CentreLine
from lhdmap.mine.meetings import Meeting, drift_lines, meetings
from lhdmap.mine.plan import BLIND, LENGTH_M, PASSING_M, JunctionPlan, MinePlan, PlacePlan
from lhdmap.mine.polyline import rounded_line
from lhdmap.mine.tube import Tube, rows_of

_MERGE = 0.7  # meetings nearer than this share of both half widths are one node
_ARM_M = 1.5  # what reaches this far beyond the other drift's wall is a branch
_AT_M = 5.0  # [[junction]] at
_RUN_M = 8.0  # places on one tube that are nearer than this to each other are one
_STRAIGHT_RAD = math.radians(8.0)
_SHARP_RAD = math.radians(100.0)
_LEAST_WALL_M = 1.0  # a corner with a smaller wall radius is not cut
_KEPT_M = 9.0  # of a dead-end branch stays straight: a machine's length
_DRAW_POINT_DEG = 60.0
_REACHES = (
    1.0,
    1.2,
    1.45,
    1.75,
)  # times the tangent length of the wanted radius: where the branches bend near the node
_TAPER_M = 0.35  # a turn is narrower by this than its branches, where it begins and ends: its walls stay behind theirs


class Branch(NamedTuple):
    """A branch of a node: tube, where on it the node is (m), which way it leaves (1: with the centre line, -1: against it)."""

    tube: int
    s_m: float
    outward: int


class Node(NamedTuple):
    """Where tubes meet or end: name, position (3,), branches, radius of the wall at its corners (m)."""

    name: str
    position_m: FloatArray
    branches: tuple[Branch, ...]
    corner_m: float

    @property
    def degree(self) -> int:
        """Number of branches."""
        return len(self.branches)


class Edge(NamedTuple):
    """A piece of a tube between two nodes: from `start_m` at node `start` to `end_m` at node `end`."""

    tube: int
    start_m: float
    end_m: float
    start: int
    end: int

    @property
    def length_m(self) -> float:
        """Length, metres."""
        return self.end_m - self.start_m


class Turn(NamedTuple):
    """The way from one branch of a node into another: how far from the node it begins and ends (m), its tube and radius (m).

    `tube` is -1 where the way goes straight on in the same tube.
    """

    node: int
    start: Branch
    end: Branch
    tube: int
    start_at_m: float
    end_at_m: float
    radius_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """A mine's network; `tubes` holds drifts and places first, then turns."""

    plan: MinePlan
    tubes: list[Tube]
    nodes: list[Node] = field(default_factory=list)
    edges: list[Edge] = field(default_factory=list)
    turns: list[Turn] = field(default_factory=list)

    def tube(self, name: str) -> int:
        """Return the index of a drift or place that is a tube."""
        return next(k for k, tube in enumerate(self.tubes) if tube.name == name and tube.kind != "turn")


def make_network(plan: MinePlan) -> Network:
    """Return the network of a plan.

    Raises:
        ConfigError: lines cross without joining, a place lies beyond the end of its drift, or a junction of the plan is none.
    """
    lines = drift_lines(plan.drifts)
    names = [drift.name for drift in plan.drifts]
    tubes = [
        Tube(
            drift.name, "drift", line, rows_of(drift.width_m), rows_of(drift.height_m),
            plan.walls.roughness_m if drift.roughness_m is None else drift.roughness_m,
        )
        for drift, line in zip(plan.drifts, lines, strict=True)
    ]  # fmt: skip
    found = meetings(names, lines)
    for place in plan.places:
        tubes, found = _with_place(tubes, found, place)
    network = Network(plan, tubes)
    joints = _nodes(network, found)
    _edges(network, joints)
    _turns(network)
    return network


def _with_place(tubes: list[Tube], found: list[Meeting], place: PlacePlan) -> tuple[list[Tube], list[Meeting]]:
    """Return tubes and meetings with those of a place."""
    index = next(k for k, tube in enumerate(tubes) if tube.name == place.drift)
    drift = tubes[index]
    at_m = place_at(place, drift)
    if place.side == "end":
        return tubes, found
    if place.kind == "passing_bay":
        return [*tubes[:index], _widened(drift, place, at_m), *tubes[index + 1 :]], found
    line = _stub(place, drift, at_m)
    width = place.width_m or 2.0 * drift.half_width_m(at_m)
    height = place.height_m or drift.height_m(at_m)
    tube = Tube(place.name, "place", line, rows_of(width), rows_of(height), drift.roughness_m, place)
    meeting = [] if place.kind in BLIND else [Meeting(index, at_m, len(tubes), 0.0)]
    return [*tubes, tube], [*found, *meeting]


def place_at(place: PlacePlan, drift: Tube) -> float:
    """Return where a place is on its drift's centre line, metres.

    Raises:
        ConfigError: it lies beyond the drift's end, or the plan does not say where.
    """
    length = drift.length_m
    if place.side == "end":
        return 0.0 if place.at_m is not None and place.at_m < 0.5 * length else length
    if place.at_m is None:
        raise ConfigError(f"[[place]] '{place.name}': at_m is missing (where it is on drift '{drift.name}')")
    if not 0.0 <= place.at_m <= length:
        raise ConfigError(
            f"[[place]] '{place.name}': at_m = {place.at_m:g} is not on drift '{drift.name}', which is {length:.1f} m long"
        )
    return place.at_m


def _stub(place: PlacePlan, drift: Tube, at_m: float) -> CentreLine:
    """Return the centre line of a place beside a drift: straight and level."""
    angle = place.angle_deg or (_DRAW_POINT_DEG if place.kind == "draw_point" else 90.0)
    turn = math.radians(angle) * (1.0 if place.side == "left" else -1.0)
    x, y, z, heading = drift.pose(at_m)
    length = drift.half_width_m(at_m) / math.sin(math.radians(angle)) + (place.length_m or LENGTH_M[place.kind])
    end = (x + length * math.cos(heading + turn), y + length * math.sin(heading + turn), z)
    return rounded_line(np.array([[x, y, z], end]), 1.0, place.name)


def _widened(drift: Tube, place: PlacePlan, at_m: float) -> Tube:
    """Return a drift that is wider at a passing bay, over its length and a taper of a third of it at both sides."""
    half, more = 0.5 * (place.length_m or LENGTH_M[place.kind]), place.width_m or PASSING_M
    knots = np.clip(at_m + half * np.array([-1.0, -0.6, 0.6, 1.0]), 0.0, drift.length_m)
    at = np.unique(np.concatenate([drift.widths_m[:, 0], knots]))
    widths = np.interp(at, *drift.widths_m.T) + np.interp(at, knots, [0.0, more, more, 0.0], left=0.0, right=0.0)
    return replace(drift, widths_m=np.stack([at, widths], axis=1))


Joint = tuple[int, float]  # tube, arc length


def _nodes(network: Network, found: list[Meeting]) -> dict[Joint, int]:
    """Make the nodes where tubes meet; return the node of each place on a tube that is in one."""
    tubes, groups = network.tubes, _grouped(network.tubes, found)
    joints: dict[Joint, int] = {}
    used: set[int] = set()
    for group in groups:
        position = np.mean([tubes[tube].pose(s)[:3] for tube, s in group], axis=0)
        given = _given(network.plan.junctions, position, used)
        branches = tuple(_branches(tubes, group))
        number = 1 + sum(node.degree > 2 for node in network.nodes)
        name = given.name if given is not None and given.name else (f"I{number}" if len(branches) > 2 else "")
        corner = JunctionPlan((0.0, 0.0, 0.0)).corner_m if given is None else given.corner_m
        for joint in group:
            joints[joint] = len(network.nodes)
        network.nodes.append(Node(name, position, branches, corner))
    if len(used) < len(network.plan.junctions):
        k = next(k for k in range(len(network.plan.junctions)) if k not in used)
        raise ConfigError(
            f"[[junction]] at = {list(network.plan.junctions[k].at)}: no drifts join within {_AT_M:g} m of it"
        )
    return joints


def _grouped(tubes: list[Tube], found: list[Meeting]) -> list[list[Joint]]:
    """Return the places on tubes that are one node, group by group, in the order of the plan."""
    groups: list[list[Joint]] = []
    for meeting in found:
        pair: list[Joint] = [(meeting.first, meeting.first_m), (meeting.second, meeting.second_m)]
        near = [group for group in groups if any(_one_node(tubes, a, b) for a in group for b in pair)]
        merged = [joint for group in near for joint in group]
        groups = [group for group in groups if group not in near]
        groups.append(list(dict.fromkeys([*merged, *pair])))
    return sorted(groups, key=min)


def _one_node(tubes: list[Tube], a: Joint, b: Joint) -> bool:
    reach = _MERGE * (tubes[a[0]].half_width_m(a[1]) + tubes[b[0]].half_width_m(b[1]))
    apart = tubes[a[0]].pose(a[1])[:3] - tubes[b[0]].pose(b[1])[:3]
    return bool(np.linalg.norm(apart) < reach)


def _given(junctions: tuple[JunctionPlan, ...], position: FloatArray, used: set[int]) -> JunctionPlan | None:
    for k, junction in enumerate(junctions):
        if k not in used and np.linalg.norm(np.array(junction.at) - position) <= _AT_M:
            used.add(k)
            return junction
    return None


def _branches(tubes: list[Tube], group: list[Joint]) -> list[Branch]:
    """Return the branches of a node: each tube to both sides, where it goes on beyond the others' walls."""
    branches = []
    for tube in dict.fromkeys(tube for tube, _ in group):
        reach = max((tubes[k].half_width_m(s) + _ARM_M for k, s in group if k != tube), default=_ARM_M)
        for first, last in _runs([s for k, s in group if k == tube]):
            if tubes[tube].length_m - last > reach:
                branches.append(Branch(tube, last, 1))
            if first > reach:
                branches.append(Branch(tube, first, -1))
    return branches


def _runs(places_m: list[float]) -> list[tuple[float, float]]:
    """Return first and last of the places on one tube that lie close together, run by run."""
    runs: list[tuple[float, float]] = []
    for s in sorted(places_m):
        if runs and s - runs[-1][1] < _RUN_M:
            runs[-1] = (runs[-1][0], s)
        else:
            runs.append((s, s))
    return runs


def _edges(network: Network, joints: dict[Joint, int]) -> None:
    """Cut the tubes at the nodes; where one ends in the rock is a node of one branch."""
    for tube, one in enumerate(network.tubes):
        if one.place is not None and one.place.kind in BLIND:
            continue
        cuts: dict[int, list[float]] = {}
        for (k, s), node in sorted(joints.items()):
            if k == tube:
                cuts.setdefault(node, []).append(s)
        stops = sorted((*run, node) for node, places in cuts.items() for run in _runs(places))
        _cut(network, tube, stops)


def _cut(network: Network, tube: int, stops: list[tuple[float, float, int]]) -> None:
    """Add the edges of one tube, between its nodes `stops` (first m, last m, node), and to its ends where it has branches."""
    at_m, at = 0.0, None
    for first, last, node in stops:
        if Branch(tube, first, -1) in network.nodes[node].branches:
            start = _dead_end(network, tube, at_m, 1) if at is None else at
            network.edges.append(Edge(tube, at_m, first, start, node))
        at_m, at = last, node
    if at is None or Branch(tube, at_m, 1) in network.nodes[at].branches:
        start = _dead_end(network, tube, at_m, 1) if at is None else at
        length = network.tubes[tube].length_m
        network.edges.append(Edge(tube, at_m, length, start, _dead_end(network, tube, length, -1)))


def _dead_end(network: Network, tube: int, s_m: float, outward: int) -> int:
    position = network.tubes[tube].pose(s_m)[:3]
    network.nodes.append(Node("", position, (Branch(tube, s_m, outward),), 0.0))
    return len(network.nodes) - 1


def _turns(network: Network) -> None:
    """Add the turns of all nodes, from each branch into each other one, as far as there is room."""
    for index, node in enumerate(list(network.nodes)):
        for a, b in ((a, b) for a in node.branches for b in node.branches if a != b):
            if a.tube == b.tube and a.s_m == b.s_m:
                network.turns.append(Turn(index, a, b, -1, 0.0, 0.0, math.inf))
                continue
            back = next((turn for turn in network.turns if (turn.node, turn.start, turn.end) == (index, b, a)), None)
            if back is not None:
                network.turns.append(back._replace(start=a, end=b, start_at_m=back.end_at_m, end_at_m=back.start_at_m))
                continue
            turn = _turn(network, index, a, b)
            if turn is not None:
                network.turns.append(turn)


def _turn(network: Network, index: int, a: Branch, b: Branch) -> Turn | None:
    """Return the turn from one branch into another, with its tube; None where there is no room for one."""
    node, tubes = network.nodes[index], network.tubes
    if node.corner_m == 0.0 or _left_as_it_is(tubes, a, b):
        return None
    half = min(tubes[branch.tube].half_width_m(branch.s_m) for branch in (a, b))
    angle = _angle(tubes, a, b)
    wanted_m = node.corner_m + half
    reach_m = wanted_m * math.tan(0.5 * min(angle, math.radians(175.0))) if angle > _STRAIGHT_RAD else 2.0 * half
    room_m = min(_room(network, index, branch) for branch in (a, b))
    best: tuple[float, float, CentreLine] | None = None
    for more in _REACHES:
        way_m = min(more * reach_m, room_m)
        line = _turn_line(tubes, a, b, way_m) if way_m > 0.5 else None
        if line is None:
            continue
        radius_m = 1.0 / max(float(np.abs(line.curvature_pm).max()), 1e-9)
        if best is None or radius_m > best[0] + 0.1:
            best = (radius_m, way_m, line)
        if radius_m > 0.95 * wanted_m:
            break
    if best is None or best[0] - half < _LEAST_WALL_M:
        return None
    radius_m, way_m, line = best
    tubes.append(_turn_tube(f"{node.name or 'turn'} {tubes[a.tube].name} {tubes[b.tube].name}", line, tubes, (a, b)))
    return Turn(index, a, b, len(tubes) - 1, way_m, way_m, radius_m)


def _left_as_it_is(tubes: list[Tube], a: Branch, b: Branch) -> bool:
    """Return whether the corner between two branches stays: between two places, and the sharp side of a slanting one."""
    places = [branch for branch in (a, b) if tubes[branch.tube].kind == "place"]
    return len(places) == 2 or (len(places) == 1 and _angle(tubes, a, b) > _SHARP_RAD)


def _turn_line(tubes: list[Tube], a: Branch, b: Branch, way_m: float) -> CentreLine | None:
    """Return the line from `way_m` before the node in one branch to as far behind it in the other."""
    ends = [tubes[branch.tube].pose(branch.s_m + branch.outward * way_m, branch.outward) for branch in (a, b)]
    ends[0][3] += math.pi  # towards the node
    try:
        return biarc(*ends)
    except ValueError:
        return None


def _angle(tubes: list[Tube], a: Branch, b: Branch) -> float:
    """Return by how much a machine turns (rad, 0 to pi) from one branch into another, by their first 5 m."""
    headings = []
    for branch in (a, b):
        ahead = float(np.clip(branch.s_m + 5.0 * branch.outward, 0.0, tubes[branch.tube].length_m))
        near, far = tubes[branch.tube].pose(branch.s_m), tubes[branch.tube].pose(ahead)
        headings.append(math.atan2(far[1] - near[1], far[0] - near[0]))
    return abs((headings[1] - headings[0] - math.pi + math.pi) % (2 * math.pi) - math.pi)


def _room(network: Network, node: int, branch: Branch) -> float:
    """Return how far from the node a turn may begin: half of the way to the next node, less of a dead end."""
    for edge in network.edges:
        if edge.tube != branch.tube:
            continue
        at_start = edge.start == node and branch.outward > 0 and abs(edge.start_m - branch.s_m) < 0.5
        at_end = edge.end == node and branch.outward < 0 and abs(edge.end_m - branch.s_m) < 0.5
        if at_start or at_end:
            other = edge.end if at_start else edge.start
            dead_end = network.nodes[other].degree < 2
            return max(edge.length_m - _KEPT_M, 0.35 * edge.length_m) if dead_end else 0.48 * edge.length_m
    return 0.0


def _turn_tube(name: str, line: CentreLine, tubes: list[Tube], branches: tuple[Branch, Branch]) -> Tube:
    widths = [2.0 * tubes[branch.tube].half_width_m(branch.s_m) for branch in branches]
    heights = [tubes[branch.tube].height_m(branch.s_m) for branch in branches]
    length = line.length_m
    taper = min(2.0, 0.3 * length)
    rows = [
        [0.0, widths[0] - 2 * _TAPER_M],
        [taper, min(widths)],
        [length - taper, min(widths)],
        [length, widths[1] - 2 * _TAPER_M],
    ]
    roughness = max(tubes[branch.tube].roughness_m for branch in branches)
    return Tube(name, "turn", line, np.array(rows), np.array([[0.0, min(heights) - 0.05]]), roughness)

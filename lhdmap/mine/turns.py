"""The turns of a network: from each branch of a node into each other one, with a tube of its own as far as there is room."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.mine.biarc import biarc
from lhdmap.mine.centre_line import CentreLine
from lhdmap.mine.network import Branch, BranchTurn, Network
from lhdmap.mine.tube import Tube

_STRAIGHT_RAD = math.radians(8.0)
_SHARP_RAD = math.radians(100.0)
_LEAST_WALL_M = 1.0  # a corner with a smaller wall radius is not cut
_KEPT_M = 9.0  # of a dead-end branch stays straight: a machine's length
_REACHES = (
    1.0,
    1.2,
    1.45,
    1.75,
)  # times the tangent length of the wanted radius: where the branches bend near the node
_TAPER_M = 0.35  # a turn is narrower by this than its branches, where it begins and ends: its walls stay behind theirs


def add_turns(network: Network) -> None:
    """Add the turns of all nodes, from each branch into each other one, as far as there is room."""
    for index, node in enumerate(list(network.nodes)):
        for a, b in ((a, b) for a in node.branches for b in node.branches if a != b):
            if a.tube == b.tube and a.s_m == b.s_m:
                network.turns.append(BranchTurn(index, a, b, -1, 0.0, 0.0, math.inf))
                continue
            back = next((turn for turn in network.turns if (turn.node, turn.start, turn.end) == (index, b, a)), None)
            if back is not None:
                network.turns.append(back._replace(start=a, end=b, start_at_m=back.end_at_m, end_at_m=back.start_at_m))
                continue
            turn = _turn(network, index, a, b)
            if turn is not None:
                network.turns.append(turn)


def _turn(network: Network, index: int, a: Branch, b: Branch) -> BranchTurn | None:
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
    return BranchTurn(index, a, b, len(tubes) - 1, way_m, way_m, radius_m)


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

"""The true topology of a plan: intersections, tunnels, places, access points; and which of them a place in the mine is in."""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.mine.network import Branch, Edge, Network, Node
from lhdmap.mine.plan import BLIND, LENGTH_M, PlacePlan
from lhdmap.mine.stands import kept_free_m, place_end, place_pose

_STATION_M = 0.25
_STAND_M = 12.0  # so far from the end of a drift one is at the place there,
_STANDING_M = 5.0  # and where base_link of a machine is that stands there
_LEVELS_M = 3.0
_ANGLE_RAD = math.radians(9.0)  # arms that are so nearly one line have no corner between them


class Tunnel(NamedTuple):
    """A way between two intersections or ends, maybe over several drifts.

    `drift` is the first of them, `span_m` where on their centre lines it begins and ends.
    """

    name: str
    drift: str
    ends: tuple[str, str]
    length_m: float
    span_m: tuple[float, float]
    is_place: bool


class Whereabouts(NamedTuple):
    """In which node a place is, and where on the centre line of its drift, metres."""

    node: str
    at_m: float


def branch_reach_m(network: Network, node: int, branch: Branch) -> float:
    """Return where along a branch its intersection ends: the wall's corner with its neighbours, and where turns begin.

    The corner of two straight walls lies at max over the neighbours (h_j + h_k cos φ) / sin φ from the node.
    """
    tubes, one = network.tubes, network.nodes[node]
    reach = max(
        (turn.start_at_m for turn in network.turns if turn.node == node and turn.start == branch and turn.tube >= 0),
        default=0.0,
    )
    own = tubes[branch.tube].half_width_m(branch.s_m)
    heading = tubes[branch.tube].pose(branch.s_m, branch.outward)[3]
    for other in one.branches:
        angle = abs(math.remainder(tubes[other.tube].pose(other.s_m, other.outward)[3] - heading, 2 * math.pi))
        if other != branch and _ANGLE_RAD < angle < math.pi - _ANGLE_RAD:
            half = tubes[other.tube].half_width_m(other.s_m)
            reach = max(reach, (half + own * math.cos(angle)) / math.sin(angle))
    return reach


def tunnels_of(network: Network) -> list[Tunnel]:
    """Return the tunnels between intersections and ends; a drift that intersections cut into several has them numbered."""
    chains = _chains(network)
    names = ["+".join(dict.fromkeys(network.tubes[edge.tube].name for edge, _ in chain)) for chain in chains]
    found = []
    for k, (chain, name) in enumerate(zip(chains, names, strict=True)):
        number = 1 + names[:k].count(name)
        first, last = chain[0], chain[-1]
        start = first[0].start if first[1] > 0 else first[0].end
        end = last[0].end if last[1] > 0 else last[0].start
        ends = (_end_name(network.nodes[start]), _end_name(network.nodes[end]))
        span = (
            first[0].start_m if first[1] > 0 else first[0].end_m,
            last[0].end_m if last[1] > 0 else last[0].start_m,
        )
        found.append(
            Tunnel(
                f"{name}.{number}" if names.count(name) > 1 else name,
                network.tubes[first[0].tube].name,
                ends,
                sum(edge.length_m for edge, _ in chain),
                span,
                network.tubes[first[0].tube].kind == "place",
            )
        )
    return found


def _chains(network: Network) -> list[list[tuple[Edge, int]]]:
    """Return the edges of each tunnel in order, with the direction in which they are gone through."""
    left = list(range(len(network.edges)))
    chains = []
    while left:
        index = next((k for k in left if _outer(network, k)), left[0])
        edge = network.edges[index]
        direction = 1 if network.nodes[edge.start].degree != 2 else -1
        chain = [(edge, direction)]
        left.remove(index)
        while True:
            node = chain[-1][0].end if chain[-1][1] > 0 else chain[-1][0].start
            following = next((k for k in left if node in (network.edges[k].start, network.edges[k].end)), None)
            if network.nodes[node].degree != 2 or following is None:
                break
            left.remove(following)
            chain.append((network.edges[following], 1 if network.edges[following].start == node else -1))
        chains.append(chain)
    return sorted(chains, key=lambda chain: min((edge.tube, edge.start_m) for edge, _ in chain))


def _outer(network: Network, index: int) -> bool:
    edge = network.edges[index]
    return network.nodes[edge.start].degree != 2 or network.nodes[edge.end].degree != 2


def _end_name(node: Node) -> str:
    return node.name if node.degree > 2 else "dead_end" if node.degree == 1 else "closed"


def topology_json(network: Network, machine: Machine) -> dict[str, Any]:
    """Return the truth about a mine's topology as JSON values, in the mine's grid (contract: mine plans)."""
    levels = _levels(network)
    return {
        "mine": network.plan.name,
        "frame": "map",
        "intersections": [
            {
                "name": node.name,
                "position": _rounded(node.position_m),
                "degree": node.degree,
                "level": levels[index],
                "access_points": [_access_point(network, index, branch) for branch in node.branches],
            }
            for index, node in enumerate(network.nodes)
            if node.degree > 2
        ],
        "tunnels": [
            {
                "name": one.name,
                "ends": list(one.ends),
                "length_m": round(one.length_m, 3),
                "drift": one.drift,
                "from_m": round(one.span_m[0], 3),
                "to_m": round(one.span_m[1], 3),
            }
            for one in tunnels_of(network)
        ],
        "places": [
            {"name": place.name, "kind": place.kind, "pose": _rounded(place_pose(network, place, machine))}
            for place in network.plan.places
        ],
    }


def _access_point(network: Network, node: int, branch: Branch) -> dict[str, Any]:
    tube = network.tubes[branch.tube]
    s = min(max(branch.s_m + branch.outward * branch_reach_m(network, node, branch), 0.0), tube.length_m)
    pose = tube.pose(s, branch.outward)
    return {
        "drift": tube.name,
        "at_m": round(s, 3),
        "position": _rounded(pose[:3]),
        "heading_deg": round(math.degrees(math.remainder(pose[3], 2 * math.pi)), 3),
    }


def _levels(network: Network) -> dict[int, str | int]:
    """Return the level of each intersection: its drifts' name of it, else a number by height, the lowest 0."""
    heights = sorted(float(node.position_m[2]) for node in network.nodes if node.degree > 2)
    bounds = [0.5 * (a + b) for a, b in itertools.pairwise(heights) if b - a > _LEVELS_M]
    found: dict[int, str | int] = {}
    for index, node in enumerate(network.nodes):
        names = [_level_name(network, branch) for branch in node.branches]
        named = next((name for name in names if name), "")
        found[index] = named or int(np.searchsorted(bounds, node.position_m[2]))
    return found


def _level_name(network: Network, branch: Branch) -> str:
    tube = network.tubes[branch.tube]
    name = tube.name if tube.place is None else tube.place.drift
    return next((drift.level for drift in network.plan.drifts if drift.name == name), "")


def _rounded(values: FloatArray) -> list[float]:
    return [round(float(value), 4) for value in values]


class Directory:
    """Tells in which node a place is."""

    def __init__(self, network: Network) -> None:
        self._network = network
        parts = []
        for index, tube in enumerate(network.tubes):
            if tube.kind == "turn" or (tube.place is not None and tube.place.kind in BLIND):
                continue
            s = np.append(np.arange(0.0, tube.length_m, _STATION_M), tube.length_m)
            parts.append(np.column_stack([tube.line.at(s)[:, :3], np.full(len(s), float(index)), s]))
        self._rows = np.concatenate(parts)
        self._tree = KDTree(self._rows[:, :3])
        self._reaches = [
            (branch.tube, branch.s_m, branch.outward, branch_reach_m(network, index, branch), node.name)
            for index, node in enumerate(network.nodes)
            if node.degree > 2
            for branch in node.branches
        ]
        self._stands = [self._stand(place) for place in network.plan.places]

    def at(self, position_m: FloatArray) -> Whereabouts:
        """Return the node that a point (3,) is in."""
        row = self._rows[int(self._tree.query(position_m)[1])]
        tube, s = int(row[3]), float(row[4])
        for index, at_m, outward, reach_m, name in self._reaches:
            if index == tube and -1.0 <= (s - at_m) * outward < reach_m:
                return Whereabouts(name, s)
        for index, low_m, high_m, name in self._stands:
            if index == tube and low_m <= s <= high_m:
                return Whereabouts(name, s)
        return Whereabouts(self._network.tubes[tube].name, s)

    def _stand(self, place: PlacePlan) -> tuple[int, float, float, str]:
        """Return the stretch of a drift that is a place's: tube, from, to (m), name."""
        if place.kind == "passing_bay":
            half = 0.5 * (place.length_m or LENGTH_M[place.kind])
            at_m = place.at_m or 0.0
            return self._network.tube(place.drift), at_m - half, at_m + half, place.name
        if place.side != "end" or place.kind in BLIND:
            return -1, 0.0, 0.0, place.name
        tube, end_m, _ = place_end(self._network, place)
        reach_m = max(_STAND_M, kept_free_m(self._network, tube, end_m) + _STANDING_M)
        return tube, end_m - reach_m, end_m + reach_m, place.name

"""Routes against a search that knows nothing of the paper's states: places where nodes meet, which way the machine faces there."""

from __future__ import annotations

import heapq
import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.movement.routes import RouteOptions, RoutePlanner
from lhdmap.movement.settings import MovementSettings
from lhdmap.topology.model import TopologicalMap

from tests.topology.maps import ladder

INVERSION_S, FORWARD_KMH, REVERSE_KMH = 7.0, 20.0, 9.0
ABRUPT = MovementSettings(
    acceleration_mps2=1e6,
    deceleration_mps2=1e6,
    inversion_s=INVERSION_S,
    limit_empty_kmh=FORWARD_KMH,
    limit_reverse_kmh=REVERSE_KMH,
)
"""Speed is gathered and lost at once: a route costs its driving and its changes of gear."""

State = tuple[frozenset[str], str, str]
"""A place (one access point, or two that meet), the node that the machine faces there, and the node that it moves into."""


def best_time(topology: TopologicalMap, start: str, goal: str) -> float:
    """Return the least time between two access points, any headings; inf where there is no way."""
    points = {one.id: one for one in topology.access_points}
    place = {one.id: frozenset({one.id, one.joins or one.id}) for one in topology.access_points}
    sides = {p: {points[one].node for one in p} | ({"rock"} if len(p) == 1 else set()) for p in place.values()}
    ways: dict[tuple[frozenset[str], str], list[tuple[frozenset[str], float, float]]] = {}
    for one in topology.connections:
        if one.feasible and {one.start, one.end} <= points.keys():
            node = points[one.start].node
            for a, b in ((one.start, one.end), (one.end, one.start)):
                ways.setdefault((place[a], node), []).append((place[b], one.length_m, one.speed_limit_kmh))
    queue: list[tuple[float, int, State]] = []
    for k, faces in enumerate(sorted(sides[place[start]])):
        heapq.heappush(queue, (0.0, k, (place[start], faces, "")))
    done: set[State] = set()
    count = 2
    while queue:
        spent, _, (at, faces, into) = heapq.heappop(queue)
        if at == place[goal]:
            return spent
        if (at, faces, into) in done:
            continue
        done.add((at, faces, into))
        for node in sides[at]:
            forward = faces == node
            wait = INVERSION_S if into not in ("", node) else 0.0
            for there, length, limit in ways.get((at, node), []):
                other = next(iter(sides[there] - {node}))
                speed = min(limit, FORWARD_KMH if forward else REVERSE_KMH) / 3.6
                state = (there, other if forward else node, other)
                count += 1
                heapq.heappush(queue, (spent + wait + length / speed, count, state))
    return math.inf


NAMES = [one.id for one in ladder().access_points]
CONNECTIONS = len(ladder().connections)


@settings(max_examples=150, deadline=None)
@given(
    st.sets(st.integers(0, CONNECTIONS - 1), max_size=3),
    st.lists(st.integers(1, 400), min_size=CONNECTIONS, max_size=CONNECTIONS),
    st.lists(st.integers(3, 12), min_size=CONNECTIONS, max_size=CONNECTIONS),
    st.sampled_from(NAMES),
    st.sampled_from(NAMES),
)
def test_routes_take_the_least_time(
    shut: set[int], lengths: list[int], limits: list[int], start: str, goal: str
) -> None:
    topology = ladder()
    connections = tuple(
        replace(one, feasible=k not in shut, length_m=float(lengths[k]), speed_limit_kmh=float(limits[k]))
        for k, one in enumerate(topology.connections)
    )
    topology = replace(topology, connections=connections)
    found = RoutePlanner(topology, ABRUPT).route(start, goal, RouteOptions(alternatives=0))
    wanted = best_time(topology, start, goal)
    assert found.feasible == math.isfinite(wanted)
    if found.feasible:
        assert found.time_s == pytest.approx(wanted, abs=1e-2)

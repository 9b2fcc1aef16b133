"""Mines as ways: streets with cross drifts, large and random, for the search; and changes to maps made by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from lhdmap.movement.ways import Ways
from lhdmap.topology.model import KINDS, TopologicalMap

from tests.topology.maps import ladder, pose

ARMS = 4
_BACK_BACK, _FRONT_FRONT = KINDS.index("back_back"), KINDS.index("front_front")


def streets(rows: int, columns: int, *, crossed: bool = True, seed: int = 0) -> Ways:
    """Return the paper's benchmark: `rows` streets with `columns` intersections of 4 access points, tunnels between them.

    `crossed`: tunnels from street to street, too (their access points are those of the intersections: links).
    """
    rng = np.random.default_rng(seed)
    base = np.arange(rows * columns).reshape(rows, columns) * ARMS  # east, north, west, south of each
    first, second = np.triu_indices(ARMS, 1)
    inner_a = (base.reshape(-1, 1) + first).ravel()
    inner_b = (base.reshape(-1, 1) + second).ravel()
    count = rows * (columns - 1)
    tunnel_a = rows * columns * ARMS + 2 * np.arange(count)
    links_a = [(base[:, :-1] + 0).ravel(), (base[:, 1:] + 2).ravel()]
    links_b = [tunnel_a, tunnel_a + 1]
    if crossed:
        links_a.append((base[:-1] + 1).ravel())
        links_b.append((base[1:] + 3).ravel())
    start = np.concatenate([inner_a, tunnel_a, *links_a])
    end = np.concatenate([inner_b, tunnel_a + 1, *links_b])
    within = np.arange(len(start)) < len(inner_a) + count
    length = np.where(within, rng.uniform(10.0, 60.0, len(start)), 0.0)
    return _ways(start, end, within, length, rows * columns * ARMS + 2 * count, rng)


def _ways(start: Any, end: Any, within: Any, length: Any, points: int, rng: np.random.Generator) -> Ways:
    limit = np.where(within, rng.uniform(6.0, 24.0, len(start)) / 3.6, np.inf)
    kind = np.where(within, _BACK_BACK, _FRONT_FRONT)
    blocked = np.zeros(len(start), np.int8)
    a, b, kinds = (one.astype(np.int32) for one in (start, end, kind))
    return Ways(a, b, kinds, within, length, limit, blocked, np.zeros(points, bool))


def blocked(ways: Ways, share: float, seed: int) -> Ways:
    """Return the ways with a share of those within nodes infeasible."""
    rng = np.random.default_rng(seed)
    return replace(ways, blocked=(ways.within & (rng.random(len(ways.start)) < share)).astype(np.int8))


def with_connection(topology: TopologicalMap, start: str, end: str, /, **changes: Any) -> TopologicalMap:
    """Return a map with one connection changed."""
    changed = [replace(one, **changes) if (one.start, one.end) == (start, end) else one for one in topology.connections]
    assert changed != list(topology.connections)
    return replace(topology, connections=tuple(changed))


def fast_ladder() -> TopologicalMap:
    """The ladder with limits of 30 km/h, a turning bay at DP1, 3.2 m of tunnel width, and a pair of twins 0.6 m and 12° apart."""
    topology = ladder()
    apart = {"i1.t1": pose(6.0, 0.6, 0.0), "i2.t1": pose(54.0, 0.0, 168.0)}
    return replace(
        topology,
        tunnels=tuple(
            replace(one, speed_limit_kmh=30.0, half_widths_m=np.full((len(one.line_m), 2), 1.6))
            for one in topology.tunnels
        ),
        access_points=tuple(replace(one, pose=apart.get(one.id, one.pose)) for one in topology.access_points),
        waypoints=tuple(replace(one, purpose="turning_bay", speed_limit_kmh=30.0) for one in topology.waypoints),
        connections=tuple(replace(one, speed_limit_kmh=30.0) for one in topology.connections),
    )

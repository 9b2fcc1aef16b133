"""The route graph, read by the rules of nav2's own loader, and driven along."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.topology.model import TopologicalMap

from tests.exports.conftest import Exporter
from tests.exports.folders import in_grid
from tests.topology.maps import ladder

FLOATS = {"speed_limit", "abs_speed_limit", "abs_time_taken", "penalty"}
"""What DistanceScorer, TimeScorer, PenaltyScorer and AdjustSpeedLimit take with any_cast<float>."""
DETOUR_M = 24.0 + 60.0 + 24.0


def loaded(file: Path) -> nx.MultiDiGraph:
    """The graph as nav2_route's GeoJsonGraphFileLoader makes it: its checks and its types, transcribed."""
    table = json.loads(file.read_text(encoding="utf-8"))
    features = table["features"]
    nodes = [one for one in features if one["geometry"]["type"] == "Point"]
    edges = [one for one in features if one["geometry"]["type"] in ("MultiLineString", "LineString")]
    assert nodes
    assert edges
    graph = nx.MultiDiGraph()
    seen: set[int] = set()
    for one in nodes:
        properties = one["properties"]
        number = unsigned(properties["id"])
        assert number not in seen
        seen.add(number)
        x, y = one["geometry"]["coordinates"][:2]
        assert isinstance(properties["frame"], str)
        graph.add_node(
            number, at=np.array([float(x), float(y)]), frame=properties["frame"], **checked(properties["metadata"])
        )
        assert properties["operations"] == {}
    for one in edges:
        properties = one["properties"]
        number, start, end = (unsigned(properties[key]) for key in ("id", "startid", "endid"))
        assert number not in seen
        seen.add(number)
        assert {start, end} <= graph.nodes.keys()  # else NoValidGraph
        assert isinstance(properties["cost"], float)
        assert isinstance(properties["overridable"], bool)
        metadata = checked(properties["metadata"])
        assert metadata.keys() >= FLOATS
        graph.add_edge(start, end, key=number, cost=properties["cost"], **metadata)
    return graph


def unsigned(value: Any) -> int:
    assert isinstance(value, int)
    assert not isinstance(value, bool)
    assert 0 <= value < 2**32
    return value


def checked(metadata: dict[str, Any]) -> dict[str, Any]:
    """Numbers, texts, truths, flat lists of them or tables: nothing else can be converted. What plugins read are floats."""
    for key, value in metadata.items():
        values = value if isinstance(value, list) else [value]
        assert all(isinstance(one, (bool, int, float, str)) for one in values)
        if key in FLOATS:
            assert isinstance(value, float), f"{key} would be stored as an integer: bad any_cast"
    return metadata


def named(graph: nx.MultiDiGraph, name: str) -> int:
    return next(n for n, data in graph.nodes(data=True) if name in (data.get("name"), *data.get("points", ())))


def driven_m(graph: nx.MultiDiGraph, start: str, end: str) -> float:
    path = nx.shortest_path(graph, named(graph, start), named(graph, end), weight="abs_time_taken")
    return float(sum(np.linalg.norm(graph.nodes[a]["at"] - graph.nodes[b]["at"]) for a, b in pairwise(path)))


def test_nav2_loads_it_and_drives_it(exported: Exporter) -> None:
    graph = loaded(exported("nav2-route", ".geojson"))
    places = [n for n, data in graph.nodes(data=True) if data["class"] != "bend"]
    assert len(places) == 6  # five pairs of access points and a draw point
    assert len(graph) == 8  # and the two corners of T2
    assert graph.number_of_edges() == 2 * (7 + 2)
    assert {frame for _, frame in graph.nodes(data="frame")} == {"map"}
    assert driven_m(graph, "DP1", "i2.t1") == pytest.approx(20.0 + np.hypot(6.0, 6.0) + 48.0)
    assert driven_m(graph, "t2.start", "t2.end") == pytest.approx(np.hypot(6, 6) * 2 + 48.0)  # by T1, which is shorter
    assert nx.is_strongly_connected(graph)


def test_straight_edges_stay_on_the_map_s_path(exported: Exporter) -> None:
    angles = np.linspace(np.pi, 0.0, 200)
    arc = np.column_stack([30.0 + 30.0 * np.cos(angles), 6.0 + 30.0 * np.sin(angles), np.zeros(200)])
    ways = [replace(one, line_m=arc) if one.start == "t2.start" else one for one in ladder().connections]
    graph = loaded(exported("nav2-route", ".geojson", replace(ladder(), connections=tuple(ways))))
    bends = [data["at"] for _, data in graph.nodes(data=True) if data["class"] == "bend"]
    assert 5 <= len(bends) <= 30
    for a, b in graph.edges():
        p, q = graph.nodes[a]["at"], graph.nodes[b]["at"]
        if min(p[1], q[1]) > 6.1:
            on = p + np.linspace(0.0, 1.0, 20)[:, None] * (q - p)
            assert np.abs(np.linalg.norm(on - [30.0, 6.0], axis=1) - 30.0).max() < 0.31


def test_times_and_limits_are_those_of_the_map(exported: Exporter) -> None:
    slow = [replace(one, speed_limit_kmh=6.0) if one.start.startswith("t2") else one for one in ladder().connections]
    graph = loaded(exported("nav2-route", ".geojson", replace(ladder(), connections=tuple(slow))))
    t2 = [data for _, _, data in graph.edges(data=True) if data["within"] == "T2"]
    assert {data["speed_limit"] for data in t2} == {50.0}  # per cent
    assert {round(data["abs_speed_limit"], 6) for data in t2} == {round(6.0 / 3.6, 6)}
    assert sum(data["abs_time_taken"] for data in t2) == pytest.approx(2.0 * 108.0 / (6.0 / 3.6), rel=1e-4)


@pytest.mark.parametrize("how", ["closed tunnel", "closed way", "not feasible"])
def test_what_cannot_be_driven_is_left_out(exported: Exporter, how: str) -> None:
    topology = ladder()
    if how == "closed tunnel":
        topology = replace(topology, tunnels=(replace(topology.tunnels[0], closed=True), *topology.tunnels[1:]))
    else:
        change: dict[str, Any] = {"closed": True} if how == "closed way" else {"feasible": False}
        first, *rest = topology.connections
        topology = replace(topology, connections=(replace(first, **change), *rest))
    graph = loaded(exported("nav2-route", ".geojson", topology))
    assert "T1" not in {data["within"] for _, _, data in graph.edges(data=True)}
    assert driven_m(graph, "t1.start", "t1.end") == pytest.approx(2 * np.hypot(6.0, 6.0) + DETOUR_M)


def test_ways_that_differ_in_front_and_back_are_one(exported: Exporter) -> None:
    twice = replace(ladder().connections[0], kind="front_front")
    topology = replace(ladder(), connections=(*ladder().connections, twice))
    assert loaded(exported("nav2-route", ".geojson", topology)).number_of_edges() == 18


def test_a_graph_that_nav2_would_refuse_is_not_written(exported: Exporter, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no connection that can be driven"):
        exported("nav2-route", ".geojson", TopologicalMap())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine_map"]


def test_in_the_grid_where_that_is_asked_for(exported: Exporter) -> None:
    graph = loaded(exported("nav2-route", ".geojson", grid=True))
    assert {frame for _, frame in graph.nodes(data="frame")} == {"mine_grid"}
    wanted = in_grid(np.array([[0.0, -26.0, 0.0]]))[0]
    np.testing.assert_allclose(graph.nodes[named(graph, "DP1")]["at"], wanted[:2], atol=5e-4)

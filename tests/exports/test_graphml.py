"""GraphML, read with networkx."""

from __future__ import annotations

from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from lhdmap.topology.model import Connection

from tests.exports.conftest import Exporter
from tests.exports.folders import in_grid
from tests.topology.maps import ladder, straight


def test_networkx_reads_places_and_ways(exported: Exporter) -> None:
    graph = nx.read_graphml(exported("graphml", ".graphml"))
    assert not graph.is_directed()
    assert graph.graph["frame"] == "map"
    assert len(graph) == 6
    assert graph.number_of_edges() == 7
    dp = graph.nodes["w1"]
    assert (dp["name"], dp["kind"], dp["within"]) == ("DP1", "draw_point", "t3")
    assert (dp["x_m"], dp["y_m"], dp["z_m"], dp["heading_deg"]) == (0.0, -26.0, 0.0, -90.0)
    along = nx.shortest_path_length(graph, "w1", "i2.t1", weight="length_m")
    assert along == pytest.approx(20.0 + np.hypot(6.0, 6.0) + 48.0, abs=2e-3)
    for _, _, way in graph.edges(data=True):
        assert way["feasible"] is True
        assert way["time_s"] == pytest.approx(way["length_m"] / (12.0 / 3.6), abs=1e-3)
        assert "min_radius_m" not in way  # straight


def test_parallel_ways_stay_apart(exported: Exporter) -> None:
    """A second tunnel between the same two places: a multigraph."""
    topology = ladder()
    points = topology.points
    line = straight(points["t1.start"].pose, points["t1.end"].pose)
    second = Connection("t1.start", "t1.end", "front_front", line, 50.0, min_radius_m=8.5, closed=True)
    topology = replace(topology, connections=(*topology.connections, second))
    graph = nx.read_graphml(exported("graphml", ".graphml", topology), force_multigraph=True)
    ways = list(graph.get_edge_data("i1.t1", "i2.t1").values())
    assert sorted(way["length_m"] for way in ways) == [48.0, 50.0]
    assert [way["drivable"] for way in sorted(ways, key=lambda way: way["length_m"])] == [True, False]
    assert ways[1]["min_radius_m"] == 8.5


def test_in_the_grid(exported: Exporter) -> None:
    graph = nx.read_graphml(exported("graphml", ".graphml", grid=True))
    assert graph.graph["frame"] == "mine_grid"
    dp = graph.nodes["w1"]
    np.testing.assert_allclose([dp["x_m"], dp["y_m"], dp["z_m"]], in_grid(np.array([[0.0, -26.0, 0.0]]))[0], atol=5e-4)


@pytest.mark.parametrize("name", ['Förderort <1> & "2"', "a\x01b\x1f"])
def test_any_name_makes_a_file_that_can_be_read(exported: Exporter, name: str) -> None:
    (waypoint,) = ladder().waypoints
    graph = nx.read_graphml(
        exported("graphml", ".graphml", replace(ladder(), waypoints=(replace(waypoint, name=name),)))
    )
    printable = "".join(c for c in name if c.isprintable())
    assert [part for part in graph.nodes["w1"]["name"] if part in printable]

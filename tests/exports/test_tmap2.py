"""The map of LCAS topological_navigation: all fields that its map server and planner read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.topology.model import TopologicalMap
from ruamel.yaml import YAML

from tests.exports.conftest import Exporter
from tests.exports.folders import in_grid
from tests.topology.maps import ladder, pose

NODE = {
    "name": str, "parent_frame": str, "localise_by_topic": str, "pose": dict, "properties": dict, "verts": list,
    "restrictions_planning": str, "restrictions_runtime": str, "edges": list,
}  # fmt: skip
EDGE = {
    "edge_id": str, "node": str, "action": str, "action_type": str, "config": list, "fail_policy": str,
    "fluid_navigation": bool, "goal": dict, "recovery_behaviours_config": str, "restrictions_planning": str,
    "restrictions_runtime": str,
}  # fmt: skip


def loaded(file: Path) -> dict[str, Any]:
    table: dict[str, Any] = YAML(typ="safe").load(file.read_text(encoding="utf-8"))
    assert {"meta", "metric_map", "name", "pointset", "transformation", "nodes"} <= table.keys()
    assert {"parent", "child", "translation", "rotation"} == table["transformation"].keys()
    names = [entry["node"]["name"] for entry in table["nodes"]]
    assert len(set(names)) == len(names)
    edge_ids = [edge["edge_id"] for entry in table["nodes"] for edge in entry["node"]["edges"]]
    assert len(set(edge_ids)) == len(edge_ids)
    for entry in table["nodes"]:
        assert {"map", "node", "pointset"} <= entry["meta"].keys()
        typed(entry["node"], NODE)
        for edge in entry["node"]["edges"]:
            typed(edge, EDGE)
            assert edge["node"] in names
            assert edge["goal"]["target_pose"]["pose"] == "$node.pose"
    return table


def typed(table: dict[str, Any], wanted: Mapping[str, type]) -> None:
    assert wanted.keys() <= table.keys()
    assert all(isinstance(table[key], kind) for key, kind in wanted.items())


def test_its_readers_find_all_they_ask_for(exported: Exporter) -> None:
    table = loaded(exported("tmap2", ".tmap2"))
    assert len(table["nodes"]) == 6
    graph = nx.DiGraph(
        [(entry["node"]["name"], edge["node"]) for entry in table["nodes"] for edge in entry["node"]["edges"]]
    )
    assert graph.number_of_edges() == 14
    assert nx.shortest_path(graph, "DP1", "i2.t1") == ["DP1", "i1.t3", "i1.t1", "i2.t1"]
    dp = next(entry["node"] for entry in table["nodes"] if entry["node"]["name"] == "DP1")
    assert dp["pose"]["position"] == {"x": 0.0, "y": -26.0, "z": 0.0}
    quaternion = [dp["pose"]["orientation"][key] for key in "xyzw"]
    np.testing.assert_allclose(quaternion, [0.0, 0.0, -np.sqrt(0.5), np.sqrt(0.5)], atol=1e-9)
    assert dp["properties"]["yaw_goal_tolerance"] < 0.2  # at a draw point the heading counts


def test_in_the_grid(exported: Exporter) -> None:
    table = loaded(exported("tmap2", ".yaml", grid=True))
    dp = next(entry["node"] for entry in table["nodes"] if entry["node"]["name"] == "DP1")
    wanted = in_grid(np.array([[0.0, -26.0, 0.0]]))[0]
    np.testing.assert_allclose([dp["pose"]["position"][key] for key in "xyz"], wanted, atol=5e-4)
    assert dp["parent_frame"] == "mine_grid"


def test_a_map_without_a_way_is_refused(exported: Exporter) -> None:
    with pytest.raises(InputError, match="no connection"):
        exported("tmap2", ".tmap2", TopologicalMap())


def test_places_of_one_name_are_told_apart(exported: Exporter) -> None:
    topology = ladder()
    twice = replace(topology.waypoints[0], id="w2", pose=pose(0.0, -20.0, -90.0))
    table = loaded(exported("tmap2", ".tmap2", replace(topology, waypoints=(*topology.waypoints, twice))))
    assert {"DP1_w1", "DP1_w2"} <= {entry["node"]["name"] for entry in table["nodes"]}

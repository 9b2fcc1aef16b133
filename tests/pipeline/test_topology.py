"""`build-map` on a teaching drive through a small mine: the graph, its names and its landmarks, from the log alone."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from lhdmap.config import settings_from
from lhdmap.errors import ConfigError, InputError
from lhdmap.landmarks.store import read_landmarks
from lhdmap.machine import Machine
from lhdmap.movement.routes import route
from lhdmap.pipeline.build import BuildRequest, build_map
from lhdmap.simulation.mine_drive import MineDriveSettings, SimulatedMineDrive, simulate_mine
from lhdmap.simulation.sensing.sections import ScannerSettings, SensorSettings
from lhdmap.topology.files import read_topology
from lhdmap.topology.model import TopologicalMap

from tests.mine.plans import TEE, network_of

SETTINGS = settings_from({"pile.method": "off", "recording.scan_interval_s": 5.0})
DRAW_POINT = {"drift": "B", "at_m": 50.0, "kind": "draw_point", "side": "end", "name": "DP1"}


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> SimulatedMineDrive:
    network = network_of(TEE, place=[DRAW_POINT], seed=4)
    sensors = SensorSettings(scanner=ScannerSettings(rate_hz=10.0))
    settings = MineDriveSettings(seed=1, names=True, sensors=sensors)
    return simulate_mine(network, Machine(), settings, tmp_path_factory.mktemp("mine") / "tee.mcap")


@pytest.fixture(scope="module")
def folder(drive: SimulatedMineDrive) -> Path:
    return build_map(BuildRequest([drive.log], drive.log.with_name("map"), SETTINGS)).folder


@pytest.fixture(scope="module")
def topology(folder: Path) -> TopologicalMap:
    return read_topology(folder)


def test_the_graph_is_that_of_the_plan(drive: SimulatedMineDrive, topology: TopologicalMap) -> None:
    truth = json.loads(drive.topology_file.read_text())
    assert [(node.name, node.degree) for node in topology.intersections] == [
        (node["name"], node["degree"]) for node in truth["intersections"]
    ]
    assert len(topology.tunnels) == len(truth["tunnels"])
    ends = sorted(tuple(sorted(tunnel.ends)) for tunnel in topology.tunnels)
    assert ends == [("dead_end", "i1")] * 3


def test_places_of_the_operator_are_waypoints(topology: TopologicalMap) -> None:
    found = next(one for one in topology.waypoints if one.name == "DP1")
    assert found.purpose == "draw_point"
    node = next(tunnel for tunnel in topology.tunnels if tunnel.id == found.node)
    assert node.name.startswith("B")


def test_access_points_are_twins_at_one_place(topology: TopologicalMap) -> None:
    points = topology.points
    for one in topology.access_points:
        assert one.joins is not None
        twin = points[one.joins]
        assert math.dist(one.pose[:3], twin.pose[:3]) < 0.01
        assert abs(math.remainder(one.pose[3] - twin.pose[3] - math.pi, 2 * math.pi)) < 1e-3


def test_a_machine_can_be_sent_from_end_to_end(topology: TopologicalMap) -> None:
    stops = [one.name for one in topology.waypoints]
    for goal in stops[1:]:
        assert route(topology, stops[0], goal).feasible


def test_each_node_has_landmarks_and_walls(folder: Path, topology: TopologicalMap) -> None:
    landmarks = read_landmarks(folder / "landmarks.npz")
    assert set(topology.nodes) == set(landmarks.node.tolist())
    for tunnel in topology.tunnels:
        rows = landmarks.of(tunnel.id)
        assert np.median(np.diff(landmarks.at_m[rows])) == pytest.approx(2.0, abs=0.6)
        assert landmarks.similarity[tunnel.id].shape == (len(rows), len(rows))
        assert len(landmarks.surfaces[tunnel.id].cells.points_m) > 20 * tunnel.length_m


def test_edits_are_respected_by_a_rebuild(drive: SimulatedMineDrive, topology: TopologicalMap, tmp_path: Path) -> None:
    tunnel = topology.tunnels[0]
    x, y = tunnel.line_m[len(tunnel.line_m) // 2, :2].round(2).tolist()
    edits = tmp_path / "edits.toml"
    edits.write_text(f'[[rename]]\nat_m = [{x}, {y}]\nname = "Main"\n\n[[close]]\nat_m = [{x}, {y}]\n')
    built = build_map(BuildRequest([drive.log], tmp_path / "map", SETTINGS, edits=edits))
    again = read_topology(built.folder)
    closed = [one for one in again.tunnels if one.closed]
    assert [one.name for one in closed] == ["Main"]
    edits.write_text('[[close]]\nnode = "nowhere"\n')
    with pytest.raises(ConfigError, match="nowhere"):
        build_map(BuildRequest([drive.log], tmp_path / "other", SETTINGS, edits=edits))


def test_topology_is_left_out_where_it_is_not_wanted(drive: SimulatedMineDrive, tmp_path: Path) -> None:
    off = settings_from({"pile.method": "off", "topology.method": "off"})
    built = build_map(BuildRequest([drive.log], tmp_path / "off", off))
    assert not (built.folder / "topology.geojson").exists()
    assert built.summary["topology"] is None


def test_edits_that_are_not_there_are_told_before_the_log_is_read(drive: SimulatedMineDrive, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.toml"):
        build_map(BuildRequest([drive.log], tmp_path / "map", SETTINGS, edits=tmp_path / "none.toml"))
    assert not list(tmp_path.iterdir())

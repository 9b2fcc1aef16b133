"""The topology in the Rerun recording, read back: every part with its name and place, and a view of its own."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lhdmap.machine import Machine
from lhdmap.movement.routes import route
from lhdmap.report.data import ClosureRow
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.recording_layout import blueprint
from lhdmap.report.route_legs import legs_of
from lhdmap.report.run_recording import record_run
from lhdmap.report.topology_recording import write_topology_recording
from lhdmap.topology.model import TopologicalMap

from tests.report.synthetic import START_NS, report_data
from tests.report.test_recording import column, read
from tests.report.topologies import board, told
from tests.topology.maps import ladder

CLOSURE = ClosureRow(np.array([0.0, 0.0, 0.0]), np.array([1.5, 0.5, 0.0]), True, 0.031, 2.5e4)


def test_a_run_with_a_topology_has_all_parts_of_it(tmp_path: Path) -> None:
    data = replace(report_data(scans=300, points=100), topology=told(), closures=[CLOSURE])
    with RecordingWriter(tmp_path / "r.rrd", "drive", START_NS) as writer:
        record_run(writer, data, Machine())
    found = read(tmp_path / "r.rrd")
    tunnels = {
        kind: column(found[f"map/topology/tunnels/{kind}"], ":labels")[0] for kind in ("driven", "seen", "closed")
    }
    assert tunnels == {"driven": ["T3"], "seen": ["T2"], "closed": ["T1"]}
    assert column(found["map/topology/intersections"], ":labels")[0] == ["I1", "I2"]
    assert column(found["map/topology/waypoints/draw_point"], ":labels")[0] == ["DP1"]
    assert column(found["map/topology/access_points"], ":labels")[0] == [one.id for one in told().access_points]
    assert len(column(found["map/topology/connections/infeasible"], ":strips")[0]) == 1
    assert len(column(found["map/topology/connections/closed"], ":strips")[0]) == 1
    assert len(column(found["map/topology/connections/feasible"], ":strips")[0]) == len(told().connections) - 2
    (closure,) = column(found["map/topology/closures/accepted"], ":strips")[0]
    assert np.array(closure)[:, :2] == pytest.approx(np.array([[0.0, 0.0], [1.5, 0.5]]))
    assert "map/topology/closures/refused" not in found
    (legend,) = column(found["legend"], ":text")[0]
    for words in ("tunnel, only seen", "intersection", "connection, infeasible", "loop closure, accepted"):
        assert words in legend


def test_lines_and_arrows_are_where_the_map_has_them(tmp_path: Path) -> None:
    write_topology_recording(tmp_path / "t.rrd", "map", ladder())
    found = read(tmp_path / "t.rrd")
    strips = column(found["map/topology/tunnels/driven"], ":strips")[0]
    for strip, tunnel in zip(strips, ladder().tunnels, strict=True):
        assert np.array(strip)[:, :2] == pytest.approx(tunnel.line_m[:, :2], abs=1e-4)
        assert (np.array(strip)[:, 2] > tunnel.line_m[:, 2]).all()  # over the floor
    arrows = np.array(column(found["map/topology/access_points"], ":vectors")[0])
    yaw = np.array([one.pose[3] for one in ladder().access_points])
    lengths = np.linalg.norm(arrows, axis=1)
    assert arrows[:, 0] / lengths == pytest.approx(np.cos(yaw), abs=1e-5)
    assert arrows[:, 1] / lengths == pytest.approx(np.sin(yaw), abs=1e-5)
    assert lengths.max() < 4.5  # of a tunnel's width
    ring = np.array(column(found["map/topology/intersections"], ":strips")[0][0])
    assert ring[0] == pytest.approx(ring[-1])


def test_an_empty_topology_is_no_topology(tmp_path: Path) -> None:
    data = replace(report_data(scans=300, points=100), topology=TopologicalMap())
    with RecordingWriter(tmp_path / "r.rrd", "drive", START_NS) as writer:
        record_run(writer, data, Machine())
        assert not writer.layout.has_topology
    assert not [name for name in read(tmp_path / "r.rrd") if name.startswith("map/topology")]


def test_the_layout_has_a_view_of_the_topology_where_there_is_one() -> None:
    bounds = np.array([[0.0, 0.0, 0.0], [50.0, 30.0, 4.0]])

    def views(topology: bool) -> list[str]:
        found, waiting = [], [blueprint(bounds, 1, (), topology=topology).root_container]
        while waiting:
            one = waiting.pop(0)
            waiting += list(getattr(one, "contents", None) or []) if hasattr(one, "row_shares") else []
            found.append(str(getattr(one, "name", "")))
        return found

    assert "Topology" in views(True)
    assert "Topology" not in views(False)


def test_a_route_is_recorded_by_gear(tmp_path: Path) -> None:
    found = route(ladder(), "DP1", "T2")
    write_topology_recording(tmp_path / "t.rrd", "route", ladder(), found.states)
    recorded = read(tmp_path / "t.rrd")
    gears = {name.removeprefix("map/route/") for name in recorded if name.startswith("map/route/")} - {
        "ends",
        "inversions",
    }
    assert gears == {leg.gear for leg in legs_of(ladder(), found.states)}
    assert column(recorded["map/route/ends"], ":labels")[0][0] == "start DP1"
    assert ("map/route/inversions" in recorded) == (found.inversions > 0)


@pytest.mark.parametrize(("start", "goal"), [("DP1", "T2"), ("T1", "DP1"), ("i1.t2", "i2.t1")])
def test_the_legs_of_a_route_are_as_long_as_the_route_and_hang_together(start: str, goal: str) -> None:
    topology = ladder()
    found = route(topology, start, goal)
    legs = legs_of(topology, found.states)
    length = sum(float(np.linalg.norm(np.diff(leg.line_m, axis=0), axis=1).sum()) for leg in legs)
    assert length == pytest.approx(found.distance_m, abs=0.5)
    for leg, following in itertools.pairwise(legs):
        assert leg.line_m[-1] == pytest.approx(following.line_m[0], abs=1e-6)
        assert leg.gear != following.gear
    first, last = (topology.points[found.states[k].point].pose[:3] for k in (0, -1))
    assert legs[0].line_m[0] == pytest.approx(first)
    assert legs[-1].line_m[-1] == pytest.approx(last)


def test_a_large_mine_is_recorded_in_few_entities(tmp_path: Path) -> None:
    write_topology_recording(tmp_path / "t.rrd", "map", board(20, 20))
    assert len([name for name in read(tmp_path / "t.rrd") if name.startswith("map/topology")]) < 12
    assert (tmp_path / "t.rrd").stat().st_size < 1_000_000

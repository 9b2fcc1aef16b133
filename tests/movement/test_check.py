"""check-map finds each fault that is made in a sound map, and nothing in the sound one."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lhdmap.cli.main import main
from lhdmap.errors import InputError
from lhdmap.mapfolder import MapFolderWriter
from lhdmap.movement.check import check_map, topology_findings
from lhdmap.movement.settings import MovementSettings
from lhdmap.runfolder import RunInfo
from lhdmap.topology.geojson import to_geojson
from lhdmap.topology.model import AccessPoint, TopologicalMap, Tunnel, Waypoint

from tests.movement.mines import with_connection
from tests.topology.maps import ladder, pose

Change = Callable[[TopologicalMap], TopologicalMap]


def tunnel(name: str, **changes: object) -> Change:
    def change(topology: TopologicalMap) -> TopologicalMap:
        tunnels = (replace(one, **changes) if one.id == name else one for one in topology.tunnels)  # type: ignore[arg-type]
        return replace(topology, tunnels=tuple(tunnels))

    return change


def access(name: str, **changes: object) -> Change:
    def change(topology: TopologicalMap) -> TopologicalMap:
        points = (replace(one, **changes) if one.id == name else one for one in topology.access_points)  # type: ignore[arg-type]
        return replace(topology, access_points=tuple(points))

    return change


def connected(start: str, end: str, /, **changes: object) -> Change:
    return lambda topology: with_connection(topology, start, end, **changes)


def limited(topology: TopologicalMap) -> TopologicalMap:
    return replace(topology, waypoints=(replace(topology.waypoints[0], speed_limit_kmh=20.0),))


def stub(topology: TopologicalMap) -> TopologicalMap:
    """T3 is 8 m long, and nothing is done in it."""
    passed = replace(topology, waypoints=(replace(topology.waypoints[0], purpose="pass"),))
    return tunnel("t3", line_m=np.array([[0.0, -6.0, 0.0], [0.0, -14.0, 0.0]]))(passed)


def lone(topology: TopologicalMap) -> TopologicalMap:
    """A tunnel that nothing joins."""
    line = np.array([[0.0, 200.0, 0.0], [40.0, 200.0, 0.0]])
    extra = Tunnel("t9", "T9", ("dead_end", "dead_end"), line, np.full((2, 2), 2.25), pose(0.0, 200.0, 0.0))
    ends = [AccessPoint("t9.a", "t9", pose(0.0, 200.0, 180.0)), AccessPoint("t9.b", "t9", pose(40.0, 200.0, 0.0))]
    return replace(topology, tunnels=(*topology.tunnels, extra), access_points=(*topology.access_points, *ends))


def test_a_sound_map_has_no_findings() -> None:
    assert list(topology_findings(ladder())) == []


@pytest.mark.parametrize(
    ("change", "severity", "rule", "where", "told"),
    [
        (access("i1.t1", pose=pose(6.0, 0.6, 0.0)), "error", "twin", "i1.t1:t1.start", "0.60 m apart"),
        (access("i1.t1", pose=pose(6.0, 0.0, 15.0)), "error", "twin", "i1.t1:t1.start", "15.0° off"),
        (access("i1.t1", joins="t1.end"), "error", "twin", "i1.t1", "joins t1.end, which joins i2.t1"),
        (access("i1.t1", joins="t7.end"), "error", "twin", "i1.t1", "no access point"),
        (access("i1.t1", node="i9"), "error", "twin", "i1.t1", "no node"),
        (limited, "warning", "limit", "DP1", "above the 12 km/h of T3"),
        (tunnel("t1", speed_limit_kmh=40.0), "warning", "limit", "T1", "above the machine's 24"),
        (tunnel("t1", speed_limit_kmh=0.0), "error", "limit", "T1", "lets nothing pass"),
        (tunnel("t2", half_widths_m=np.full((4, 2), 1.4)), "warning", "narrow", "T2", "2.80 m wide"),
        (tunnel("t2", half_widths_m=np.full((4, 2), 1.2)), "error", "narrow", "T2", "2.40 m wide"),
        (connected("i1.t1", "i1.t2", clearance_m=0.1), "warning", "narrow", "i1.t1:i1.t2", "0.10 m of room"),
        (tunnel("t3", ends=("i1", "unexplored")), "note", "unexplored", "T3", "not driven"),
        (tunnel("t3", ends=("i7", "dead_end")), "error", "ends", "T3", "'i7'"),
        (tunnel("t1", not_distinctive_m=((5.0, 30.0),)), "warning", "distinctive", "T1", "25 m of 48 m"),
        (tunnel("t2", closed=True), "note", "closed", "T2", "closed"),
        (connected("i1.t1", "i1.t2", closed=True), "note", "closed", "i1.t1:i1.t2", "closed"),
        (connected("t1.start", "t1.end", feasible=False), "warning", "infeasible", "t1.start:t1.end", "cannot"),
        (connected("t1.start", "t1.end", length_m=float("nan")), "error", "connection", "t1.start:t1.end", "nan m"),
        (connected("t1.start", "t1.end", end="t1.x"), "error", "connection", "t1.start:t1.x", "'t1.x'"),
        (connected("i1.t1", "i1.t2", feasible=False), "note", "infeasible", "i1.t1:i1.t2", "an inversion at i1.t3"),
        (connected("i2.t1", "i2.t2", feasible=False), "warning", "inversion", "i2.t1:i2.t2", "no inversion at I2"),
        (connected("t3.start", "w1", feasible=False), "error", "reach", "T3", ""),
        (lone, "error", "reach", "T9", "nothing joins it"),
        (stub, "warning", "inversion", "T3", "8.0 m"),
    ],
)
def test_each_fault_is_found(change: Change, severity: str, rule: str, where: str, told: str) -> None:
    findings = list(topology_findings(change(ladder())))
    if (rule, where) == ("reach", "T3"):  # its access point is reached, its draw point is not
        findings = [one for one in findings if one.rule in ("reach", "infeasible", "place")]
        assert [(one.rule, one.where) for one in findings] == [("infeasible", "t3.start:w1"), ("reach", "DP1")]
        return
    match = [one for one in findings if (one.severity, one.rule, one.where) == (severity, rule, where)]
    assert match, findings
    assert told in match[0].text


def test_what_is_in_the_way_to_a_node_is_told() -> None:
    shut = connected("i1.t1", "i1.t3", closed=True)(connected("i1.t2", "i1.t3", closed=True)(ladder()))
    found = [one for one in topology_findings(shut) if one.rule == "reach"]
    assert [one.where for one in found] == ["T3"]
    assert "(closed)" in found[0].text


def test_a_dump_that_cannot_be_reached_bucket_first_is_found() -> None:
    """T1 alone with a dead end at either side: who loads at one end bucket first dumps at the other in reverse."""
    line = np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]])
    kept = ("t3", "i1")
    topology = ladder()
    other = Tunnel("t1", "T1", ("i1", "dead_end"), line, np.full((2, 2), 2.25), pose(6.0, 0.0, 0.0))
    dump = Waypoint("w2", "OP1", "t1", pose(50.0, 0.0, 0.0), "dump")
    points = tuple(one for one in topology.access_points if one.node in kept or one.id == "t1.start")
    points = tuple(one for one in points if one.id != "i1.t2")
    ways = [one for one in topology.connections if (one.start, one.end) in (("t3.start", "w1"), ("i1.t1", "i1.t3"))]
    template = next(one for one in topology.connections if one.start == "t1.start")
    ways.append(replace(template, end="w2", length_m=44.0))
    straight = TopologicalMap(
        (other, *(one for one in topology.tunnels if one.id == "t3")),
        topology.intersections[:1],
        points,
        (*topology.waypoints, dump),
        tuple(ways),
    )
    found = {(one.severity, one.rule, one.where) for one in topology_findings(straight)}
    assert ("error", "inversion", "OP1") in found
    assert any(rule == "heading" for _, rule, _ in found)
    bay = replace(straight, waypoints=(replace(straight.waypoints[0], purpose="draw_point"), dump))
    turning = Waypoint("w3", "TB", "t3", pose(0.0, -26.0, -90.0), "turning_bay")
    link = replace(ways[0], start="w1", end="w3", kind="front_back", length_m=1.0)
    bay = replace(bay, waypoints=(*bay.waypoints, turning), connections=(*bay.connections, link))
    assert not [one for one in topology_findings(bay) if one.rule in ("inversion", "heading")]


def test_settings_say_what_is_wanted() -> None:
    wide = MovementSettings(room_m=1.1)
    assert {one.rule for one in topology_findings(ladder(), wide)} == {"narrow"}
    apart = access("i1.t1", pose=pose(6.0, 0.6, 3.0))(ladder())
    assert not list(topology_findings(apart, MovementSettings(twin_m=0.7)))
    assert len(list(topology_findings(apart, MovementSettings(twin_deg=2.0)))) == 2


def test_a_closed_tunnel_is_no_fault_of_the_map() -> None:
    found = [(one.severity, one.rule) for one in topology_findings(tunnel("t2", closed=True)(ladder()))]
    assert found == [("note", "closed"), ("note", "heading")]  # without the ring nothing turns the machine


def test_parallel_connections_are_no_fault() -> None:
    topology = connected("i1.t1", "i1.t3", closed=True)(connected("i1.t2", "i1.t3", closed=True)(ladder()))
    twice = replace(topology, connections=(*topology.connections, *topology.connections))
    once = list(topology_findings(topology))
    assert any(one.rule == "reach" for one in once)
    assert {(one.rule, one.where) for one in topology_findings(twice)} == {(one.rule, one.where) for one in once}


def test_the_machine_is_that_of_the_file_or_of_the_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wide = tmp_path / "wide.toml"
    wide.write_text('name = "wide"\n[dimensions]\nwidth_m = 4.2\nlength_m = 30.0\n', encoding="utf-8")
    path = str(map_folder(tmp_path / "map"))
    assert main(["check-map", path, "--machine", str(wide)]) == 0
    text = capsys.readouterr().out
    assert "narrow       T1: 4.50 m wide" in text
    assert text.startswith("ready: 0 errors, 3 warnings")
    with MapFolderWriter(tmp_path / "other") as folder:
        folder.write_json("topology.geojson", to_geojson(ladder()))
        folder.complete(RunInfo(options={"request": {"machine": "wide"}}))
    assert [one.rule for one in check_map(tmp_path / "other").findings] == ["machine", "landmarks"]


def test_an_empty_map_is_not_ready() -> None:
    assert [one.rule for one in topology_findings(TopologicalMap())] == ["reach"]


def map_folder(path: Path, warnings: tuple[str, ...] = (), **landmarks: object) -> Path:
    with MapFolderWriter(path) as folder:
        folder.write_json("topology.geojson", to_geojson(ladder()))
        if landmarks:
            np.savez(folder.path / "landmarks.npz", **landmarks)  # type: ignore[arg-type]
        folder.complete(RunInfo(warnings=warnings))
    return path


NODES = np.array(["t1", "t1", "t2", "t3", "i1", "i2"])


def test_a_folder_that_is_as_it_was_written_is_ready(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = map_folder(tmp_path / "map", node=NODES, key=np.ones(6, bool), radius=np.full(6, 4.0))
    assert check_map(path).findings == ()
    assert main(["check-map", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "ready": True,
        "errors": 0,
        "warnings": 0,
        "notes": 0,
        "findings": [],
    }


def test_landmarks_that_are_orphans_or_ambiguous_are_found(tmp_path: Path) -> None:
    nodes = np.where(NODES == "t2", "t8", NODES)
    key = np.array([True, True, True, False, True, True])
    radius = np.array([4.0, 0.0, 4.0, 0.0, 4.0, 4.0])
    verdict = check_map(map_folder(tmp_path / "map", node=nodes, key=key, radius=radius))
    found = [(one.severity, one.where, one.text) for one in verdict.findings]
    assert [(severity, where) for severity, where, _ in found] == [
        ("error", "t8"),
        ("warning", "T1"),
        ("warning", "T2"),
        ("warning", "T3"),
    ]
    assert "radius 0" in found[1][2]
    assert "no landmark" in found[2][2]
    assert "no key" in found[3][2]


def test_a_planar_drive_and_missing_landmarks_are_told(tmp_path: Path) -> None:
    said = "no inclinometer in the log: the drive is treated as planar, heights are not observed"
    verdict = check_map(map_folder(tmp_path / "map", (said,)))
    assert [(one.severity, one.rule) for one in verdict.findings] == [("warning", "height"), ("note", "landmarks")]
    assert verdict.ready


def test_a_map_that_was_changed_is_not_ready(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = map_folder(tmp_path / "map")
    file = path / "topology.geojson"
    table = json.loads(file.read_text(encoding="utf-8"))
    table["features"][0]["properties"]["speed_limit_kmh"] = 3.0
    file.write_text(json.dumps(table), encoding="utf-8")
    assert main(["check-map", str(path), "--json"]) == 1
    values = json.loads(capsys.readouterr().out)
    assert not values["ready"]
    assert {(one["rule"], one["where"]) for one in values["findings"] if one["severity"] == "error"} == {
        ("hash", "topology.geojson"),
        ("hash", "topology"),
    }
    assert values["error"]["exit_code"] == 1


def test_what_is_no_map_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, text in (("a.geojson", "{"), ("b.geojson", "{}"), ("c.geojson", "")):
        (tmp_path / name).write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=name):
            check_map(tmp_path / name)
    assert main(["check-map", str(tmp_path)]) == 3
    assert main(["route", str(tmp_path / "none"), "A", "B"]) == 3
    (tmp_path / "landmarks.npz").write_bytes(b"PK")
    path = map_folder(tmp_path / "map", node=NODES, key=np.ones(2, bool), radius=np.ones(6))
    with pytest.raises(InputError, match="2 keys"):
        check_map(path)
    capsys.readouterr()


def test_route_says_it_in_words_and_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(map_folder(tmp_path / "map"))
    assert main(["route", path, "DP1", "T2", "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    wanted = {"feasible", "reason", "distance_m", "time_s", "inversions", "states", "blocked_by"}
    assert wanted <= set(values)
    assert {"point", "state", "node", "gear", "stop", "at_m", "at_s"} <= set(values["states"][0])
    assert main(["route", path, "DP1", "T2", "--heading", "along"]) == 0
    text = capsys.readouterr().out
    assert "32.0 m" in text
    assert "(iv)" in text
    assert main(["route", path, "DP1", "T2", "--avoid", "I1"]) == 1
    assert "no route" in capsys.readouterr().out
    assert main(["route", path, "DP9", "T2"]) == 2
    assert "did you mean 'DP1'" in capsys.readouterr().err

"""Sections of topological maps, and what check-map says of them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from lhdmap.cli.main import main
from lhdmap.topology.geojson import to_geojson
from lhdmap.topology.model import TopologicalMap, Waypoint
from lhdmap.traffic.advice import throughput, traffic_findings
from lhdmap.traffic.of_map import Extra, sections_of_map

from tests.haulage.plans import map_of_plan
from tests.topology.maps import ladder, pose


@pytest.fixture(scope="module")
def level() -> TopologicalMap:
    return map_of_plan("level")


def test_sections_are_intersections_and_pieces_of_tunnels() -> None:
    made = sections_of_map(ladder(), section_m=50.0)
    lengths = {one.name: one.length_m for one in made.map.sections}
    assert lengths["T1"] == pytest.approx(48.0)
    assert lengths["T2#1"] == lengths["T2#2"] == pytest.approx(54.0)
    assert made.places == {"DP1": "T3"}
    assert set(made.map.following["I1"]) == {"T1", "T2#1", "T3"}
    assert set(made.map.following["T2#1"]) == {"I1", "T2#2"}
    assert set(made.map.following["T3"]) == {"I1"}


def test_a_passing_bay_is_a_section_beside_its_piece() -> None:
    topology = ladder()
    bay = Waypoint("w2", "B1", "t2", pose(30.0, 30.0, 0.0), "passing_bay")
    made = sections_of_map(replace(topology, waypoints=(*topology.waypoints, bay)))
    section = made.map.section["B1"]
    assert section.bay
    pieces = [one for one in made.map.sections if one.name.startswith("T2#")]
    beside = [one.name for one in pieces if "B1" in made.map.following[one.name]]
    assert len(beside) == 2
    middle = next(one.name for one in pieces if set(beside) <= set(made.map.following[one.name]))
    assert middle not in made.map.following["B1"]


def test_a_closed_tunnel_has_no_section() -> None:
    topology = ladder()
    shut = replace(topology, tunnels=tuple(replace(one, closed=one.id == "t1") for one in topology.tunnels))
    assert "T1" not in sections_of_map(shut).map.section


def test_links_go_both_ways(level: TopologicalMap) -> None:
    links = set(sections_of_map(level).map.links)
    assert {(b, a) for a, b in links} == links


def test_a_pocket_pays_on_a_level_with_its_dump_at_a_dead_end(level: TopologicalMap) -> None:
    as_it_is = throughput(level, "OP1", 3)
    better = throughput(level, "OP1", 3, extra=Extra(pocket="OP1"))
    assert as_it_is is not None
    assert better is not None
    assert 1.0 < as_it_is.ratio < better.ratio < 3.0
    findings = list(traffic_findings(level))
    assert [one.where for one in findings] == ["OP1", "OP2"]
    assert all("a pocket in front of" in one.text for one in findings)


def test_a_map_with_one_draw_point_and_no_dump_has_nothing_to_say() -> None:
    assert list(traffic_findings(ladder())) == []


def test_check_map_tells_it(level: TopologicalMap, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "topology.geojson"
    file.write_text(json.dumps(to_geojson(level)), encoding="utf-8")
    main(["check-map", str(file), "--json"])
    found = json.loads(capsys.readouterr().out)["findings"]
    assert [one["where"] for one in found if one["rule"] == "traffic"] == ["OP1", "OP2"]
    main(["check-map", str(file), "--json", "--machines", "0"])
    assert not any(one["rule"] == "traffic" for one in json.loads(capsys.readouterr().out)["findings"])

"""GeoJSON by RFC 7946, in the map and in the grid, and what a registered map does with it."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.exports.export import ExportRequest, export
from lhdmap.topology.geojson import from_geojson, to_geojson

from tests.exports.conftest import Exporter
from tests.exports.folders import TURN_RAD, control_points, in_grid, map_folder, sloping_ladder
from tests.topology.maps import ladder

DEPTH = {"Point": 0, "LineString": 1, "Polygon": 2}


def loaded(file: Path) -> dict[str, Any]:
    """A feature collection, checked by RFC 7946, Sections 3.1 to 3.3."""
    table: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"), parse_constant=pytest.fail)
    assert table["type"] == "FeatureCollection"
    for feature in table["features"]:
        assert feature["type"] == "Feature"
        assert isinstance(feature["properties"], dict)
        geometry = feature["geometry"]
        shape = np.array(geometry["coordinates"][0] if geometry["type"] == "Polygon" else geometry["coordinates"])
        assert shape.shape[-1] == 3
        assert np.isfinite(shape).all()
        if geometry["type"] == "LineString":
            assert len(shape) >= 2
        if geometry["type"] == "Polygon":
            assert len(shape) >= 4
            assert (shape[0] == shape[-1]).all()
            near = shape - shape[0]
            assert np.sum(near[:-1, 0] * near[1:, 1] - near[1:, 0] * near[:-1, 1]) > 0.0  # counter-clockwise
    return table


def feature(table: dict[str, Any], kind: str, name: str) -> dict[str, Any]:
    return next(
        one for one in table["features"] if one["properties"]["kind"] == kind and name in one["properties"].values()
    )


def test_without_registration_it_is_the_map_s(exported: Exporter) -> None:
    table = loaded(exported("geojson", ".geojson"))
    assert table["lhdmap"]["frame"] == "map"
    assert table["lhdmap"]["registration"] is None
    assert to_geojson(from_geojson(table))["features"] == to_geojson(ladder())["features"]


def test_in_the_grid_all_is_moved_and_the_registration_is_in_it(exported: Exporter) -> None:
    table = loaded(exported("geojson", ".geojson", sloping_ladder(), grid=True))
    member = table["lhdmap"]["registration"]
    assert table["lhdmap"]["frame"] == member["frame"] == "mine_grid"
    assert member["rotation_deg"] == pytest.approx(np.degrees(TURN_RAD), abs=1e-3)
    assert [one["name"] for one in member["control_points"]] == ["A", "B", "C", "D"]
    line = feature(table, "tunnel", "T1")["geometry"]["coordinates"]
    np.testing.assert_allclose(line, in_grid(sloping_ladder().tunnels[0].line_m), atol=5e-4)
    dp = feature(table, "waypoint", "DP1")
    np.testing.assert_allclose(dp["geometry"]["coordinates"], in_grid(np.array([[0.0, -26.0, 0.0]]))[0], atol=5e-4)
    assert dp["properties"]["heading_deg"] == pytest.approx(np.degrees(TURN_RAD) - 90.0, abs=1e-3)
    assert dp["properties"]["azimuth_deg"] == pytest.approx(180.0 - np.degrees(TURN_RAD), abs=1e-3)
    frame = feature(table, "intersection", "I2")["properties"]["T_map_node"]
    np.testing.assert_allclose(frame[:3], in_grid(np.array([[60.0, 0.0, 0.0]]))[0], atol=5e-4)
    assert frame[3] == pytest.approx(TURN_RAD, abs=1e-5)
    assert from_geojson(table).tunnels[0].length_m == pytest.approx(sloping_ladder().tunnels[0].length_m, abs=2e-3)


def _registered(tmp_path: Path, *, frame: str) -> Path:
    """A map folder whose own topology.geojson has the registration, coordinates in `frame`."""
    folder = map_folder(tmp_path / "mine_map", sloping_ladder())
    points = control_points(tmp_path / "points.csv")
    export(ExportRequest(folder, "geojson", tmp_path / "registered.geojson", points, frame=frame))
    shutil.copy(tmp_path / "registered.geojson", folder / "topology.geojson")
    return folder


@pytest.mark.parametrize("frame", ["map", "mine_grid"])
def test_the_map_s_own_registration_is_used(tmp_path: Path, frame: str) -> None:
    folder = _registered(tmp_path, frame=frame)
    told = export(ExportRequest(folder, "geojson", tmp_path / "again.geojson"))
    assert told["frame"] == "mine_grid"
    assert told["registration"]["max_residual_m"] < 1e-3
    table = loaded(tmp_path / "again.geojson")
    line = feature(table, "tunnel", "T1")["geometry"]["coordinates"]
    np.testing.assert_allclose(line, in_grid(sloping_ladder().tunnels[0].line_m), atol=1e-3)
    export(ExportRequest(folder, "geojson", tmp_path / "map.geojson", frame="map"))
    line = feature(loaded(tmp_path / "map.geojson"), "tunnel", "T1")["geometry"]["coordinates"]
    np.testing.assert_allclose(line, sloping_ladder().tunnels[0].line_m, atol=5e-4)


@pytest.mark.parametrize(
    ("name", "frame"), [("nav2-route", "map"), ("occupancy", "map"), ("graphml", "mine_grid"), ("laz", "mine_grid")]
)
def test_formats_for_machines_stay_in_the_map(tmp_path: Path, name: str, frame: str) -> None:
    folder = _registered(tmp_path, frame="map")
    assert export(ExportRequest(folder, name))["frame"] == frame
    assert export(ExportRequest(folder, name, frame="mine_grid", force=True))["frame"] == "mine_grid"


def test_what_a_later_version_adds_is_kept(tmp_path: Path) -> None:
    folder = map_folder(tmp_path / "mine_map")
    table = to_geojson(ladder())
    table["features"][-1]["properties"] |= {"cost_s": 77.5, "dust": "high"}
    (folder / "topology.geojson").write_text(json.dumps(table), encoding="utf-8")
    export(ExportRequest(folder, "geojson", tmp_path / "out.geojson", control_points(tmp_path / "p.csv")))
    properties = loaded(tmp_path / "out.geojson")["features"][-1]["properties"]
    assert (properties["cost_s"], properties["dust"]) == (77.5, "high")


def test_an_intersection_without_an_outline(exported: Exporter) -> None:
    first, second = ladder().intersections
    topology = replace(ladder(), intersections=(replace(first, outline_m=np.zeros((0, 2))), second))
    table = json.loads(exported("geojson", ".geojson", topology, grid=True).read_text(encoding="utf-8"))
    assert feature(table, "intersection", "I1")["geometry"]["coordinates"] == []
    assert len(from_geojson(table).intersections[0].outline_m) == 0

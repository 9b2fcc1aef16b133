"""Exports opened by code that shares nothing with what wrote them: GDAL, rustworkx, a reader of E57 in Rust, LAS by its text."""

from __future__ import annotations

import importlib.util
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.messages import FloatArray

from tests.exports.conftest import Exporter
from tests.exports.folders import cloud, in_grid, sloping_ladder
from tests.topology.maps import ladder

TRUE_M = in_grid(cloud().points_m.astype(np.float64))


def lines_of(file: Path, field: str) -> list[tuple[str, FloatArray]]:
    """What GDAL finds in a file: of each line (N, 3) the value of a field."""
    gdal = pytest.importorskip("pyogrio")
    meta, _, shapes, columns = gdal.raw.read(file)
    values = columns[list(meta["fields"]).index(field)]
    return [(str(value), line) for value, line in zip(values, map(_line, shapes), strict=True) if line is not None]


def _line(wkb: bytes | None) -> FloatArray | None:
    """The points of a line with heights in well-known binary (OGC 06-103r4, 8.2.3), None for another shape."""
    if wkb is None or wkb[0] != 1 or struct.unpack_from("<I", wkb, 1)[0] not in (0x80000002, 1002):
        return None
    return np.frombuffer(wkb, "<f8", offset=9).reshape(-1, 3)


def test_gdal_reads_the_drawing(exported: Exporter) -> None:
    found = lines_of(exported("dxf", ".dxf", sloping_ladder(), grid=True), "Layer")
    assert {layer for layer, _ in found} >= {"WALLS", "CENTRELINE"}
    drawn = [line for layer, line in found if layer == "CENTRELINE"]
    for line, tunnel in zip(drawn, sloping_ladder().tunnels, strict=True):
        np.testing.assert_allclose(line, in_grid(tunnel.line_m), atol=5e-4)


def test_gdal_reads_the_geojson(exported: Exporter) -> None:
    found = lines_of(exported("geojson", ".geojson", sloping_ladder()), "kind")
    drawn = [line for kind, line in found if kind == "tunnel"]
    for line, tunnel in zip(drawn, sloping_ladder().tunnels, strict=True):
        np.testing.assert_allclose(line, tunnel.line_m, atol=5e-4)


def test_rustworkx_reads_places_and_ways(exported: Exporter) -> None:
    rx = pytest.importorskip("rustworkx")
    read: Any = rx.read_graphml(str(exported("graphml", ".graphml")))
    graph = read[0] if isinstance(read, list) else read
    places = {node["id"]: node for node in graph.nodes()}
    assert (places["w1"]["name"], places["w1"]["x_m"], places["w1"]["y_m"]) == ("DP1", 0.0, -26.0)
    assert sum(way["length_m"] for way in graph.edges()) == pytest.approx(
        sum(one.length_m for one in ladder().connections if one.feasible), abs=0.01
    )


def test_las_by_its_specification(exported: Exporter) -> None:
    """LAS 1.4 R15, 2.4 and Table 13: offset, size and number of the records, scale and offset of their x, y, z."""
    data = exported("laz", ".las", grid=True).read_bytes()
    assert data[:4] == b"LASF"
    assert data[24:26] == b"\x01\x04"
    at, count = struct.unpack_from("<I", data, 96)[0], struct.unpack_from("<Q", data, 247)[0]
    (size,) = struct.unpack_from("<H", data, 105)
    scale, offset = np.frombuffer(data, "<f8", 3, 131), np.frombuffer(data, "<f8", 3, 155)
    records = np.frombuffer(data, np.uint8, count * size, at).reshape(count, size)
    points = records[:, :12].copy().view("<i4") * scale + offset
    assert np.abs(points - TRUE_M).max() < 5e-4


@pytest.mark.skipif(importlib.util.find_spec("pye57") is None, reason="the extra e57 is not installed")
def test_rust_reads_the_e57(exported: Exporter) -> None:
    e57 = pytest.importorskip("e57")
    points = e57.read_points(str(exported("e57", ".e57", grid=True))).points
    assert points.shape == TRUE_M.shape
    assert np.abs(points - TRUE_M).max() < 5e-4

"""The drawing, read back with ezdxf: layers, places, heights, directions."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from ezdxf.entities.polyline import Polyline
from ezdxf.filemanagement import readfile
from lhdmap.exports.outline import floor_of, outlines, walls
from lhdmap.messages import FloatArray
from lhdmap.topology.sheet import FREE, OCCUPIED, Sheet

from tests.exports.conftest import Exporter
from tests.exports.folders import CELL_M, MARKS_M, TURN_RAD, in_grid, sloping_ladder, street

LAYERS = {"WALLS", "CENTRELINE", "NODES", "ACCESS_POINTS", "WAYPOINTS", "CONTROL_POINTS"}


def lines(file: Path, layer: str) -> list[FloatArray]:
    found = readfile(file).modelspace().query(f'POLYLINE[layer=="{layer}"]')
    return [np.array([point.xyz for point in one.points()]) for one in found if isinstance(one, Polyline)]


def arrow(file: Path, layer: str, name: str) -> tuple[FloatArray, float]:
    """Place and rotation of the arrow that a text stands at."""
    space = readfile(file).modelspace()
    text = next(one for one in space.query(f'TEXT[layer=="{layer}"]') if one.dxf.text == name)
    inserts = list(space.query(f'INSERT[layer=="{layer}"]'))
    near = min(inserts, key=lambda one: (one.dxf.insert - text.dxf.align_point).magnitude)
    return np.array(near.dxf.insert.xyz), float(near.dxf.rotation)


def test_layers_units_and_validity(exported: Exporter) -> None:
    drawing = readfile(exported("dxf", ".dxf", grid=True))
    assert drawing.header["$INSUNITS"] == 6  # metres
    assert {layer.dxf.name for layer in drawing.layers} >= LAYERS
    assert {one.dxf.layer for one in drawing.modelspace()} == LAYERS
    assert not drawing.audit().errors


def test_walls_are_where_free_space_ends(exported: Exporter) -> None:
    (wall,) = lines(exported("dxf", ".dxf"), "WALLS")
    np.testing.assert_allclose(wall[:, :2].min(axis=0), [-10.0, -2.5], atol=0.75 * CELL_M)
    np.testing.assert_allclose(wall[:, :2].max(axis=0), [70.0, 2.5], atol=0.75 * CELL_M)
    assert len(wall) <= 8


def test_walls_follow_the_floor_beside_them(exported: Exporter) -> None:
    """T1 rises as a sine to 3 m at x = 30 and is level beyond its ends; so do both straight walls."""
    sheet = street()._replace(heights_m=(0.0, 3.0))
    (wall,) = lines(exported("dxf", ".dxf", sloping_ladder(), [sheet]), "WALLS")
    for side in (wall[wall[:, 1] > 2.0], wall[wall[:, 1] < -2.0]):
        side = side[np.argsort(side[:, 0])]
        x = np.linspace(0.0, 60.0, 121)
        floor = 3.0 * np.sin(np.pi * np.clip((x - 6.0) / 48.0, 0.0, 1.0))
        assert np.abs(np.interp(x, side[:, 0], side[:, 2]) - floor).max() < 0.25
    assert len(wall) < 60


def test_a_level_has_its_own_floor(exported: Exporter) -> None:
    """A street 12 m above the ladder is not drawn at the ladder's height."""
    found = lines(exported("dxf", ".dxf", None, [street(), street(7.0, 12.0)]), "WALLS")
    assert [np.unique(one[:, 2]).tolist() for one in found] == [[0.0], [12.0]]


def test_centre_lines_have_the_map_s_points(exported: Exporter) -> None:
    found = lines(exported("dxf", ".dxf", sloping_ladder()), "CENTRELINE")
    for line, tunnel in zip(found, sloping_ladder().tunnels, strict=True):
        np.testing.assert_allclose(line, tunnel.line_m, atol=1e-4)


def test_nodes_and_points_are_named_and_point_outward(exported: Exporter) -> None:
    file = exported("dxf", ".dxf")
    texts = {one.dxf.text for one in readfile(file).modelspace().query("TEXT")}
    assert {"I1", "I2", "T1", "T2", "T3", "DP1", "i1.t1", "t3.start"} <= texts
    assert len(lines(file, "NODES")) == 2
    at, rotation = arrow(file, "WAYPOINTS", "DP1")
    np.testing.assert_allclose(at, [0.0, -26.0, 0.0], atol=1e-6)
    assert rotation == pytest.approx(270.0)


def test_in_the_grid_everything_is_turned_and_shifted_to_the_millimetre(exported: Exporter) -> None:
    file = exported("dxf", ".dxf", sloping_ladder(), grid=True)
    for line, tunnel in zip(lines(file, "CENTRELINE"), sloping_ladder().tunnels, strict=True):
        np.testing.assert_allclose(line, in_grid(tunnel.line_m), atol=5e-4)
    at, rotation = arrow(file, "WAYPOINTS", "DP1")
    assert rotation == pytest.approx(270.0 + math.degrees(TURN_RAD), abs=1e-3)
    np.testing.assert_allclose(at, in_grid(np.array([[0.0, -26.0, 0.0]]))[0], atol=5e-4)
    for name, mark in MARKS_M.items():
        np.testing.assert_allclose(arrow(file, "CONTROL_POINTS", name)[0], in_grid(np.array([mark]))[0], atol=5e-4)


def test_it_opens_on_the_mine(exported: Exporter) -> None:
    drawing = readfile(exported("dxf", ".dxf", grid=True))
    view = drawing.viewports.get_config("*Active")[0]
    middle = in_grid(np.array([[30.0, 0.0, 0.0]]))[0]
    assert np.hypot(*(np.array([view.dxf.center.x, view.dxf.center.y]) - middle[:2])) < 30.0


def test_pillars_and_specks() -> None:
    cells = np.full((40, 40), OCCUPIED, np.uint8)
    cells[5:35, 5:35] = FREE
    cells[15:25, 15:25] = OCCUPIED  # a pillar of 5 m
    cells[10, 10] = OCCUPIED  # a speck
    found = outlines(Sheet(cells, np.array([100.0, 0.0]), 0.5))
    spans = sorted(float(np.ptp(ring[:, 0])) for ring in found)
    assert spans == pytest.approx([5.0, 15.0])
    assert all((ring[0] == ring[-1]).all() for ring in found)
    assert not outlines(Sheet(np.zeros((3, 3), np.uint8), np.zeros(2), 0.5))


def test_oblique_walls_are_straight_and_within_a_cell() -> None:
    y, x = np.mgrid[0:200, 0:200] * 0.2 + 0.1
    across = (y - x) / np.sqrt(2.0)
    sheet = Sheet(np.where(np.abs(across) < 3.0, FREE, OCCUPIED).astype(np.uint8), np.zeros(2), 0.2)
    (ring,) = walls(sheet, floor_of([]))
    inner = ring[(ring[:, :2] > 5.0).all(axis=1) & (ring[:, :2] < 35.0).all(axis=1)]
    assert np.abs(np.abs(inner[:, 1] - inner[:, 0]) / np.sqrt(2.0) - 3.0).max(initial=0.0) < 0.2
    assert len(ring) < 40

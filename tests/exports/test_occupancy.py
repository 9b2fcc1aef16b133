"""The pair of map_server, read as nav2's map_io reads it (trinary mode)."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.exports.export import ExportRequest, export
from lhdmap.topology.sheet import FREE, OCCUPIED, Sheet
from ruamel.yaml import YAML

from tests.exports.conftest import Exporter
from tests.exports.folders import CELL_M, TURN_RAD, in_grid, map_folder, street


def loaded(file: Path) -> tuple[np.ndarray, dict[str, Any]]:
    """An occupancy grid as nav2 publishes it: -1 unknown, 0 free, 100 occupied; row 0 is the lowest y."""
    table = YAML(typ="safe").load(file.read_text(encoding="utf-8"))
    data = (file.parent / table["image"]).read_bytes()
    head = re.match(rb"P5\s(?:#.*\n)*(\d+)\s+(\d+)\s+255\s", data)
    assert head is not None
    width, height = map(int, head.groups())
    pixels = np.frombuffer(data[head.end() :], np.uint8).reshape(height, width)
    assert table["mode"] == "trinary"
    assert table["negate"] == 0
    shade = (255 - pixels) / 255.0
    grid = np.where(shade > table["occupied_thresh"], 100, np.where(shade < table["free_thresh"], 0, -1))
    return grid[::-1], table  # map_io flips: the picture's last row is the grid's first


def cell_at(grid: np.ndarray, table: dict[str, Any], x: float, y: float) -> int:
    ox, oy, yaw = table["origin"]
    dx, dy = x - ox, y - oy
    column = math.floor((math.cos(yaw) * dx + math.sin(yaw) * dy) / table["resolution"])
    row = math.floor((-math.sin(yaw) * dx + math.cos(yaw) * dy) / table["resolution"])
    return int(grid[row, column])


def test_cells_mean_what_they_meant(exported: Exporter) -> None:
    sheet = street()
    grid, table = loaded(exported("occupancy", ".yaml"))
    wanted = np.full(sheet.cells.shape, -1)
    wanted[sheet.cells == FREE], wanted[sheet.cells == OCCUPIED] = 0, 100
    np.testing.assert_array_equal(grid, wanted)
    assert table["origin"] == [-20.0, -10.0, 0.0]
    assert table["resolution"] == CELL_M


def test_unknown_would_be_free_at_nav2_s_usual_threshold(exported: Exporter) -> None:
    """(255 - 205) / 255 = 0.196 is below the 0.25 that map_saver writes: nav2 PR 5278."""
    _, table = loaded(exported("occupancy", ".yaml"))
    unknown = (255 - 205) / 255
    assert table["free_thresh"] <= unknown < 0.25
    assert table["free_thresh"] > (255 - 254) / 255


def test_pixels_are_map_saver_s_and_the_top_row_is_north(exported: Exporter) -> None:
    cells = np.zeros((3, 4), np.uint8)
    cells[0, 0], cells[2, 3] = FREE, OCCUPIED
    file = exported("occupancy", ".yaml", None, [Sheet(cells, np.array([1.0, 2.0]), 0.5)])
    import cv2  # an independent reader of pictures

    pixels = cv2.imread(str(file.with_suffix(".pgm")), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(pixels, [[205, 205, 205, 0], [205] * 4, [254, 205, 205, 205]])
    grid, table = loaded(file)
    assert cell_at(grid, table, 1.1, 2.1) == 0
    assert cell_at(grid, table, 2.9, 3.4) == 100


def test_a_pair_for_each_level(exported: Exporter, tmp_path: Path) -> None:
    exported("occupancy", ".yaml", None, [street(7.0, 12.0), street(5.0, 0.0)])
    low, high = (loaded(tmp_path / f"out_{k}.yaml")[0] for k in (1, 2))
    assert (low == 0).sum() < (high == 0).sum()
    assert not (tmp_path / "out.yaml").exists()


def test_in_the_grid_the_origin_is_turned(exported: Exporter) -> None:
    grid, table = loaded(exported("occupancy", ".yaml", grid=True))
    assert table["origin"][2] == pytest.approx(TURN_RAD, abs=1e-5)
    for at, wanted in (((69.0, 2.0, 0.0), 0), ((69.0, 2.6, 0.0), 100), ((69.0, 3.2, 0.0), -1)):
        x, y, _ = in_grid(np.array([at]))[0]
        assert cell_at(grid, table, x, y) == wanted


def test_a_map_without_free_space_is_refused(tmp_path: Path) -> None:
    folder = map_folder(tmp_path / "old", plain=True)
    with pytest.raises(InputError, match=r"free_space\.npz"):
        export(ExportRequest(folder, "occupancy"))
    with pytest.raises(InputError, match="no level"):
        export(ExportRequest(map_folder(tmp_path / "none", sheets=[]), "occupancy", tmp_path / "x.yaml"))

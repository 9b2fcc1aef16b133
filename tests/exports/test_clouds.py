"""Clouds in the grid keep their millimetres, read with laspy and, of PLY, by hand and by lhdmap."""

from __future__ import annotations

from pathlib import Path

import laspy
import numpy as np
import pytest
from lhdmap.integration.cloud_io import read_cloud

from tests.exports.conftest import Exporter
from tests.exports.folders import TURN_RAD, cloud, in_grid

TRUE_M = in_grid(cloud().points_m.astype(np.float64))


def turned_normals() -> np.ndarray:
    c, s = np.cos(TURN_RAD), np.sin(TURN_RAD)
    normals = cloud().normals
    assert normals is not None
    turned: np.ndarray = normals @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return turned


@pytest.mark.parametrize("suffix", [".laz", ".las"])
def test_laspy_reads_the_grid(exported: Exporter, suffix: str) -> None:
    las = laspy.read(exported("laz", suffix, grid=True))
    assert np.abs(las.xyz - TRUE_M).max() < 5e-4
    np.testing.assert_array_equal(las["stamp_ns"], cloud().stamps_ns)
    np.testing.assert_allclose(np.column_stack([las["nx"], las["ny"], las["nz"]]), turned_normals(), atol=1e-5)
    assert np.abs(las.header.mins - TRUE_M.min(axis=0)).max() < 1e-3


def vertices(file: Path) -> np.ndarray:
    """The x, y, z of a binary PLY file, by its header."""
    head, _, body = file.read_bytes().partition(b"end_header\n")
    kinds = {"float": "<f4", "double": "<f8", "int": "<i4"}
    fields = [line.split()[1:] for line in head.decode().splitlines() if line.startswith("property")]
    table = np.frombuffer(body, np.dtype([(name, kinds[kind]) for kind, name in fields]))
    return np.column_stack([table[axis].astype(np.float64) for axis in "xyz"])


def test_ply_in_the_grid_has_doubles(exported: Exporter) -> None:
    file = exported("ply", ".ply", grid=True)
    assert np.abs(vertices(file) - TRUE_M).max() < 5e-4
    assert b"frame mine_grid" in file.read_bytes()[:200]
    again = read_cloud(file)
    assert np.abs(again.exact_m() - TRUE_M).max() < 5e-4
    np.testing.assert_array_equal(again.stamps_ns, cloud().stamps_ns)


def test_open3d_reads_it_to_the_millimetre(exported: Exporter) -> None:
    o3d = pytest.importorskip("open3d")
    read = np.asarray(o3d.io.read_point_cloud(str(exported("ply", ".ply", grid=True))).points)
    assert np.abs(read - TRUE_M).max() < 5e-4


def test_in_the_map_the_cloud_is_the_same(exported: Exporter, tmp_path: Path) -> None:
    assert exported("ply", ".ply").read_bytes() == (tmp_path / "mine_map" / "cloud.ply").read_bytes()

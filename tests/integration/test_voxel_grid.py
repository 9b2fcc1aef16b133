"""The voxel grid: absolute, anisotropic, complete, the same in any order and portion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from lhdmap.errors import UsageError
from lhdmap.integration.voxel_grid import VoxelGrid
from lhdmap.messages import FloatArray

SIZE = (0.2, 0.2, 0.1)
SIZES = st.sampled_from([SIZE, (0.5, 0.25, 1.0), (0.07, 0.3, 0.11), (1.0, 1.0, 1.0)])
POINTS = hnp.arrays(
    np.float64,
    st.tuples(st.integers(1, 60), st.just(3)),
    elements=st.floats(-40.0, 40.0, width=32, allow_subnormal=False),
)


def grid_of(points: FloatArray, size: tuple[float, float, float] = SIZE) -> VoxelGrid:
    grid = VoxelGrid(size)
    grid.add(points, np.arange(len(points)), np.zeros(3))
    return grid


@given(points=POINTS, size=SIZES)
@settings(max_examples=100, deadline=None)
def test_putting_the_cloud_in_again_gives_the_same_cloud(points: FloatArray, size: tuple[float, float, float]) -> None:
    once = grid_of(points, size).cloud()
    twice = grid_of(once.points_m.astype(np.float64), size).cloud()
    assert np.array_equal(once.points_m, twice.points_m)
    assert twice.hits is not None
    assert (twice.hits == 1).all()


@given(points=POINTS, size=SIZES)
@settings(max_examples=100, deadline=None)
def test_voxels_are_the_cells_of_the_absolute_grid(points: FloatArray, size: tuple[float, float, float]) -> None:
    grid = grid_of(points, size)
    cloud = grid.cloud()
    cells = np.floor(points / np.array(size)).astype(int)
    expected, first, counts = np.unique(cells, axis=0, return_index=True, return_counts=True)
    order = np.argsort(first)
    assert np.array_equal(np.floor(cloud.points_m.astype(np.float64) / np.array(size)).astype(int), expected[order])
    assert cloud.hits is not None
    assert np.array_equal(cloud.hits, counts[order])
    assert grid.hits == len(points)
    assert len(grid) == len(expected)


@given(points=POINTS, cut=st.integers(0, 60), seed=st.integers(0, 1000))
@settings(max_examples=60, deadline=None)
def test_neither_portions_nor_order_matter(points: FloatArray, cut: int, seed: int) -> None:
    whole = grid_of(points)
    parts = VoxelGrid(SIZE)
    stamps = np.arange(len(points))
    parts.add(points[:cut], stamps[:cut], np.zeros(3))
    parts.add(points[cut:], stamps[cut:], np.zeros(3))
    assert parts.voxels.tobytes() == whole.voxels.tobytes()
    shuffled = VoxelGrid(SIZE)
    order = np.random.default_rng(seed).permutation(len(points))
    shuffled.add(points[order], stamps[order], np.zeros(3))
    a, b = (np.sort(grid.voxels[["key", "first_ns", "last_ns", "hits"]], order="key") for grid in (whole, shuffled))
    assert np.array_equal(a, b)


def test_centroid_stamps_and_viewpoint() -> None:
    grid = VoxelGrid(SIZE)
    grid.add(np.array([[0.05, 0.05, 0.05], [0.15, 0.11, 0.09]]), np.array([70, 60]), np.array([1.0, 2.0, 3.0]))
    grid.add(np.array([[0.10, 0.02, 0.01]]), np.array([90]), np.array([9.0, 9.0, 9.0]))
    cloud = grid.cloud()
    assert cloud.points_m == pytest.approx(np.array([[0.1, 0.06, 0.05]]), abs=1e-7)
    assert cloud.stamps_ns is not None
    assert cloud.stamps_ns.tolist() == [60]
    assert grid.voxels["last_ns"].tolist() == [90]
    assert cloud.viewpoints_m is not None
    assert cloud.viewpoints_m.tolist() == [[1.0, 2.0, 3.0]]


def test_cells_are_lower_than_wide() -> None:
    steps = np.arange(10) * 0.1 + 0.05
    up = np.stack([np.zeros(10), np.zeros(10), steps], axis=-1)
    assert len(grid_of(up)) == 10
    assert len(grid_of(up[:, [2, 0, 1]])) == 5
    assert len(grid_of(up[:, [0, 2, 1]])) == 5


def test_points_beside_zero_fall_into_different_cells() -> None:
    assert len(grid_of(np.array([[-1e-9, 0.0, 0.0], [1e-9, 0.0, 0.0]]))) == 2


def test_points_that_cannot_be_placed_are_refused_and_counted() -> None:
    grid = VoxelGrid(SIZE)
    bad = np.array([[np.nan, 0, 0], [0, np.inf, 0], [0, 0, -np.inf], [1e12, 0, 0], [0, 0, 2e5], [1.0, 1.0, 1.0]])
    assert grid.add(bad, np.zeros(6, dtype=np.int64), np.zeros(3)) == 5
    assert len(grid) == 1
    assert grid.refused == 5


def test_a_large_cloud_loses_nothing_while_the_table_grows() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform([-100, -5, -2], [100, 5, 3], (300_000, 3))
    grid = grid_of(points)
    cells = np.floor(points / np.array(SIZE)).astype(np.int64)
    keys = (cells[:, 0] * 1000 + cells[:, 1]) * 1000 + cells[:, 2]
    assert len(grid) == len(np.unique(keys))
    assert grid.hits == 300_000
    centroids = grid.cloud().points_m
    assert np.array_equal(
        np.unique(np.floor(centroids.astype(float) / np.array(SIZE)), axis=0), np.unique(cells, axis=0)
    )


def test_memory_is_bounded_by_the_map() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(0.0, 4.0, (20_000, 3))
    grid = grid_of(points)
    sizes = set()
    for k in range(30):
        grid.add(points, np.full(len(points), k), np.zeros(3))
        sizes.add((len(grid._table.keys), len(grid._table.voxels)))
    assert len(sizes) == 1
    assert grid._table.voxels.nbytes < 3 * 64 * len(grid)
    assert grid.hits == 31 * 20_000


def test_stray_voxels_are_left_out_and_surfaces_are_kept() -> None:
    rng = np.random.default_rng(2)
    wall = np.stack([rng.uniform(0, 20, 40_000), np.full(40_000, 2.01), rng.uniform(0, 3, 40_000)], axis=-1)
    dust = rng.uniform([0, -1.5, 0.2], [20, 1.5, 3], (60, 3))
    grid = grid_of(np.vstack([wall, dust]))
    kept = grid.cloud(min_hits=2, min_neighbour_hits=2).points_m
    assert (kept[:, 1] > 2.0).sum() == (grid.cloud().points_m[:, 1] > 2.0).sum()
    assert (kept[:, 1] < 1.9).sum() <= 6
    sparse = np.stack([np.arange(0, 20, 0.15), np.zeros(134), np.zeros(134)], axis=-1)  # a far line, seen once
    assert len(grid_of(sparse).cloud(min_hits=2, min_neighbour_hits=1)) == len(grid_of(sparse))


@pytest.mark.parametrize("size", [(0.2, 0.2, 0.0), (0.2, -0.1, 0.2), (0.2, np.inf, 0.2)])
def test_a_size_that_is_none_is_refused(size: tuple[float, float, float]) -> None:
    with pytest.raises(UsageError, match="above zero"):
        VoxelGrid(size)

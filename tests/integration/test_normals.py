"""Normals and curvature against analytic surfaces and independent neighbour counts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.errors import InputError
from lhdmap.integration.normals import eigen3, estimate_normals
from lhdmap.messages import Float32Array, FloatArray
from scipy.spatial import cKDTree


def angles_deg(normals: Float32Array, truth: FloatArray) -> FloatArray:
    return np.rad2deg(np.arccos(np.clip((normals * truth).sum(axis=1), -1.0, 1.0)))


def tube(n: int, radius_m: float = 2.5) -> tuple[Float32Array, FloatArray]:
    """Points of a tube around the x axis and its inward normals."""
    rng = np.random.default_rng(0)
    angle = rng.uniform(0, 2 * np.pi, n)
    points = np.stack([rng.uniform(0, 20, n), radius_m * np.cos(angle), radius_m * np.sin(angle)], axis=-1)
    return points.astype(np.float32), np.stack([np.zeros(n), -np.cos(angle), -np.sin(angle)], axis=-1)


def test_a_plane_has_its_normal_and_no_curvature() -> None:
    rng = np.random.default_rng(1)
    normal = np.array([0.36, -0.48, 0.8])
    u, v = np.array([0.8, 0.6, 0.0]), np.cross(normal, [0.8, 0.6, 0.0])
    points = (rng.uniform(-3, 3, (3000, 1)) * u + rng.uniform(-3, 3, (3000, 1)) * v).astype(np.float32)
    found = estimate_normals(points, 0.75, np.tile(10 * normal, (3000, 1)).astype(np.float32))
    assert angles_deg(found.normals, np.tile(normal, (3000, 1))).max() < 0.05
    assert found.curvature.max() < 1e-6


def test_a_tube_has_inward_normals_seen_from_its_axis() -> None:
    points, truth = tube(20_000)
    viewpoints = points * np.array([1.0, 0.0, 0.0], dtype=np.float32)
    found = estimate_normals(points, 0.75, viewpoints)
    inner = (points[:, 0] > 1) & (points[:, 0] < 19)
    errors = angles_deg(found.normals, truth)[inner]
    assert np.median(errors) < 1.5
    assert np.quantile(errors, 0.99) < 6.0
    outward = estimate_normals(points, 0.75, viewpoints + 100.0 * (points - viewpoints))
    assert angles_deg(outward.normals, -truth)[inner].max() < 20.0


def test_normals_point_up_without_viewpoints() -> None:
    points = (np.random.default_rng(2).uniform(-1, 1, (2000, 3)) * [3.0, 3.0, 0.05]).astype(np.float32)
    assert (estimate_normals(points, 0.75).normals[:, 2] > 0.9).all()


def test_curvature_is_at_most_a_third_and_reaches_it_in_a_ball() -> None:
    rng = np.random.default_rng(3)
    ball = rng.normal(size=(4000, 3))
    ball *= (rng.uniform(0, 1, (4000, 1)) ** (1 / 3)) / np.linalg.norm(ball, axis=1, keepdims=True)
    curvature = estimate_normals(ball.astype(np.float32), 0.5).curvature
    assert curvature.max() <= 1 / 3 + 1e-6
    middle = np.linalg.norm(ball, axis=1) < 0.4
    assert curvature[middle].mean() == pytest.approx(1 / 3, abs=0.05)


def test_curvature_of_an_edge_is_that_of_its_covariance() -> None:
    rng = np.random.default_rng(4)
    a = np.stack([rng.uniform(-2, 2, 4000), rng.uniform(0, 2, 4000), np.zeros(4000)], axis=-1)
    edge = np.vstack([a, a[:, [0, 2, 1]]]).astype(np.float32)
    found = estimate_normals(edge, 0.75)
    tree = cKDTree(edge)
    for i in (17, 500, 7777):
        around = edge[tree.query_ball_point(edge[i], 0.75)].astype(float)
        values = np.linalg.eigvalsh(np.cov(around.T))
        assert found.curvature[i] == pytest.approx(values[0] / values.sum(), abs=1e-4)


@given(seed=st.integers(0, 10_000), radius=st.floats(0.1, 3.0))
@settings(max_examples=25, deadline=None)
def test_neighbours_are_those_of_a_tree(seed: int, radius: float) -> None:
    points = np.random.default_rng(seed).uniform(-2, 2, (150, 3)).astype(np.float32)
    exact = cKDTree(points.astype(float)).query_ball_point(points.astype(float), radius, return_length=True)
    assert np.array_equal(estimate_normals(points, radius).neighbours, exact - 1)


@given(seed=st.integers(0, 10_000), flat=st.sampled_from([1.0, 1e-3, 1e-8, 0.0]))
@settings(max_examples=60, deadline=None)
def test_eigenvalues_agree_with_lapack(seed: int, flat: float) -> None:
    rng = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    matrix = rotation @ np.diag([1.0, rng.uniform(0.1, 1.0), flat]) @ rotation.T
    values, vectors = eigen3(matrix)
    assert np.sort(values) == pytest.approx(np.linalg.eigvalsh(matrix), abs=1e-14)
    assert vectors @ np.diag(values) @ vectors.T == pytest.approx(0.5 * (matrix + matrix.T), abs=1e-13)


def test_too_few_points_or_a_line_give_no_normal() -> None:
    line = np.stack([np.linspace(0, 1, 30), np.zeros(30), np.zeros(30)], axis=-1).astype(np.float32)
    few = np.array([[9.0, 9.0, 9.0], [9.1, 9.0, 9.0], [9.0, 9.1, 9.0]], dtype=np.float32)
    found = estimate_normals(np.vstack([line, few]), 0.75)
    assert not found.normals.any()
    assert not found.curvature.any()
    assert found.neighbours[-3:].tolist() == [2, 2, 2]
    assert len(estimate_normals(np.zeros((0, 3), np.float32), 0.75).normals) == 0


def test_points_that_are_not_finite_are_an_error() -> None:
    with pytest.raises(InputError, match="finite"):
        estimate_normals(np.array([[0.0, np.nan, 0.0]], dtype=np.float32), 0.75)
    with pytest.raises(InputError, match="stray"):
        estimate_normals(np.array([[0.0, 0.0, 0.0], [1e9, 0.0, 0.0]], dtype=np.float32), 0.75)


def test_normals_agree_with_open3d() -> None:
    import open3d as o3d

    points, _ = tube(6000)
    ours = estimate_normals(points, 0.75)
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(float)))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamRadius(0.75))
    theirs = np.array(cloud.normals)
    enough = ours.neighbours >= 5
    assert enough.mean() > 0.99
    assert np.abs((ours.normals * theirs).sum(axis=1))[enough].min() > 0.9999

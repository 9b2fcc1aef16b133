"""Clouds of landmarks: which scans, how dense, in which frame."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.errors import InputError
from lhdmap.geometry import se2
from lhdmap.landmarks.build import landmarks_of
from lhdmap.landmarks.scans import NodeScan, along_tunnel, checked, of_intersection, thinned
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.messages import FloatArray

SETTINGS = dataclasses.replace(LandmarkSettings(), centre_m=0.0)
FRAME = np.array([10.0, -5.0, 1.0, 0.5])


def square(half_m: float = 3.0) -> FloatArray:
    side = np.linspace(-half_m, half_m, 61)
    edge = np.full_like(side, half_m)
    return np.concatenate(
        [np.column_stack(part) for part in ((side, edge), (side, -edge), (edge, side), (-edge, side))]
    )


def scan(at_m: float, points: FloatArray | None = None, node: str = "t") -> NodeScan:
    pose = se2.compose(FRAME[[0, 1, 3]], np.array([at_m, 0.2, 0.1]))
    return NodeScan(node, at_m, pose, square() if points is None else points)


@given(st.integers(0, 10_000), st.integers(0, 400))
@settings(max_examples=30, deadline=None)
def test_density_is_one_point_a_cell_whatever_the_order(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-2.0, 2.0, (n, 2))
    thin = thinned(points, 0.1)
    assert len(thin) == len({tuple(cell) for cell in np.floor(points / 0.1).astype(int).tolist()})
    assert np.array_equal(thin, thinned(points[rng.permutation(n)], 0.1))
    for point in thin[:20]:  # each is the mean of its cell, so it lies in it
        inside = points[(np.floor(points / 0.1) == np.floor(point / 0.1)).all(axis=1)]
        assert point == pytest.approx(inside.mean(axis=0))


def test_the_scan_nearest_to_each_spacing_is_taken() -> None:
    scans = [scan(at) for at in (-0.1, 0.7, 1.6, 2.1, 2.9, 4.4, 8.3, 9.0)]
    assert [cloud.at_m for cloud in along_tunnel(scans, FRAME, SETTINGS)] == [-0.1, 2.1, 4.4, 8.3]


def test_poses_are_in_the_nodes_frame() -> None:
    cloud = along_tunnel([scan(0.0), scan(2.0)], FRAME, SETTINGS)[1]
    assert cloud.pose_node_base == pytest.approx([2.0, 0.2, 0.1])


def test_far_points_are_left_out_about_the_machines_centre() -> None:
    points = np.array([[9.0, 0.0], [11.0, 0.0], [-9.0, 0.0], [-11.0, 0.0]])
    kept = along_tunnel([scan(0.0, points)], FRAME, dataclasses.replace(SETTINGS, centre_m=-1.7))[0].points_m
    assert sorted(kept[:, 0]) == [-11.0, -9.0]


def test_an_intersection_is_one_cloud_in_its_frame() -> None:
    """A post seen from two poses lies at one place."""
    post_node = np.array([[2.55, 1.25]])
    scans = []
    for at in (0.0, 1.0):
        one = scan(at, node="x")
        T = se2.between(FRAME[[0, 1, 3]], one.pose_map_base)
        scans.append(one._replace(points_m=se2.transform(se2.inverse(T), post_node)))
    cloud = of_intersection(scans, FRAME, SETTINGS)
    assert cloud.points_m == pytest.approx(post_node, abs=1e-9)
    assert cloud.pose_node_base == pytest.approx([0.0, 0.0, 0.0])


def test_hits_that_are_no_numbers_are_left_out() -> None:
    points = np.vstack([square(), [[np.nan, 1.0], [np.inf, 0.0]]])
    assert len(checked(scan(0.0, points)).points_m) == len(square())


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (scan(0.0)._replace(pose_map_base=np.array([np.nan, 0.0, 0.0])), "not a number"),
        (scan(np.nan), "not a number"),
        (scan(0.0, np.zeros((3, 3))), r"\(N, 2\)"),
        (scan(0.0)._replace(pose_map_base=np.zeros(4)), r"\(3,\)"),
        (scan(0.0, node="elsewhere"), "no frame"),
    ],
)
def test_what_is_unusable_is_told(wrong: NodeScan, told: str) -> None:
    with pytest.raises(InputError, match=told):
        landmarks_of([wrong], {"t": FRAME}, {"t"}, SETTINGS)


@pytest.mark.parametrize("frame", [np.zeros(3), np.array([0.0, 0.0, 0.0, np.nan])])
def test_a_frame_that_is_none_is_told(frame: FloatArray) -> None:
    with pytest.raises(InputError, match="frame of 't'"):
        landmarks_of([scan(0.0)], {"t": frame}, {"t"}, SETTINGS)


def test_progress_rises_to_the_end() -> None:
    told: list[tuple[str, float]] = []
    scans = [scan(float(k), node=node) for node in ("t", "u") for k in range(5)]
    landmarks_of(scans, {"t": FRAME, "u": FRAME}, {"t", "u"}, SETTINGS, lambda node, share: told.append((node, share)))
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)
    assert {node for node, _ in told} == {"t", "u"}


def test_nothing_in_gives_nothing_out() -> None:
    empty = landmarks_of([], {"t": FRAME}, {"t"}, SETTINGS)
    assert len(empty) == 0
    assert not empty.surfaces


@pytest.mark.parametrize("count", [1, 2, 3])
def test_nodes_of_a_few_scans(count: int) -> None:
    made = landmarks_of([scan(float(k)) for k in range(count)], {"t": FRAME}, {"t"}, SETTINGS)
    assert len(made) >= 1
    assert made.surfaces["t"].cells.counts.sum() == count * len(square())
    assert made.not_distinctive_m("t", SETTINGS) == []


def test_a_scan_without_hits_makes_no_landmark() -> None:
    nothing = np.zeros((0, 2))
    made = landmarks_of([scan(0.0, nothing), scan(0.0, nothing, "x")], {"t": FRAME, "x": FRAME}, {"t"}, SETTINGS)
    assert len(made) == 0
    assert len(made.surfaces["t"].cells.counts) == 0

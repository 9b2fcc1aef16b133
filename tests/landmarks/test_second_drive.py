"""Landmarks of one drive, found again by another one that had no part in them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.landmarks.icp import align
from lhdmap.landmarks.scans import NodeCloud, along_tunnel
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.landmarks.similarity import icp_model, similarity
from lhdmap.landmarks.target import prepare

from tests.landmarks.conftest import Taught
from tests.landmarks.worlds import drive

SETTINGS = LandmarkSettings()


def clouds_of(taught: Taught) -> list[NodeCloud]:
    return along_tunnel(taught.scans, taught.world.frame(), SETTINGS)


@pytest.mark.parametrize("name", ["rough", "bent"])
def test_what_is_within_a_radius_is_found_by_another_drive(name: str, request: pytest.FixtureRequest) -> None:
    """From 0.3 m and 0.6 degrees away: within 0.10 m and 1 degree, all of them."""
    taught: Taught = request.getfixturevalue(name)
    made, model = taught.landmarks, icp_model(SETTINGS)
    other = along_tunnel(drive(taught.world, seed=50, offset_m=0.3), taught.world.frame(), SETTINGS)
    assert made.key.sum() >= 3
    assert (made.radius > 0).mean() > 0.6
    for j in np.flatnonzero(made.radius > 0).tolist():
        target = prepare(made.cloud(j).astype(np.float64), model)
        for i in range(max(j - made.radius[j], 0), min(j + made.radius[j] + 1, len(other))):
            true = se2.between(made.poses_node[j], other[i].pose_node_base)
            found = align(target, other[i].points_m, true + np.array([0.3, 0.1, 0.01]), model)
            error = se2.between(true, found.pose)
            assert math.hypot(error[0], error[1]) <= 0.10
            assert abs(math.degrees(error[2])) <= 1.0


@pytest.mark.parametrize("name", ["rough", "bent", "smooth"])
def test_no_two_keys_are_mistaken(name: str, request: pytest.FixtureRequest) -> None:
    made: Taught = request.getfixturevalue(name)
    keys = np.flatnonzero(made.landmarks.key)
    F = made.landmarks.similarity["t"][np.ix_(keys, keys)]
    between = made.landmarks.threshold[keys] >= F
    np.fill_diagonal(between, val=False)
    assert not between.any()


def test_smooth_walls_have_hardly_any_radius(smooth: Taught) -> None:
    assert (smooth.landmarks.radius > 0).mean() < 0.3


def test_the_matrix_is_the_fitness_of_source_on_target(rough: Taught) -> None:
    """Direct neighbours: what ICP from the known pose gives, the row being the source."""
    clouds, model = clouds_of(rough), icp_model(SETTINGS)
    F = rough.landmarks.similarity["t"]
    for i, j in ((3, 4), (4, 3), (10, 9)):
        known = se2.between(clouds[j].pose_node_base, clouds[i].pose_node_base)
        expected = align(prepare(clouds[j].points_m, model), clouds[i].points_m, known, model).fitness
        assert F[i, j] == pytest.approx(expected, rel=1e-5)
    assert not np.diag(F).any()
    assert F.max() <= np.float32(SETTINGS.limit_m**2)


def test_threads_and_a_window_change_nothing_else(bent: Taught) -> None:
    clouds = clouds_of(bent)[:20]
    whole = similarity(clouds, SETTINGS, threads=1)
    assert np.array_equal(whole, similarity(clouds, SETTINGS, threads=3))
    near = dataclasses.replace(SETTINGS, window_m=20.0)
    part = similarity(clouds, near)
    far = np.abs(np.subtract.outer(*[[cloud.at_m for cloud in clouds]] * 2)) > 20.0
    assert np.isnan(part[far]).all()
    assert np.array_equal(part[~far], whole[~far])


def test_a_tunnel_taught_backwards_has_the_same_neighbours(bent: Taught) -> None:
    """Half of the landmarks faced the other way: those still match with their neighbours at the known pose."""
    back = along_tunnel(drive(bent.world, seed=2, back=True), bent.world.frame(), SETTINGS)
    F = similarity(back[:12], SETTINGS)
    assert np.median(np.diag(F, 1)) < 0.05**2

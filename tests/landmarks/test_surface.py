"""Fused walls against the walls that are there."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.errors import InputError
from lhdmap.geometry import se2
from lhdmap.landmarks.build import landmarks_of, node_surface
from lhdmap.landmarks.scans import in_node
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.landmarks.surface import fused, surface_map
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.matching import Hits, Prior, match
from lhdmap.scan_matching.submap import OTHER_VISIT

from tests.landmarks.conftest import Taught
from tests.landmarks.worlds import ROUGH, drive, tunnel

SETTINGS = LandmarkSettings()
WIDE = np.diag([1.0, 1.0, 100.0])


def from_walls(points: FloatArray, segments: FloatArray) -> FloatArray:
    """Return how far each point is from the nearest of the wall's vertices and segments, m."""
    out = np.full(len(points), np.inf)
    a, b = segments[:, :2], segments[:, 2:]
    ab = b - a
    for k, point in enumerate(points):
        t = np.clip(((point - a) * ab).sum(axis=1) / np.maximum((ab * ab).sum(axis=1), 1e-12), 0.0, 1.0)
        out[k] = np.hypot(*(a + t[:, None] * ab - point).T).min()
    return out


def test_the_cells_lie_on_the_walls(rough: Taught) -> None:
    cells = rough.landmarks.surfaces["t"].cells
    points = se2.transform(rough.world.frame()[[0, 1, 3]], cells.points_m[::25].astype(np.float64))
    away = from_walls(points, rough.world.segments_m)
    assert np.sqrt(np.mean(away**2)) < 0.02
    assert 40.0 < len(cells.counts) / rough.world.length_m < 300.0


@given(st.integers(0, 10_000), st.integers(0, 300))
@settings(max_examples=25, deadline=None)
def test_no_hit_is_lost_or_moved(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.0, 1.0, (n, 2)) + 300.0
    cells = fused([points[: n // 2], points[n // 2 :]], 0.05)
    assert cells.counts.sum() == n
    if n:
        mean = (cells.points_m.astype(np.float64) * cells.counts[:, None]).sum(axis=0) / n
        assert mean == pytest.approx(points.mean(axis=0), abs=1e-4)
    shuffled = fused([points[rng.permutation(n)]], 0.05)
    assert np.array_equal(cells.counts, shuffled.counts)
    assert cells.points_m == pytest.approx(shuffled.points_m, abs=1e-4)


@pytest.mark.parametrize("back", [False, True])
def test_another_drive_is_placed_on_the_walls(bent: Taught, back: bool) -> None:
    """From half a metre away, in both directions: centimetres, as the localization will use it."""
    frame = bent.world.frame()
    errors = []
    for scan in drive(bent.world, seed=9, offset_m=0.25, every_m=9.0, back=back)[1:-1]:
        true = in_node(scan, frame)
        walls = bent.landmarks.surface_map("t", true[:2], 30.0)
        points = scan.points_m[np.hypot(*scan.points_m.T) < 12.0]
        start = se2.compose(true, np.array([0.2, 0.1, 0.01]))
        found = match(
            walls,
            Hits(np.column_stack([points, 0.0 * points[:, 0]]), len(points), False),
            Prior(start, WIDE),
            start,
            OTHER_VISIT,
        )
        errors.append(se2.between(true, found.pose))
        assert found.support > 0.7
    worst = np.abs(errors).max(axis=0)
    assert worst[0] < 0.03
    assert worst[1] < 0.02
    assert math.degrees(worst[2]) < 0.2


def test_a_long_node_is_had_in_parts() -> None:
    walls = np.column_stack([np.arange(0.0, 400.0, 0.05), np.full(8000, 2.0)])
    cells = fused([walls], 0.05)
    with pytest.raises(InputError, match="about_m"):
        surface_map(cells)
    part = surface_map(cells, np.array([200.0, 0.0]))
    assert part.fine.used[0] > 0


def test_the_walls_of_a_node_that_is_not_there_are_told(rough: Taught) -> None:
    with pytest.raises(InputError, match="no walls of 'u'"):
        rough.landmarks.surface_map("u")


def test_fine_cells_and_far_hits_are_possible(rough: Taught) -> None:
    extreme = dataclasses.replace(SETTINGS, cell_m=0.02, surface_range_m=40.0)
    scans = [scan._replace(points_m=np.vstack([scan.points_m, [[39.0, 30.0]]])) for scan in rough.scans[::4]]
    surface = node_surface(scans, rough.world.frame(), extreme, tunnel=True)
    assert surface.quality.support > 0.5


@pytest.mark.parametrize("scale", [0.995, 1.0, 1.005])
def test_the_local_scale_of_the_map_is_measured(scale: float) -> None:
    world = tunnel(3, ROUGH, 40.0)
    quality = node_surface(drive(world, 1, scale=scale), world.frame(), SETTINGS, tunnel=True).quality
    assert quality.scale == pytest.approx(scale - 1.0, abs=0.001)
    assert quality.support > 0.8
    assert 0.8 < quality.support_least <= quality.support
    assert quality.kappa >= (3.0 if scale == 1.0 else 8.0)


def test_the_order_of_the_scans_does_not_matter(rough: Taught) -> None:
    order = np.random.default_rng(0).permutation(len(rough.scans))
    again = landmarks_of([rough.scans[k] for k in order], {"t": rough.world.frame()}, {"t"}, SETTINGS)
    assert np.array_equal(again.points_m, rough.landmarks.points_m)
    assert np.array_equal(again.key, rough.landmarks.key)
    assert np.array_equal(again.similarity["t"], rough.landmarks.similarity["t"])
    assert np.array_equal(again.surfaces["t"].cells.points_m, rough.landmarks.surfaces["t"].cells.points_m)

"""Boulders in the relief of a face made of formulas: a rock is one, what one looks along (wall, roof) is none."""

from __future__ import annotations

import numpy as np
import pytest
from lhdmap.geometry.frame import UprightFrame
from lhdmap.messages import FloatArray
from lhdmap.pile.face import PileFace
from lhdmap.pile.judge import _ROCK_M, _RUBBLE_M
from lhdmap.pile.limits import FaceLimits
from lhdmap.pile.relief import CELL_M, boulders, grain_m, relief
from lhdmap.pile.surface import PileScene

HALF_M = 2.0
SHALLOW, STEEP = 4.0, 1.0  # dx/dz of the face


def _plane(slope: float, most_z_m: float = 2.2) -> FloatArray:
    """Return hits (N, 4) on the face x = slope z between the walls."""
    y, z = (a.ravel() for a in np.meshgrid(np.arange(-1.95, 1.96, 0.03), np.arange(0.02, most_z_m, 0.03)))
    return np.column_stack([slope * z, y, z, np.zeros(len(y))])


def _wall(slope: float, bump_m: float, most_z_m: float = 2.2) -> FloatArray:
    """Return hits on the left wall, a bump nearer than believed, from 6 m before the toe up to the face."""
    x, z = (a.ravel() for a in np.meshgrid(np.arange(-6.0, 8.0, 0.1), np.arange(0.02, most_z_m, 0.03)))
    before = x < slope * z
    return np.column_stack([x, np.full(len(x), HALF_M - bump_m), z, np.zeros(len(x))])[before]


def _ball(slope: float, size_m: float, at: tuple[float, float]) -> FloatArray:
    """Return hits on the front of a ball whose middle lies in the face at (y, z)."""
    y, z = (a.ravel() for a in np.meshgrid(np.arange(-1.0, 1.0, 0.03), np.arange(-1.0, 1.0, 0.03)))
    inside = np.hypot(y, z) < 0.5 * size_m
    depth = np.sqrt(np.maximum(0.25 * size_m**2 - y**2 - z**2, 0.0))
    points = np.column_stack([slope * at[1] - depth, at[0] + y, at[1] + z, np.zeros(len(y))])
    return points[inside & (points[:, 0] < slope * points[:, 2])]


def _seen(points: FloatArray) -> FloatArray:
    """Return the hits that no rock hides: those not well behind the foremost of their 3 cm cell near the face."""
    cells = np.round(points[:, 1:3] / 0.03).astype(np.int64) @ np.array([10_007, 1])
    _, cell = np.unique(cells, return_inverse=True)
    near = np.abs(points[:, 1]) < HALF_M - 0.25
    front = np.full(cell.max() + 1, np.inf)
    np.minimum.at(front, cell[near], points[near, 0])
    return points[~near | (points[:, 0] < front[cell] + 0.02)]


def _scene(slope: float, *parts: FloatArray) -> PileScene:
    points = _seen(np.concatenate([_plane(slope), *parts]))
    face = PileFace(0.0, 0.0, slope, 0.0, 1e-6 * np.eye(4), 0.05, 50)
    limits = FaceLimits(HALF_M, -HALF_M, 0.05, 0.05, 0.0, 0.0, 0.1)
    on = (points[:, 2] > 0.2) & (points[:, 2] < 1.6)
    return PileScene(UprightFrame(np.zeros(3), 0.0), points, face, on, 0.0, True, limits)


@pytest.mark.parametrize("size_m", [1.0, 1.3, 1.5])
def test_ball_in_the_face_is_one_boulder_of_its_size_at_its_place(size_m: float) -> None:
    scene = _scene(STEEP, _ball(STEEP, size_m, (0.4, 0.9)))
    (found,) = boulders(scene, relief(scene))
    assert found.size_m == pytest.approx(size_m, rel=0.25)
    assert np.linalg.norm(found.center_m - [0.9, 0.4, 0.9]) < 0.3


@pytest.mark.parametrize("slope", [SHALLOW, STEEP])
@pytest.mark.parametrize("bump_m", [0.15, 0.3, 0.6])
def test_wall_that_stands_farther_in_is_no_boulder(slope: float, bump_m: float) -> None:
    scene = _scene(slope, _wall(slope, bump_m))
    assert boulders(scene, relief(scene)) == ()


def test_rock_beside_such_a_wall_is_still_found() -> None:
    scene = _scene(STEEP, _wall(STEEP, 0.2), _ball(STEEP, 1.2, (0.9, 0.8)))
    (found,) = boulders(scene, relief(scene))
    assert np.linalg.norm(found.center_m - [0.8, 0.9, 0.8]) < 0.3


def test_depths_of_a_cell_tell_a_wall_from_a_face() -> None:
    scene = _scene(STEEP, _wall(STEEP, 0.2))
    seen = relief(scene)
    column = int((HALF_M - 0.2 + HALF_M) / 0.1)
    assert np.nanmedian(seen.depth_std_m[:, column]) > 0.5
    assert np.nanmedian(seen.depth_std_m[:, :20]) < 0.05


def test_bulge_over_most_of_the_width_is_no_boulder() -> None:
    scene = _scene(STEEP)
    points = scene.points.copy()
    points[np.abs(points[:, 1]) < 1.3, 0] -= 0.6
    scene = scene._replace(points=points)
    assert boulders(scene, relief(scene)) == ()


def _grain(flat: PileScene, bump_m: FloatArray) -> float:
    rough = flat._replace(points=flat.points + np.outer(bump_m, [1.0, 0.0, 0.0, 0.0]))
    return grain_m(relief(rough), 0.2, 1.6)


@pytest.mark.parametrize("seed", range(3))
def test_grain_tells_waves_from_stones(seed: int) -> None:
    """Both surfaces are as rough: blasted rock in waves of more than a metre, rubble stone by stone."""
    rng, flat = np.random.default_rng(seed), _scene(STEEP)
    _, y, z, _ = flat.points.T
    wave = 0.115 * np.sin(2.0 * np.pi * (y / 1.3 + rng.random())) * np.cos(2.0 * np.pi * z / 2.5)
    stones = rng.normal(0.0, 0.08, (50, 50))[((y + HALF_M) / CELL_M).astype(int), (z / CELL_M).astype(int)]
    rock, rubble = (_grain(flat, bump) for bump in (wave, stones))
    assert rock < _ROCK_M
    assert rubble > _RUBBLE_M


@pytest.mark.parametrize("slope", [0.7, 1.0, 1.4])
@pytest.mark.parametrize("size_m", [1.0, 1.4])
def test_ball_half_in_the_face_is_where_it_is(slope: float, size_m: float) -> None:
    at = (0.2, 0.9)
    scene = _scene(slope, _seen(np.concatenate([_plane(slope), _ball(slope, size_m, at)])))
    (found,) = boulders(scene, relief(scene))
    assert found.center_m == pytest.approx([slope * at[1], *at], abs=0.2)
    assert found.size_m == pytest.approx(size_m, rel=0.2)

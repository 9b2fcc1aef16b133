"""The walls around a place: those of its surroundings and its level, whatever was asked for before."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.landmarks.quality import UNMEASURED
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.matching import Hits, Prior, match
from lhdmap.scan_matching.submap import OTHER_VISIT

from tests.landmarks.worlds import ROUGH, TunnelWorld, seen, tunnel
from tests.localization.tunnels import near, walls_of, winding_walls

PRIOR = np.diag([1.0 / 0.1**2, 1.0 / 0.1**2, 1.0 / math.radians(1.0) ** 2])


@functools.cache
def long_one() -> tuple[TunnelWorld, MapWalls]:
    world = tunnel(3, ROUGH, 130.0)
    return world, walls_of({"t": (world, 0.0)})


def support(walls: MapWalls, world: TunnelWorld, at_m: float, height_m: float = 0.0) -> float:
    """Return the share of the hits of a scan of a world that agree with walls at its true place."""
    T: FloatArray = world.pose(at_m)
    points = near(seen(world, T, np.random.default_rng(9)))
    around, origin = walls.around(np.array([T[0], T[1], height_m]))
    hits = Hits(np.column_stack([points, np.zeros(len(points))]), len(points), layered=False)
    local = T - np.array([*origin, 0.0])
    found = match(around, hits, Prior(local, PRIOR), local, OTHER_VISIT)
    assert np.hypot(*se2.between(local, found.pose)[:2]) < 0.3
    return float(found.support)


def test_what_is_near_is_loaded_wherever_one_comes_from() -> None:
    world, walls = long_one()
    for at in (5.0, 120.0, 60.0, 6.0):
        assert support(walls, world, at) > 0.9


def test_it_is_kept_until_the_machine_has_moved_on() -> None:
    _, walls = long_one()
    first, _ = walls.around(np.array([20.0, 0.0, 0.0]))
    assert walls.around(np.array([30.0, 0.0, 0.3]))[0] is first
    assert walls.around(np.array([60.0, 0.0, 0.0]))[0] is not first


def test_far_away_there_are_none() -> None:
    walls = long_one()[1].around(np.array([0.0, 500.0, 0.0]))[0]
    hits = Hits(np.array([[x, 2.0, 0.0] for x in np.arange(0.0, 8.0, 0.05)]), 160, layered=False)
    assert match(walls, hits, Prior(np.zeros(3), PRIOR), np.zeros(3), OTHER_VISIT).support == 0.0


def test_levels_are_apart() -> None:
    """Two tunnels one above the other, with other walls each."""
    low, high = tunnel(3, ROUGH, 30.0), tunnel(4, ROUGH, 30.0)
    walls = walls_of({"low": (low, 0.0), "high": (high, 9.0)})
    assert support(walls, low, 15.0, 0.5) > 0.9
    assert support(walls, high, 15.0, 8.5) > 0.9
    assert support(walls, high, 15.0, 0.5) < 0.75
    assert support(walls, low, 15.0, 8.5) < 0.75


def test_a_node_without_walls_has_no_quality() -> None:
    quality = long_one()[1].quality("nowhere")
    assert quality == pytest.approx(UNMEASURED, nan_ok=True)


def test_a_tunnel_that_winds_above_itself_has_walls_by_height() -> None:
    low, high = tunnel(3, ROUGH, 30.0), tunnel(4, ROUGH, 30.0)
    walls = winding_walls([(low, 0.0), (high, 9.0)])
    assert support(walls, low, 15.0, 0.5) > 0.9
    assert support(walls, high, 15.0, 8.5) > 0.9
    assert support(walls, high, 15.0, 0.5) < 0.75
    assert support(walls, low, 15.0, 8.5) < 0.75
    heights = walls.cells()[:, 2]
    assert set(np.round(heights, 3)) == {0.0, 9.0}


def test_a_map_that_tells_no_heights_is_read_by_its_line() -> None:
    world = tunnel(3, ROUGH, 30.0)
    walls = winding_walls([(world, 2.0)], told=False)
    assert set(walls.cells()[:, 2]) == {2.0}
    assert support(walls, world, 15.0, 2.5) > 0.9

"""A lost place is taken up where the odometry has led to, over some metres; elsewhere it is not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.localization.settings import LocalizationSettings
from lhdmap.localization.tracker import MapTracker
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray
from lhdmap.pipeline.look_carried import CarriedLook, CarriedRules

from tests.localization.known import hits_at, known_map, poses_at
from tests.localization.tunnels import straight_walls

FROM_M, WANTED = 10.0, 0.5


def looked(off: FloatArray, way_m: FloatArray, *, wanted: float = WANTED, share_known: float = 1.0) -> list[float]:
    """Return where it was found, of a machine lost at the first of some ways, whose odometry is off by a pose (3,)."""
    known = known_map()
    walls, found_at = MapWalls(known.topology, known.landmarks), []
    look, poses = CarriedLook(walls), poses_at(way_m)
    look.lost(float(way_m[0]))
    rules = CarriedRules(lambda: wanted, lambda support, _: min(support / share_known, 1.0))
    for way, pose, points in zip(way_m.tolist(), poses, hits_at(poses, 7), strict=True):
        tracker = MapTracker(walls, LocalizationSettings(), se2.compose(pose, off), np.eye(3), 0.0)
        found = look.look(way, tracker, points, rules)
        if found is not None:
            apart = se2.between(pose, found)
            assert math.hypot(apart[0], apart[1]) < 0.1
            found_at.append(way - float(way_m[0]))
    return found_at


def test_a_place_that_the_odometry_led_to_is_found_after_some_metres() -> None:
    found = looked(np.array([0.2, -0.15, 0.03]), np.arange(FROM_M, FROM_M + 8.0, 0.25))
    assert found
    assert 3.0 <= found[0] <= 4.0  # one scan, or one place, is not believed


def test_farther_off_than_the_odometry_may_be_it_is_not_found() -> None:
    assert not looked(np.array([6.0, 0.0, 0.0]), np.arange(FROM_M, FROM_M + 8.0, 0.25))


def test_standing_still_tells_nothing() -> None:
    assert not looked(np.array([0.2, 0.0, 0.0]), np.full(40, FROM_M))


def test_the_share_counts_of_what_the_map_can_tell() -> None:
    """In a room that the map does not have, few hits agree; they do if most of those agree that it knows."""
    way_m, off = np.arange(FROM_M, FROM_M + 6.0, 0.25), np.array([0.1, 0.0, 0.0])
    assert not looked(off, way_m, wanted=1.5)
    assert looked(off, way_m, wanted=0.99, share_known=0.5)


def test_along_a_tunnel_that_looks_the_same_everywhere_nothing_is_believed() -> None:
    walls = straight_walls(100.0, 2.2)
    look = CarriedLook(walls)
    look.lost(0.0)
    sides = [np.column_stack([np.arange(-9.0, 9.0, 0.1), np.full(180, side * 2.2)]) for side in (1.0, -1.0)]
    tracker = MapTracker(walls, LocalizationSettings(), np.array([50.0, 0.0, 0.0]), np.eye(3), 0.0)
    for way in np.arange(60.0, 90.0, 0.5):  # so far that the odometry may be off by more than a metre
        assert look.look(float(way), tracker, np.concatenate(sides), CarriedRules(lambda: 0.5, lambda s, _: s)) is None


@pytest.mark.parametrize(
    ("way_m", "off_m", "leads"), [(0.0, 0.25, True), (0.0, 0.5, False), (50.0, 1.0, True), (500.0, 1.0, False)]
)
def test_what_the_odometry_may_be_off_grows_with_the_way(way_m: float, off_m: float, *, leads: bool) -> None:
    look = CarriedLook(straight_walls(10.0, 2.0))
    look.lost(0.0)
    assert look.leads_to(way_m, np.zeros(3), np.array([off_m, 0.0, 0.0])) == leads
    assert not look.leads_to(way_m, np.zeros(3), np.array([0.0, 0.0, 0.5]))

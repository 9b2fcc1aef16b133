"""Where a drive begins, of many poses: along a drift, both ways, by one scan."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.localization.starting import best_start, poses_about, poses_along, poses_anywhere, poses_in
from lhdmap.localization.walls import MapWalls

from tests.localization.known import hits_at, known_map, poses_at
from tests.topology.maps import ladder


@pytest.mark.parametrize("way_m", [8.0, 24.5, 37.0])
@pytest.mark.parametrize("turned", [False, True])
def test_a_machine_anywhere_in_a_drift_is_found_by_its_first_scan(way_m: float, *, turned: bool) -> None:
    known = known_map()
    walls = MapWalls(known.topology, known.landmarks)
    pose = poses_at(np.array([way_m]))[0] + np.array([0.0, 0.0, math.pi if turned else 0.0])
    points = hits_at(np.stack([pose, pose]), 5)[0]
    found = best_start(walls, poses_anywhere(known.topology), points)
    off = se2.between(pose, found.pose)
    assert math.hypot(off[0], off[1]) < 0.6  # what is known of a start that is given; driving tells the rest
    assert abs(math.remainder(off[2], 2.0 * math.pi)) < math.radians(1.5)
    assert found.support > found.rival


def test_poses_cover_a_tunnel_both_ways_and_an_intersection_all_round() -> None:
    topology = ladder()
    poses = poses_in(topology, "t1")
    assert len(poses) >= 2 * 48
    assert np.ptp(poses[:, 0]) == pytest.approx(48.0)
    assert {round(math.cos(one)) for one in poses[:, 2]} == {-1, 1}
    assert len(np.unique(np.round(poses_in(topology, "i1")[:, 2], 3))) == 8
    about = poses_about(topology, topology.points["w1"])
    assert np.hypot(about[:, 0], about[:, 1] + 26.0).max() < 6.0
    ahead = poses_along(np.array([1.0, 2.0, 0.5 * math.pi]), 3.0)
    straight = np.abs(ahead[:, 2] - 0.5 * math.pi) < 1e-9
    assert ahead[straight, 0] == pytest.approx(1.0)
    assert (ahead[:, 1].min(), ahead[:, 1].max()) == pytest.approx((-2.0, 6.0))
    left = ahead[
        (ahead[:, 2] > 0.5 * math.pi) & (ahead[:, 1] > 5.0)
    ]  # turned to the left, a place ahead is to the left, too
    assert len(left) >= 2
    assert (left[:, 0] < 1.0).all()

"""The floor of the map before the foot of a ramp: what a level scanner sees of it is no wall."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.localization.floor import NO_FLOOR, FloorOnMap, over_floor
from lhdmap.messages import FloatArray
from lhdmap.topology.model import TopologicalMap, Tunnel

GRADE, FOOT_M = 0.125, 20.0
UP_M, TILT = 1.8, math.tan(math.radians(2.5))
LEAST_M = 0.35


def ramp(level_above_m: float = math.inf) -> TopologicalMap:
    """Return a tunnel that is level for 20 m and then rises 1 in 8; over it, perhaps, a level one."""
    x = np.arange(0.0, 80.0, 1.0)
    line = np.column_stack([x, np.zeros(80), np.maximum(x - FOOT_M, 0.0) * GRADE])
    half = np.full((80, 2), 2.3)
    tunnels = [Tunnel("t1", "T1", ("dead_end", "dead_end"), line, half, np.zeros(4))]
    if math.isfinite(level_above_m):
        above = np.column_stack([x, np.zeros(80), np.full(80, level_above_m)])
        tunnels.append(Tunnel("t2", "T2", ("dead_end", "dead_end"), above, half, np.zeros(4)))
    return TopologicalMap(tuple(tunnels))


def sees_floor(at_m: float) -> FloatArray:
    """Return where a scanner that looks 2.5 degrees down from 1.8 m meets the ramp before it, (N, 3), over the machine's floor."""
    far = (UP_M + GRADE * (FOOT_M - at_m)) / (TILT + GRADE)
    y = np.linspace(-2.0, 2.0, 9)
    return np.column_stack([np.full(9, far), y, np.full(9, UP_M - TILT * far)])


@pytest.mark.parametrize("at_m", [6.0, 12.0, 18.0])
@pytest.mark.parametrize("turned", [0.0, 2.0])
@pytest.mark.parametrize("drift_m", [0.0, 7.0])
def test_the_floor_of_a_ramp_is_no_wall_and_what_stands_on_it_is_one(
    at_m: float, turned: float, drift_m: float
) -> None:
    """Whatever `odom` is turned by, and the map's heights have drifted by, over the mine."""
    known = ramp()
    raised = TopologicalMap(tuple(_raised(one, drift_m) for one in known.tunnels))
    pose_map, pose_odom = np.array([at_m, 0.0, 0.0]), np.array([3.0, -8.0, turned])
    floor = FloorOnMap(raised).about(pose_map, drift_m, pose_odom)
    hits = sees_floor(at_m)
    assert hits[0, 2] > LEAST_M + 0.2  # by its height alone it is taken for a wall
    assert not over_floor(hits, pose_odom, floor, LEAST_M).any()
    stands = hits + np.array([0.0, 0.0, 0.6])
    assert over_floor(stands, pose_odom, floor, LEAST_M).all()
    beside = np.array([[5.0, 2.3, 1.5], [-4.0, -2.3, 1.9]])
    assert over_floor(beside, pose_odom, floor, LEAST_M).all()


def _raised(one: Tunnel, by_m: float) -> Tunnel:
    return Tunnel(
        one.id, one.name, one.ends, one.line_m + np.array([0.0, 0.0, by_m]), one.half_widths_m, one.pose_map_node
    )


def test_of_a_flat_mine_nothing_is_told() -> None:
    floor = FloorOnMap(ramp()).about(np.array([75.0, 0.0, 0.0]), 55.0 * GRADE, np.zeros(3))
    assert len(floor) > 0
    flat = np.column_stack([np.arange(50.0), np.zeros(50), np.zeros(50)])
    level = TopologicalMap((Tunnel("t", "T", ("dead_end", "dead_end"), flat, np.full((50, 2), 2.0), np.zeros(4)),))
    assert len(FloorOnMap(level).about(np.zeros(3), 0.0, np.zeros(3))) == 0
    hits = sees_floor(10.0)
    assert over_floor(hits, np.zeros(3), NO_FLOOR, LEAST_M).all()
    assert len(over_floor(np.zeros((0, 3)), np.zeros(3), floor, LEAST_M)) == 0
    assert len(FloorOnMap(TopologicalMap()).about(np.zeros(3), 0.0, np.zeros(3))) == 0


def test_the_level_above_is_not_the_floor() -> None:
    """Also where both are in sight: the ramp's own floor is nearer in height all along."""
    pose = np.array([10.0, 0.0, 0.0])
    floor = FloorOnMap(ramp(level_above_m=14.0)).about(pose, 0.0, pose)
    assert floor[:, 2].max() < 8.0
    assert not over_floor(sees_floor(10.0), pose, floor, LEAST_M).any()
    assert over_floor(np.array([[6.0, 0.5, 1.2]]), pose, floor, LEAST_M).all()

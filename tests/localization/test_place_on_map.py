"""Where in its node a pose is, on maps whose geometry is known by heart."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.geometry import se2
from lhdmap.localization.place_on_map import Placer
from lhdmap.topology.model import DEAD_END, AccessPoint, TopologicalMap, Tunnel, Waypoint

from tests.topology.maps import intersection, ladder, pose, straight, tunnel

PLACER = Placer(ladder())


def at(x: float, y: float, heading_deg: float) -> np.ndarray:
    return np.array([x, y, math.radians(heading_deg)])


def test_in_a_straight_tunnel() -> None:
    place = PLACER.at(at(26.0, 0.7, 10.0), 0.0, 2.0)
    assert place.node == "t1"
    assert (place.rho_m, place.lateral_m) == pytest.approx((20.0, 0.7))
    assert place.heading_rad == pytest.approx(math.radians(10.0))


def test_in_a_bent_tunnel() -> None:
    """T2 goes 24 m north from (0, 6), 60 m east, and 24 m south."""
    line = np.vstack([straight(pose(0, 6, 0), pose(0, 30, 0))[:-1], straight(pose(0, 30, 0), pose(60, 30, 0))])
    placer = Placer(TopologicalMap(tunnels=(tunnel("T2", (DEAD_END, DEAD_END), line),)))
    first, second = placer.at(at(-0.5, 16.0, 90.0), 0.0, 1.0), placer.at(at(40.0, 29.0, 180.0), 0.0, 1.0)
    assert (first.rho_m, first.lateral_m, first.heading_rad) == pytest.approx((10.0, 0.5, 0.0))
    assert (second.rho_m, second.lateral_m) == pytest.approx((64.0, -1.0))
    assert abs(second.heading_rad) == pytest.approx(math.pi)


def test_beyond_a_tunnels_ends_it_goes_on() -> None:
    line = straight(pose(0, 0, 0), pose(20, 0, 0))
    placer = Placer(TopologicalMap(tunnels=(tunnel("T", (DEAD_END, DEAD_END), line),)))
    assert placer.at(at(-1.5, 0.0, 0.0), 0.0, 1.0).rho_m == pytest.approx(-1.5)
    assert placer.at(at(22.0, 0.3, 0.0), 0.0, 1.0)[1:3] == pytest.approx((22.0, 0.3))


def test_in_an_intersection_it_is_the_nodes_frame() -> None:
    turned = replace(intersection("I1", 10.0, 20.0, 3), pose_map_node=pose(10.0, 20.0, 90.0))
    place = Placer(TopologicalMap(intersections=(turned,))).at(at(9.0, 22.0, 120.0), 0.0, 1.0)
    assert place.node == "i1"
    assert (place.rho_m, place.lateral_m, place.heading_rad) == pytest.approx((2.0, 1.0, math.radians(30.0)))
    assert place.next_point == ""
    assert math.isnan(place.next_m)


def test_the_next_point_in_a_tunnel_is_that_in_the_direction_of_motion() -> None:
    ahead, reverse = PLACER.at(at(26.0, 0.0, 5.0), 0.0, 2.0), PLACER.at(at(26.0, 0.0, 5.0), 0.0, -2.0)
    assert ahead.next_point == "t1.end"
    assert ahead.next_m == pytest.approx(28.0)
    assert reverse.next_point == "t1.start"
    assert reverse.next_m == pytest.approx(20.0)
    turned = PLACER.at(at(26.0, 0.0, 175.0), 0.0, 2.0)
    assert turned.next_point == "t1.start"
    standing = PLACER.at(at(26.0, 0.0, 0.0), 0.0, math.nan)
    assert standing.next_point == "t1.end"


def test_the_next_point_is_told_along_a_bend() -> None:
    """On the way north in T2 its other end lies behind in plan, and is the next point nevertheless."""
    place = PLACER.at(at(0.0, 20.0, 90.0), 0.0, 2.0)
    assert (place.node, place.next_point) == ("t2", "t2.end")
    assert place.next_m == pytest.approx(10.0 + 60.0 + 24.0)


def test_waypoints_count_and_none_is_beyond_the_last() -> None:
    before, beyond = PLACER.at(at(0.0, -20.0, -90.0), 0.0, 1.0), PLACER.at(at(0.0, -28.0, -90.0), 0.0, 1.0)
    assert before.next_point == "w1"
    assert before.next_m == pytest.approx(6.0)
    assert beyond.next_point == ""
    assert math.isnan(beyond.next_m)


@pytest.mark.parametrize(("heading", "speed", "wanted"), [(0, 1, "i1.t1"), (90, 1, "i1.t2"), (90, -1, "i1.t3")])
def test_the_next_point_of_an_intersection_is_straight_ahead(heading: float, speed: float, wanted: str) -> None:
    assert PLACER.at(at(0.3, -0.2, heading), 0.0, speed).next_point == wanted


def test_of_two_points_in_one_direction_the_nearer_is_next() -> None:
    access = AccessPoint("i1.a", "i1", pose(6.0, 0.0, 0.0))
    stop = Waypoint("w", "Stop", "i1", pose(3.0, 0.2, 0.0), "stop")
    placer = Placer(TopologicalMap((), (intersection("I1", 0.0, 0.0, 3),), (access,), (stop,)))
    assert placer.at(at(-1.0, 0.0, 0.0), 0.0, 1.0).next_point == "w"
    assert placer.at(at(3.5, 0.0, 0.0), 0.0, 1.0).next_point == "i1.a"


def two_levels() -> TopologicalMap:
    tunnels = [
        replace(
            tunnel(name, (DEAD_END, DEAD_END), straight(pose(0.0, 0.0, 0.0, z), pose(30.0, 0.0, 0.0, z))),
            pose_map_node=pose(0.0, 0.0, 0.0, z),
        )
        for name, z in (("Low", 0.0), ("High", 8.0))
    ]
    return TopologicalMap(tunnels=tuple(tunnels))


def test_of_two_levels_the_height_decides() -> None:
    placer = Placer(two_levels())
    assert [placer.at(at(10.0, 0.0, 0.0), z, 1.0).node for z in (0.5, 7.0)] == ["low", "high"]
    assert placer.height_m(10.3, 0.0, 0.4) == pytest.approx(0.0, abs=1e-9)
    assert placer.height_m(10.3, 0.0, 7.5) == pytest.approx(8.0, abs=1e-9)


def test_a_tunnel_that_crosses_below_itself_is_told_by_height() -> None:
    """A ramp: a full turn of 15 m radius that comes down by 8 m, over where it began."""
    turn = np.linspace(0.0, 2.0 * math.pi, 120)
    line = np.column_stack([15.0 * np.sin(turn), 15.0 - 15.0 * np.cos(turn), -8.0 * turn / (2.0 * math.pi)])
    placer = Placer(
        TopologicalMap(tunnels=(Tunnel("r", "R", (DEAD_END, DEAD_END), line, np.ones((120, 2)), pose(0, 0, 0)),))
    )
    length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    assert placer.at(at(0.0, 0.0, 0.0), 0.0, 1.0).rho_m == pytest.approx(0.0, abs=0.1)
    assert placer.at(at(0.0, 0.0, 0.0), -8.0, 1.0).rho_m == pytest.approx(length, abs=0.1)


def test_on_an_empty_map_nothing_is_known() -> None:
    place = Placer(TopologicalMap()).at(at(1.0, 2.0, 0.0), 0.0, 1.0)
    assert place.node == ""
    assert math.isnan(place.rho_m)


@given(
    rho=st.floats(0.0, 40.0),
    lateral=st.floats(-2.0, 2.0),
    heading=st.floats(-3.0, 3.0),
    frame=st.tuples(st.floats(-200.0, 200.0), st.floats(-200.0, 200.0), st.floats(-3.1, 3.1)),
)
def test_the_place_is_the_same_wherever_the_tunnel_lies(
    rho: float, lateral: float, heading: float, frame: tuple[float, float, float]
) -> None:
    T = np.array(frame)
    line = np.column_stack([se2.transform(T, np.column_stack([np.arange(0.0, 40.5), np.zeros(41)])), np.zeros(41)])
    placer = Placer(TopologicalMap(tunnels=(tunnel("T", (DEAD_END, DEAD_END), line),)))
    place = placer.at(se2.compose(T, np.array([rho, lateral, heading])), 0.0, 1.0)
    assert (place.rho_m, place.lateral_m, place.heading_rad) == pytest.approx((rho, lateral, heading), abs=1e-6)

"""The truth of topology: counts, ends, access points by closed forms, and where a place is."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lhdmap.machine import Machine
from lhdmap.mine.make_network import make_network
from lhdmap.mine.plan import find_plan, load_plan
from lhdmap.mine.topology import Directory, topology_json

from tests.mine.plans import TEE, lines, network_of

MACHINE = Machine()


def truth(table: dict[str, Any], **more: Any) -> dict[str, Any]:
    return topology_json(network_of(table, **more), MACHINE)


def test_a_tee() -> None:
    told = truth(TEE)
    (one,) = told["intersections"]
    assert (one["name"], one["degree"]) == ("I1", 3)
    tunnels = {tunnel["name"]: tunnel for tunnel in told["tunnels"]}
    assert set(tunnels) == {"A.1", "A.2", "B"}
    assert tunnels["A.1"]["ends"] == ["dead_end", "I1"]
    assert tunnels["B"]["length_m"] == pytest.approx(50.0, abs=0.1)


@pytest.mark.parametrize("angle_deg", [50.0, 70.0, 90.0, 110.0])
def test_where_the_corners_are_left_an_access_point_is_at_the_walls_corner(angle_deg: float) -> None:
    angle = math.radians(angle_deg)
    table = lines(
        ("A", [[0, 0, 0], [100, 0, 0]]), ("B", [[50, 0, 0], [50 + 40 * math.cos(angle), 40 * math.sin(angle), 0]])
    )
    told = truth(table, junction=[{"at": [50, 0, 0], "corner_m": 0.0}])
    half = 2.25
    points = {
        (point["drift"], round(point["heading_deg"])): point for point in told["intersections"][0]["access_points"]
    }
    ahead = (half + half * math.cos(angle)) / math.sin(angle)
    behind = (half - half * math.cos(angle)) / math.sin(angle)
    assert points["A", 0]["position"][0] == pytest.approx(50.0 + ahead, abs=0.06)
    assert points["A", 180]["position"][0] == pytest.approx(50.0 - behind, abs=0.06)
    assert points["B", round(angle_deg)]["at_m"] == pytest.approx(max(ahead, behind), abs=0.06)


def test_two_tunnels_may_join_the_same_intersections() -> None:
    told = topology_json(make_network(load_plan(find_plan("ring"))), MACHINE)
    assert sorted(tunnel["ends"] for tunnel in told["tunnels"]) == [["I1", "I2"]] * 3
    assert [one["degree"] for one in told["intersections"]] == [3, 3]


def test_levels_have_numbers_by_height_or_the_names_of_their_drifts() -> None:
    upper = [("A", [[0, 0, 20], [80, 0, 20]]), ("B", [[40, 0, 20], [40, 50, 20]])]
    lower = [("C", [[0, 0, 0], [80, 0, 0]]), ("D", [[40, 0, 0], [40, 50, 0]])]
    told = truth(lines(*upper, *lower))
    assert {one["name"]: one["level"] for one in told["intersections"]} == {"I1": 1, "I2": 0}
    named = {"drift": [{"name": n, "line_m": line, "level": "805"} for n, line in lower]}
    assert [one["level"] for one in truth(named)["intersections"]] == ["805"]


def test_a_machine_at_a_draw_point_faces_the_pile() -> None:
    told = truth(TEE, place=[{"drift": "B", "kind": "draw_point", "side": "end", "name": "DP"}])
    (place,) = told["places"]
    x, y, z, yaw = place["pose"]
    assert (x, z, yaw) == pytest.approx((40.0, 0.0, math.pi / 2), abs=1e-4)
    assert y == pytest.approx(50.0 - 8.0 - 2.2 - 3.2)


@pytest.mark.parametrize(
    ("point", "node"),
    [
        ((5, 0), "A"),
        ((31, 1), "A"),
        ((33, 1), "I1"),
        ((40, 2), "I1"),
        ((40, 7), "I1"),
        ((41, 9), "B"),
        ((40, 33), "B"),
        ((40, 41), "DP"),
    ],
)
def test_where_a_place_is(point: tuple[float, float], node: str) -> None:
    network = network_of(TEE, place=[{"drift": "B", "kind": "draw_point", "side": "end", "name": "DP"}])
    found = Directory(network).at(np.array([*point, 0.0]))
    assert found.node == node


def test_where_a_place_is_on_its_drift() -> None:
    node, at_m = Directory(network_of(TEE)).at(np.array([60.0, 1.0, 0.0]))
    assert node == "A"
    assert at_m == pytest.approx(60.0, abs=0.13)


def test_levels_above_each_other_are_told_apart() -> None:
    network = network_of(lines(("A", [[0, 0, 0], [80, 0, 0]]), ("B", [[40, -40, 6], [40, 40, 6]])))
    directory = Directory(network)
    assert [directory.at(np.array([40.0, 0.0, z])).node for z in (0.0, 6.0)] == ["A", "B"]

"""Names of nodes: the operator's where they fit, generated ones elsewhere, places within tunnels."""

from __future__ import annotations

import numpy as np
import pytest
from lhdmap.messages import FloatArray
from lhdmap.topology.arcs import Arc
from lhdmap.topology.names import Names, names_of, purpose_of, whereabouts
from lhdmap.topology.nodes import RawMap, RawNode, RawTunnel


def raw(tunnels: int, nodes: int) -> RawMap:
    """Tunnels along x one after the other, 50 m each, intersections of 10 m between them."""
    lines = [
        np.column_stack([np.linspace(60.0 * k, 60.0 * k + 50.0, 51), np.zeros(51), np.zeros(51)])
        for k in range(tunnels)
    ]
    found = [
        RawTunnel(Arc(("dead_end", "dead_end"), line, np.ones((51, 2)), 0, True), line, np.ones((51, 2)), (None, None))
        for line in lines
    ]
    return RawMap([RawNode((0, k), np.array([60.0 * k + 55.0, 0.0, 0.0]), 0.0) for k in range(nodes)], found)


def path(length_m: float) -> FloatArray:
    x = np.arange(0.0, length_m, 0.25)
    return np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])


def named(tunnels: int, nodes: int, words: list[tuple[float, float, str]]) -> Names:
    """`words`: from, to (m) and what the operator said there."""
    parts = raw(tunnels, nodes)
    way = path(60.0 * tunnels - 10.0)
    said = [next((name for low, high, name in words if low <= x < high), "") for x in way[:, 0]]
    return names_of(parts, said, whereabouts(parts, way))


def test_nodes_have_the_operator_s_names() -> None:
    found = named(2, 1, [(0.0, 51.0, "T7"), (51.0, 59.0, "X1"), (59.0, 110.0, "T9")])
    assert found.tunnels == ["T7", "T9"]
    assert found.nodes == ["X1"]
    assert not found.places


def test_what_was_not_named_gets_a_name_that_nothing_has() -> None:
    found = named(3, 2, [(60.0, 110.0, "T1")])
    assert found.tunnels == ["T2", "T1", "T3"]
    assert found.nodes == ["I1", "I2"]


def test_a_name_for_several_tunnels_is_numbered() -> None:
    found = named(2, 1, [(0.0, 51.0, "S1"), (51.0, 59.0, "I4"), (59.0, 110.0, "S1")])
    assert found.tunnels == ["S1.1", "S1.2"]
    assert found.nodes == ["I4"]


def test_a_name_said_a_moment_longer_does_not_name_the_intersection() -> None:
    """He said the tunnel's name until after its end: the intersection keeps its own."""
    found = named(2, 1, [(0.0, 56.0, "A"), (56.0, 110.0, "B")])
    assert found.tunnels == ["A", "B"]
    assert found.nodes == ["I1"]


def test_a_place_within_a_tunnel_is_a_place() -> None:
    found = named(1, 0, [(0.0, 20.0, "T1"), (20.0, 30.0, "PB1"), (30.0, 50.0, "T1")])
    assert found.tunnels == ["T1"]
    place = found.places[0]
    assert (place.name, place.tunnel) == ("PB1", 0)
    assert path(50.0)[place.rows, 0].min() == 20.0
    assert path(50.0)[place.rows, 0].max() == 29.75


@pytest.mark.parametrize(
    ("name", "purpose"),
    [
        ("DP1", "draw_point"),
        ("OP2", "dump"),
        ("P1", "park"),
        ("TB1", "turning_bay"),
        ("PB3", "passing_bay"),
        ("T1", None),
    ],
)
def test_what_a_place_is_for(name: str, purpose: str | None) -> None:
    assert purpose_of(name) == purpose


def test_whereabouts_are_tunnels_and_intersections_by_place_and_height() -> None:
    parts = raw(2, 1)
    places = np.array([[20.0, 1.0, 0.0], [55.0, -1.0, 0.0], [80.0, 0.0, 0.0]])
    assert whereabouts(parts, places).tolist() == [0, -1, 1]

"""What is different between two versions, on maps made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lhdmap.topology.sheet import FREE, OCCUPIED, UNKNOWN, Sheet
from lhdmap.update.difference import difference, walls_between

from tests.topology.maps import intersection, ladder, straight, tunnel

CELL_M = 0.2


def drift(
    rng: np.random.Generator | None = None, *, wall_at_m: float | None = None, open_at_m: float | None = None
) -> Sheet:
    """A drift of 60 x 5 m along x; with `rng` its walls are 0.2 m rough; with a wall across it, or an opening to the north."""
    rows, columns = 60, 320
    cells = np.full((rows, columns), UNKNOWN, np.uint8)
    for column in range(10, 310):
        low, high = 18, 43
        if rng is not None:
            low, high = low + int(rng.integers(-1, 2)), high + int(rng.integers(-1, 2))
        cells[low:high, column] = FREE
        cells[[low - 1, high], column] = OCCUPIED
    if open_at_m is not None:
        at = round(open_at_m / CELL_M)
        cells[43 - 1 : 58, at : at + 22] = FREE
    if wall_at_m is not None:
        at = round(wall_at_m / CELL_M)
        cells[18:43, at : at + 2] = OCCUPIED
    return Sheet(cells, np.zeros(2), CELL_M)


def test_roughness_and_noise_alone_are_no_difference() -> None:
    found = walls_between(drift(np.random.default_rng(1)), drift(np.random.default_rng(2)))
    assert len(found.came_m) == len(found.went_m) == 0
    assert found.area_new_m2 < 0.15 * 60 * 2


def test_a_wall_across_the_drift_came_and_in_the_other_order_went() -> None:
    came = walls_between(drift(), drift(wall_at_m=30.0))
    assert np.median(came.came_m, axis=0) == pytest.approx([30.2, 6.1], abs=0.3)
    assert len(came.came_m) * CELL_M**2 == pytest.approx(
        2 * CELL_M * (5.0 - 1.2), rel=0.15
    )  # what is 0.6 m from old walls
    assert not len(came.went_m)
    went = walls_between(drift(wall_at_m=30.0), drift())
    assert len(went.went_m) == len(came.came_m)
    assert not len(went.came_m)


def test_an_opening_is_a_wall_that_went_and_new_room() -> None:
    found = walls_between(drift(), drift(open_at_m=20.0))
    assert np.median(found.went_m, axis=0) == pytest.approx([22.2, 8.7], abs=0.3)
    assert found.area_new_m2 == pytest.approx(22 * 14 * CELL_M**2, rel=0.1)


def test_sheets_of_other_size_and_place_are_compared_where_both_are() -> None:
    whole = drift(wall_at_m=30.0)
    part = Sheet(whole.cells[:, 100:200].copy(), np.array([100 * CELL_M, 0.0]), CELL_M)
    found = walls_between(whole, part)
    assert not len(found.came_m)
    assert not len(found.went_m)


def test_the_same_map_has_no_difference() -> None:
    table, walls = difference(ladder(), replace(ladder(), version=2), ([drift()], [drift()]))
    assert table["to_version"] == 2
    lists = ("tunnels_new", "tunnels_gone", "tunnels_changed", "nodes_moved", "nodes_new", "waypoints_new")
    assert {name: table[name] for name in lists} == {name: [] for name in lists}
    assert not len(walls[0].came_m)


def test_a_new_tunnel_a_moved_node_and_a_narrower_tunnel_are_told() -> None:
    old = ladder()
    line = straight(np.array([60.0, -6.0, 0.0, 0.0]), np.array([60.0, -40.0, 0.0, 0.0]))
    narrow = replace(old.tunnels[0], half_widths_m=old.tunnels[0].half_widths_m - 0.5)
    moved = intersection("I2", 61.0, 0.0, 3)
    new = replace(
        old,
        tunnels=(narrow, *old.tunnels[1:], tunnel("T9", ("i2", "dead_end"), line)),
        intersections=(old.intersections[0], moved),
        version=2,
    )
    table, _ = difference(old, new, ([drift()], [drift()]))
    assert table["tunnels_new"] == ["T9"]
    assert table["tunnels_gone"] == []
    assert [one["name"] for one in table["tunnels_changed"]] == ["T1"]
    assert table["tunnels_changed"][0]["width_min_m"] == [4.5, 3.5]
    assert table["nodes_moved"] == [{"name": "I2", "by_m": 1.0, "degree": [2, 3]}]
    gone, _ = difference(new, old, ([drift()], [drift()]))
    assert gone["tunnels_gone"] == ["T9"]


def test_without_free_space_before_only_the_graph_is_compared() -> None:
    table, walls = difference(ladder(), ladder(), ([], [drift()]))
    assert table["walls"] == walls == []

"""Levels above each other: where they are parted, and that a ramp crossing above makes no junction."""

from __future__ import annotations

import numpy as np
import pytest
from lhdmap.messages import FloatArray
from lhdmap.topology.build import topology_of
from lhdmap.topology.levels import boundaries_m, cuts_of, sheets_of
from lhdmap.topology.settings import TopologySettings

from tests.topology.drawn import World, drive, steps

RAMP = [(0.0, 0.0, 0.0), (60.0, 0.0, 0.0), (60.0, 50.0, 3.5), (30.0, 50.0, 8.0), (30.0, -40.0, 12.0)]
"""A level drift, and a ramp from its end that climbs over it at (30, 0), 10 m above."""


def poses(line: list[tuple[float, float, float]]) -> FloatArray:
    points = steps(line)
    way = np.gradient(points[:, :2], axis=0)
    return np.column_stack([points, np.arctan2(way[:, 1], way[:, 0])])


def test_a_level_drive_is_one_sheet() -> None:
    flat = poses([(0, 0, 0), (60, 0, 0.5), (60, 50, 1.0), (30, 50, 1.0), (30, -40, 1.5)])
    assert boundaries_m(flat, 3.0) == []
    assert not sheets_of(flat, []).any()


def test_a_drive_over_itself_is_cut_between_both_heights() -> None:
    way = poses(RAMP)
    bounds = boundaries_m(way, 3.0)
    assert len(bounds) == 1
    assert 0.5 < bounds[0] < 9.0
    sheets = sheets_of(way, bounds)
    cuts = cuts_of(way, sheets)
    assert len(cuts) == 1
    assert cuts[0].lower == 0
    assert cuts[0].pose[2] == pytest.approx(bounds[0], abs=0.3)
    over = np.linalg.norm(way[:, :2] - [30.0, 0.0], axis=1) < 5.0
    assert set(sheets[over & (way[:, 2] < 3.0)]) == {0}
    assert set(sheets[over & (way[:, 2] > 6.0)]) == {1}


def test_back_and_forth_through_a_boundary_is_one_cut() -> None:
    way = poses(RAMP + RAMP[-2::-1])
    bounds = boundaries_m(way, 3.0)
    assert len(cuts_of(way, sheets_of(way, bounds))) == len(bounds) == 1


def test_in_a_spiral_no_sheet_has_two_turns_above_each_other() -> None:
    """Three turns, 8 m a turn."""
    turn = [(0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0)]
    way = poses([(*turn[k % 4], 2.0 * k) for k in range(13)])
    sheets = sheets_of(way, boundaries_m(way, 3.0))
    for number in np.unique(sheets):
        own = way[sheets == number]
        apart = np.linalg.norm(own[:, None, :2] - own[None, :, :2], axis=2)
        rise = np.abs(own[:, None, 2] - own[None, :, 2])
        assert not ((apart < 4.0) & (rise > 4.0)).any()


def test_where_a_ramp_crosses_above_there_is_no_junction() -> None:
    """The same plan without heights has one, with four arms."""
    lower, upper = (
        World([([(0, 0), (60, 0), (60, 50), (30, 50)], 4.6)]),
        World([([(60, 20), (60, 50), (30, 50), (30, -40)], 4.6)]),
    )
    seen = drive([lower, upper], RAMP, world_at=((0.0, 0), (100.0, 1)))
    found = topology_of(seen, TopologySettings())
    assert not found.map.intersections
    assert len(found.map.tunnels) == 1
    assert len(found.sheets) == 2
    assert found.map.tunnels[0].length_m == pytest.approx(230.0, abs=8.0)
    assert found.map.tunnels[0].grade_max_pct == pytest.approx(15.0, abs=1.5)
    flat = World([([(0, 0), (60, 0), (60, 50), (30, 50), (30, -40)], 4.6)])
    crossed = topology_of(drive(flat, [point[:2] for point in RAMP]), TopologySettings())
    assert [node.degree for node in crossed.map.intersections] == [4]

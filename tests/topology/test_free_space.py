"""Free space from beams, views thinned as they come, islands filled."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.messages import FloatArray
from lhdmap.topology.free_space import filled, free_space
from lhdmap.topology.settings import TopologySettings
from lhdmap.topology.sheet import FREE, OCCUPIED, UNKNOWN, Sheet
from lhdmap.topology.views import STEP_M, Fan, Views, thin

ONE = np.zeros(1, dtype=np.int64)


def fan(angles: FloatArray, ranges: FloatArray, origin: tuple[float, float] = (0.0, 0.0)) -> Fan:
    x, y = origin[0] + ranges * np.cos(angles), origin[1] + ranges * np.sin(angles)
    return Fan(np.array(origin), np.column_stack([x, y, np.ones(len(x))]).astype(np.float32))


def at(sheet: Sheet, *points: tuple[float, float]) -> list[int]:
    cells = sheet.at(np.array(points))
    return [int(sheet.cells[row, column]) for row, column in cells]


def test_beams_are_free_up_to_their_hits_and_tell_nothing_beyond() -> None:
    angles = np.radians(np.arange(-90.0, 90.5, 0.5))
    sheet = free_space(
        [fan(angles, np.full(361, 8.0))], np.array([[100.0, 50.0, 3.0, 0.0]]), ONE, 0.2, TopologySettings()
    )
    assert at(sheet, (104.0, 50.0), (107.5, 50.0), (100.5, 57.0)) == [FREE] * 3
    assert at(sheet, (108.05, 50.05), (100.0 + 8.02 * math.cos(0.5), 50.0 + 8.02 * math.sin(0.5))) == [OCCUPIED] * 2
    assert at(sheet, (109.0, 50.0), (96.0, 50.0)) == [UNKNOWN] * 2
    assert sheet.height_m == 3.0
    expected = 0.5 * math.pi * (8.0 - 0.14) ** 2
    assert np.count_nonzero(sheet.cells == FREE) * 0.04 == pytest.approx(expected, rel=0.03)


def test_the_machine_s_pose_turns_the_fan() -> None:
    """Seen to the machine's left: that is in -x when it drives to +y, and the scanner is a metre ahead of base_link."""
    angles = np.radians(np.arange(80.0, 100.5, 0.5))
    seen = fan(angles, np.full(41, 5.0), (1.0, 0.0))
    sheet = free_space([seen], np.array([[0.0, 0.0, 0.0, 0.5 * math.pi]]), ONE, 0.1, TopologySettings())
    assert at(sheet, (-3.0, 1.0), (-5.0, 1.0), (3.0, 1.0), (-3.0, -1.0)) == [FREE, OCCUPIED, UNKNOWN, UNKNOWN]


def test_a_gap_between_beams_stays_unknown() -> None:
    """A tunnel that goes on beyond the range: between the beams at its sides nothing came back."""
    angles = np.radians(np.concatenate([np.arange(-60.0, -10.0, 0.5), np.arange(10.5, 60.0, 0.5)]))
    sheet = free_space([fan(angles, np.full(len(angles), 9.0))], np.zeros((1, 4)), ONE, 0.2, TopologySettings())
    assert at(sheet, (6.0, 0.0), (6.0, 3.0), (6.0, -3.0)) == [UNKNOWN, FREE, FREE]


def test_nothing_is_drawn_beyond_the_reach() -> None:
    angles = np.radians(np.arange(-10.0, 10.5, 0.5))
    settings = TopologySettings(reach_m=10.0)
    sheet = free_space([fan(angles, np.full(41, 30.0))], np.zeros((1, 4)), ONE, 0.2, settings)
    assert at(sheet, (9.5, 0.0), (10.5, 0.0)) == [FREE, UNKNOWN]


def test_one_stray_hit_is_no_wall_where_many_saw_free_space() -> None:
    angles = np.radians(np.arange(-90.0, 90.5, 0.5))
    far = [fan(angles, np.full(361, 8.0)) for _ in range(8)]
    ranges = np.full(361, 8.0)
    ranges[180] = 4.0
    poses = np.zeros((9, 4))
    sheet = free_space([*far, fan(angles, ranges)], poses, np.arange(9), 0.2, TopologySettings())
    assert at(sheet, (4.0, 0.05)) == [FREE]


def test_an_island_is_filled_by_its_diagonal_not_by_its_area() -> None:
    cells = np.full((200, 400), FREE, np.uint8)
    cells[[0, -1], :] = cells[:, [0, -1]] = OCCUPIED
    cells[40:60, 40:62] = OCCUPIED  # 4.0 x 4.4 m: 5.9 m
    cells[40:73, 100:133] = UNKNOWN  # 6.6 x 6.6 m: 9.3 m
    cells[150, 200:240] = OCCUPIED  # a thin wall of 8 m
    found = filled(cells, 0.2, 6.5)
    assert found[50, 50]
    assert not found[50, 120]
    assert not found[150, 220]
    assert not found[0, 10]


def test_neighbouring_hits_are_thinned_but_not_the_ends_before_a_leap() -> None:
    x = np.arange(0.0, 2.0, 0.01)
    wall = np.column_stack([x, np.full(len(x), 2.0), np.zeros(len(x))])
    behind = wall + np.array([2.5, 4.0, 0.0])
    kept = thin(np.vstack([wall, behind]))
    steps = np.linalg.norm(np.diff(kept, axis=0), axis=1)
    assert len(kept) < 0.15 * 2 * len(x) + 4
    assert np.any(np.all(np.isclose(kept, wall[-1], atol=1e-5), axis=1))  # the last one of the near wall
    assert steps.max() == pytest.approx(math.hypot(0.51, 4.0), abs=0.02)
    assert not len(thin(np.zeros((0, 3))))


def _kept(poses: list[tuple[float, float, float]], height_m: float = 0.0) -> list[int]:
    views, found = Views(), []
    for row, pose in enumerate(poses):
        if views.wants(np.array(pose), height_m):
            found.append(row)
            views.add(row, [(np.zeros(2), np.array([[1.0, 1.0, 0.5]]))])
    assert len(views) == len(found)
    return found


def test_views_are_kept_each_half_metre_and_grow_with_the_map() -> None:
    once = [(0.1 * k, 0.0, 0.0) for k in range(101)]
    kept = _kept(once)
    assert kept[0] == 0
    assert abs(len(kept) - 10.0 / STEP_M) <= 1
    assert len(_kept((once + once[::-1]) * 6)) < 5 * len(kept)


def test_a_view_without_a_hit_is_none() -> None:
    views = Views()
    views.add(0, [(np.zeros(2), np.zeros((0, 3)))])
    assert not len(views)
    views.add(1, [(np.zeros(2), np.zeros((0, 3))), (np.ones(2), np.ones((2, 3)))])
    assert [len(view.fans) for view in views] == [1]

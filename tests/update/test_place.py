"""Where a drive lies in a map, on maps that are drawn."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from lhdmap.messages import FloatArray
from lhdmap.topology.sheet import FREE, OCCUPIED, Sheet
from lhdmap.update.place import placings

CELL_M = 0.2
WIDTH_M = 4.6
BENT = np.array([[0.0, 0.0], [50.0, 0.0], [62.0, 18.0], [62.0, 48.0], [30.0, 60.0]])
BRANCH = np.array([[25.0, 0.0], [18.0, -24.0]])


def sheet_of(*lines: FloatArray) -> Sheet:
    """Free drifts along centre lines, with walls of one cell."""
    points = np.vstack(lines)
    origin = np.floor(points.min(axis=0)) - 8.0
    size = np.ceil((points.max(axis=0) - origin + 8.0) / CELL_M).astype(int)
    free = np.zeros(size[::-1].tolist(), np.uint8)
    for line in lines:
        pixels = np.round((line - origin) / CELL_M).astype(np.int32)
        cv2.polylines(free, [pixels.reshape(-1, 1, 2)], isClosed=False, color=1, thickness=round(WIDTH_M / CELL_M))
    walls = cv2.dilate(free, np.ones((3, 3), np.uint8)) - free
    return Sheet(np.where(free > 0, FREE, np.where(walls > 0, OCCUPIED, 0)).astype(np.uint8), origin, CELL_M)


def turned(line: FloatArray, pose: FloatArray) -> FloatArray:
    """The line in the frame that lies at `pose` (3,) in the map."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    out: FloatArray = (line - pose[:2]) @ np.array([[c, -s], [s, c]])
    return out


@pytest.mark.parametrize("heading_deg", [0.0, 37.0, -140.0, 180.0])
def test_a_drive_is_found_from_any_heading(heading_deg: float) -> None:
    pose = np.array([30.0, -12.0, math.radians(heading_deg)])
    best, *_ = placings([sheet_of(BENT, BRANCH)], sheet_of(turned(BENT[1:], pose), turned(BRANCH, pose)))
    assert best.pose_map_drive[:2] == pytest.approx(pose[:2], abs=2.5)  # 2° over 50 m; scans do the rest
    assert abs(math.remainder(best.pose_map_drive[2] - pose[2], 2.0 * math.pi)) < math.radians(3.0)
    assert best.score > 0.5


def test_a_drive_elsewhere_is_not_found() -> None:
    zigzag = np.array([[0.0, 0.0], [14.0, 14.0], [28.0, 0.0], [42.0, 14.0], [56.0, 0.0], [70.0, 14.0]])
    found = placings([sheet_of(BENT)], sheet_of(zigzag))
    assert not found or found[0].score < 0.45


def test_two_parts_that_are_alike_are_both_named() -> None:
    hook = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 15.0], [32.0, 15.0]])
    first, second, *_ = placings([sheet_of(hook, hook + np.array([60.0, 0.0]))], sheet_of(hook))
    assert second.score > 0.9 * first.score
    assert abs(first.pose_map_drive[0] - second.pose_map_drive[0]) == pytest.approx(60.0, abs=2.0)


def test_who_knows_where_it_begins_gets_that_one() -> None:
    hook = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 15.0], [32.0, 15.0]])
    found = placings([sheet_of(hook, hook + np.array([60.0, 0.0]))], sheet_of(hook), np.array([57.0, 3.0, 0.1]))
    assert found[0].pose_map_drive[0] == pytest.approx(60.0, abs=1.0)
    assert all(abs(one.pose_map_drive[0] - 60.0) < 15.0 for one in found)


def test_the_level_is_told() -> None:
    sheets = [sheet_of(np.array([[0.0, 0.0], [90.0, 0.0]])), sheet_of(BENT, BRANCH)]
    assert placings(sheets, sheet_of(BENT))[0].sheet == 1


def test_hardly_any_walls_are_nowhere() -> None:
    empty = Sheet(np.zeros((40, 40), np.uint8), np.zeros(2), CELL_M)
    assert placings([sheet_of(BENT)], empty) == []
    assert placings([empty], sheet_of(BENT)) == []

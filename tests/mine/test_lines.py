"""Centre lines: corners are arcs of the radius asked for, lengths and ends are those of the geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from lhdmap.errors import ConfigError
from lhdmap.mine.biarc import biarc
from lhdmap.mine.polyline import on_line, rounded_line


def test_a_right_angle_becomes_a_quarter_circle() -> None:
    line = rounded_line(np.array([[0.0, 0, 0], [50, 0, 0], [50, 40, 0]]), 12.0, "T")
    assert line.length_m == pytest.approx(38.0 + 12.0 * math.pi / 2 + 28.0, abs=1e-9)
    on_arc = (line.s_m > 38.0) & (line.s_m < 38.0 + 12.0 * math.pi / 2)
    distance = np.hypot(line.x_m[on_arc] - 38.0, line.y_m[on_arc] - 12.0)
    assert distance == pytest.approx(12.0, abs=1e-9)
    assert line.at(np.array([line.length_m]))[0] == pytest.approx([50.0, 40.0, 0.0, math.pi / 2], abs=1e-9)


def test_close_corners_get_what_radius_there_is_room_for() -> None:
    line = rounded_line(np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [20, 10, 0]]), 30.0, "T")
    assert np.abs(line.curvature_pm).max() == pytest.approx(1.0 / 4.8, rel=1e-6)


def test_a_grade_changes_gradually_and_the_ends_stay() -> None:
    line = rounded_line(np.array([[0.0, 0, 1], [60, 0, 1], [140, 0, 11]]), 12.0, "T")
    grade = np.diff(line.z_m) / np.diff(line.s_m)
    assert line.z_m[[0, -1]] == pytest.approx([1.0, 11.0], abs=1e-9)
    assert grade.max() == pytest.approx(0.125, abs=1e-6)
    assert np.abs(np.diff(grade)).max() < 0.125 / 500  # over 6 m


@pytest.mark.parametrize(
    ("points", "told"),
    [
        ([[0, 0, 0], [0, 0, 5]], "points 1 and 2 are the same place"),
        ([[0, 0, 0], [50, 0, 0], [0, 1, 0]], "turns by 179° at point 2"),
    ],
)
def test_lines_that_none_can_drive_are_refused(points: list[list[float]], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        rounded_line(np.array(points, dtype=float), 12.0, "T")


@settings(deadline=None)
@given(st.floats(-30, 30), st.floats(-30, 30), st.floats(-3, 3), st.floats(-3, 3))
def test_a_biarc_leads_from_pose_to_pose(x: float, y: float, start: float, end: float) -> None:
    assume(math.hypot(x, y) > 1.0)
    a, b = np.array([0.0, 0.0, 0.0, start]), np.array([x, y, 1.0, end])
    try:
        line = biarc(a, b)
    except ValueError:
        return
    assert line.at(np.array([line.length_m]))[0, :3] == pytest.approx([x, y, 1.0], abs=1e-6)
    turned = math.remainder(float(line.heading_rad[-1]) - end, 2 * math.pi)
    assert turned == pytest.approx(0.0, abs=1e-6)
    assert line.heading_rad[0] == pytest.approx(start, abs=1e-9)
    assume(np.abs(line.curvature_pm).max() < 10.0)  # else an arc is shorter than a step
    steps = np.hypot(np.diff(line.x_m), np.diff(line.y_m))
    assert steps == pytest.approx(np.diff(line.s_m), rel=3e-2, abs=1e-6)


def test_a_biarc_between_poses_of_one_circle_is_that_circle() -> None:
    line = biarc(np.array([0.0, 0, 0, 0]), np.array([8.0, 8.0, 0.0, math.pi / 2]))
    assert line.length_m == pytest.approx(8.0 * math.pi / 2, abs=1e-9)
    assert line.curvature_pm == pytest.approx(1.0 / 8.0, abs=1e-9)


def test_places_on_a_line_are_found_in_space() -> None:
    line = rounded_line(np.array([[0.0, 0, 0], [100, 0, 10]]), 12.0, "T")
    assert on_line(line, np.array([[30.0, 2.0, 3.0]]))[0] == pytest.approx(30.0, abs=0.1)

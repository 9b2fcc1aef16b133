"""n_y of walls and a pile made of formulas, seen in any direction: the signs of the paper's Fig. 10."""

from __future__ import annotations

import numpy as np
import pytest
from lhdmap.messages import FloatArray
from lhdmap.pile.result import PileReport, Snapshot
from lhdmap.report import charts
from lhdmap.report.pile_charts import Ahead
from lhdmap.report.pile_normals import across_colours, normal_cloud, normals_chart

from tests.report.test_pile_page import _map, pile


def _report() -> PileReport:
    """Return the pile of 45 degrees between upright walls and before it level floor."""
    x, z = (a.ravel() for a in np.meshgrid(np.arange(-6.0, 0.0, 0.1), np.arange(0.0, 1.6, 0.1)))
    u, v = (a.ravel() for a in np.meshgrid(np.arange(-6.0, 0.0, 0.1), np.arange(-1.9, 2.0, 0.1)))
    parts = [np.column_stack([x, np.full(len(x), side), z]) for side in (2.0, -2.0)]
    parts.append(np.column_stack([u, v, np.zeros(len(u))]))
    around = np.array([_map(*row) for row in np.concatenate(parts).tolist()])
    return PileReport(None, Snapshot(0, 15.0, pile()), around_m=around)


@pytest.fixture(scope="module")
def found() -> tuple[FloatArray, FloatArray]:
    report = _report()
    cloud = normal_cloud(report, pile())
    return Ahead.of(pile()).local(cloud.points_m), cloud.across


def test_left_wall_is_negative_and_right_wall_positive(found: tuple[FloatArray, FloatArray]) -> None:
    local, across = found
    wall = (np.abs(local[:, 1]) > 1.99) & (local[:, 2] > 0.8) & (local[:, 0] < -1.0)
    assert wall.sum() > 100
    np.testing.assert_allclose(across[wall], -np.sign(local[wall, 1]), atol=0.02)


def test_pile_and_floor_are_near_zero(found: tuple[FloatArray, FloatArray]) -> None:
    local, across = found
    pile_or_floor = np.abs(local[:, 1]) < 1.1
    assert pile_or_floor.sum() > 300
    np.testing.assert_allclose(across[pile_or_floor], 0.0, atol=0.02)


def test_low_is_blue_and_high_is_red() -> None:
    rgba = across_colours(np.array([-1.0, 0.0, 1.0]))
    red, blue = (rgba >> 24).astype(int), (rgba >> 8 & 0xFF).astype(int)
    assert blue[0] > red[0] + 50
    assert abs(blue[1] - red[1]) < 10
    assert red[2] > blue[2] + 50


def test_picture_shows_every_hit_before_the_eye_and_the_limits() -> None:
    with charts.styled():
        figure = normals_chart(_report(), pile())
    (axes,) = (one for one in figure.axes if one.get_legend() is not None)
    marks = np.asarray(axes.collections[0].get_offsets())
    assert len(marks) > 1000
    assert np.isfinite(marks).all()
    notes = {note.get_text(): note for note in axes.texts}
    left, right = (notes[name].xy[0] for name in ("E_L", "E_R"))  # type: ignore[attr-defined]
    assert left < 0.0 < right


def test_the_axes_that_n_y_is_said_in_are_drawn() -> None:
    """Seen from behind the machine, y points to the left and z up."""
    with charts.styled():
        figure = normals_chart(_report(), pile())
    (axes,) = (one for one in figure.axes if one.get_legend() is not None)
    places = {note.get_text(): note.get_position() for note in axes.texts if note.get_text() in ("x", "y", "z")}
    assert set(places) == {"x", "y", "z"}
    assert places["y"][0] < min(places["x"][0], places["z"][0]) - 0.01
    assert places["z"][1] > places["y"][1] + 0.01
    assert any("n_y: left wall -1" in one.get_ylabel() for one in axes.child_axes)

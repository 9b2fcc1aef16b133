"""The wall map against analytic walls: lines, layers in height, the window that wraps around."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.surface_map import LAYER_M, LINE, SurfaceMap, empty_map, fit_line, insert, insert_all

CELL_M = 0.025
CELLS = 256
ROOM = np.zeros(8)


def wall(at_m: tuple[float, float], angle_rad: float, height_m: float = 0.01) -> FloatArray:
    """Return hits each 5 mm along a straight wall of 1 m through a point."""
    along = np.arange(-0.5, 0.5, 0.005)
    return np.column_stack(
        [at_m[0] + along * math.cos(angle_rad), at_m[1] + along * math.sin(angle_rad), np.full(along.size, height_m)]
    )


def mapped(*walls: FloatArray) -> SurfaceMap:
    map_ = empty_map(CELL_M, CELLS)
    for hits in walls:
        insert_all(map_, hits, 50.0)
    return map_


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-100.0, 100.0),
    st.floats(-100.0, 100.0),
    st.floats(-math.pi, math.pi),
    st.floats(-0.02, 0.02),
    st.floats(-100.0, 100.0),
)
@example(0.0, 0.0, 2.359375, 0.0, 0.01)
@example(
    -1.0, -1.0, 0.0, 0.0, -0.5
)  # a decline with everything behind and beside the start: once no wall was found there
@example(0.0, 0.0, 0.0, 0.0, 11 * LAYER_M)  # between two layers
def test_a_straight_wall_is_found_as_it_is(x: float, y: float, angle: float, beside: float, height: float) -> None:
    """A wall along the diagonal of the cells fills the fewest: 3.7 effective ones."""
    map_ = mapped(wall((x, y), angle, height))
    line = np.zeros(LINE)
    normal = np.array([-math.sin(angle), math.cos(angle)])
    at = np.array([x, y]) + beside * normal
    assert fit_line(map_.fine, (at[0], at[1], height), False, (3.5, 0.0), ROOM, line)
    assert abs(abs(line[2:4] @ normal) - 1.0) < 1e-4
    assert (at - line[:2]) @ line[2:4] == pytest.approx(math.copysign(beside, line[2:4] @ normal * beside), abs=5e-4)
    assert line[4] < 1e-5
    assert line[5] >= 3.5


def test_no_line_where_there_are_no_hits_nor_in_a_crowd() -> None:
    line = np.zeros(LINE)
    assert not fit_line(mapped(wall((0.0, 0.0), 0.0)).fine, (3.0, 1.0, 0.01), False, (4.0, 0.0), ROOM, line)
    crowd = np.column_stack([np.random.default_rng(0).uniform(-0.1, 0.1, (400, 2)), np.full(400, 0.01)])
    assert not fit_line(mapped(crowd).fine, (0.0, 0.0, 0.01), False, (4.0, 0.0), ROOM, line)


def test_a_clot_of_hits_has_no_direction() -> None:
    """Few hits on a far face, scattered by noise along the beams, look like a line anywhere between; a true wall stays one."""
    noise_m, at = 0.012, (0.0, 0.0, 0.01)
    rng = np.random.default_rng(4)
    cluster = np.column_stack([rng.normal(0.0, 2.0 * noise_m, 12), rng.normal(0.0, noise_m, 12), np.full(12, 0.01)])
    line, plain = np.zeros(LINE), np.zeros(LINE)
    assert fit_line(mapped(cluster).fine, at, False, (3.0, 0.0), ROOM, plain)
    assert fit_line(mapped(cluster).fine, at, False, (3.0, (1.5 * noise_m) ** 2), ROOM, line)
    assert plain[4] < noise_m**2
    assert line[4] > (4.0 * noise_m) ** 2
    straight = mapped(wall((0.0, 0.0), 0.0))
    assert fit_line(straight.fine, at, False, (3.0, 0.0), ROOM, plain)
    assert fit_line(straight.fine, at, False, (3.0, (1.5 * noise_m) ** 2), ROOM, line)
    assert line.tolist() == plain.tolist()


def test_a_corner_that_scatters_more_than_noise_is_no_clot() -> None:
    corner = np.concatenate([wall((0.0, 0.0), 0.0)[:40], wall((0.0, 0.0), 0.9)[40:]])
    line, plain = np.zeros(LINE), np.zeros(LINE)
    found = [
        fit_line(mapped(corner).fine, (0.0, 0.0, 0.01), False, (3.0, limit), ROOM, out)
        for limit, out in ((0.0, plain), (0.005**2, line))
    ]
    assert found == [True, True]
    assert line[4] == plain[4]


@pytest.mark.parametrize(("windows_x", "windows_y"), [(1, 0), (0, 1), (-1, 1), (3, -2)])
def test_places_one_window_apart_do_not_mix(windows_x: int, windows_y: int) -> None:
    window_m = CELL_M * CELLS
    map_, line = empty_map(CELL_M, CELLS), np.zeros(LINE)
    insert(map_.fine, wall((0.5, 0.5), 0.0), 50.0)
    away = (0.5 + windows_x * window_m, 0.5 + windows_y * window_m)
    assert not fit_line(map_.fine, (*away, 0.01), False, (4.0, 0.0), ROOM, line)
    insert(map_.fine, wall(away, math.pi / 2), 50.0)
    assert fit_line(map_.fine, (*away, 0.01), False, (4.0, 0.0), ROOM, line)
    assert abs(line[2]) > 0.999  # the new wall's normal; none of the old one's hits is in it
    assert (line[:2] - away) @ line[2:4] == pytest.approx(0.0, abs=1e-3)


def test_heights_a_layer_apart_are_walls_of_their_own() -> None:
    low, high = 0.5 * LAYER_M, 3.5 * LAYER_M
    map_, line = mapped(wall((0.0, 0.0), 0.0, low), wall((0.0, 0.04), 0.0, high)), np.zeros(LINE)
    assert fit_line(map_.fine, (0.0, 0.0, low), True, (4.0, 0.0), ROOM, line)
    assert line[1] == pytest.approx(0.0, abs=1e-3)
    assert fit_line(map_.fine, (0.0, 0.04, high), True, (4.0, 0.0), ROOM, line)
    assert line[1] == pytest.approx(0.04, abs=1e-3)


@pytest.mark.parametrize("lower_m", [-0.03, 0.0, 0.02, 0.04])
def test_a_line_says_by_how_much_its_hits_lie_lower(lower_m: float) -> None:
    """What a lean of the wall makes of that height is the match's to eliminate: the line itself does not guess."""
    map_, line = mapped(wall((0.0, 0.0), 0.0, 0.06)), np.zeros(LINE)
    assert fit_line(map_.fine, (0.0, 0.0, 0.06 + lower_m), True, (4.0, 0.0), ROOM, line)
    assert line[7] == pytest.approx(lower_m, abs=1e-6)
    assert line[1] == pytest.approx(0.0, abs=1e-6)


def test_hits_that_are_not_numbers_stay_out() -> None:
    map_, line = mapped(wall((0.0, 0.0), 0.0), np.array([[np.nan, 0.0, 0.0], [np.inf, 0.0, 0.0]])), np.zeros(LINE)
    assert fit_line(map_.fine, (0.0, 0.0, 0.01), False, (4.0, 0.0), ROOM, line)
    assert np.isfinite(map_.fine.hits).all()


def test_the_oldest_places_are_forgotten_when_the_blocks_are_used_up() -> None:
    """A drive through more places than there are blocks, one layer of height after the other, keeps the newest."""
    map_, line = empty_map(CELL_M, 32), np.zeros(LINE)
    assert len(map_.fine.owners) == 16
    for layer in range(40):
        insert(map_.fine, wall((0.1, 0.1), 0.3, (layer + 0.5) * LAYER_M)[90:110], 50.0)
    newest, oldest = (0.1, 0.1, 39.5 * LAYER_M), (0.1, 0.1, 0.5 * LAYER_M)
    assert fit_line(map_.fine, newest, False, (2.0, 0.0), ROOM, line)
    assert not fit_line(map_.fine, oldest, False, (2.0, 0.0), ROOM, line)
    kept = [
        layer
        for layer in range(40)
        if fit_line(map_.fine, (0.1, 0.1, (layer + 0.5) * LAYER_M), False, (2.0, 0.0), ROOM, line)
    ]
    assert kept == list(range(min(kept), 40))


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 120), st.integers(0, 2**32 - 1))
def test_a_cell_holds_the_mean_of_its_hits(count: int, seed: int) -> None:
    """Up to the limit; in 16 bits a number, each hit may add a step of rounding."""
    hits = np.random.default_rng(seed).uniform(0.0, [CELL_M, CELL_M, LAYER_M], (count, 3))
    level = mapped(hits).fine
    cells = level.hits[level.hits[:, :, 3] > 0]
    assert len(cells) == 1
    *found, kept = cells[0] / 65536.0
    mean = np.zeros(3)
    for i, hit in enumerate(hits):
        mean += (hit - mean) / min(i + 1, 50)
    assert kept * 65536.0 == min(count, 50)
    assert np.array(found) * [CELL_M, CELL_M, LAYER_M] == pytest.approx(mean, abs=0.12 * 20 / 65536)

"""The end of a drift against walls made of lines: at any angle to the machine, and where it opens into a stope."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.messages import FloatArray
from lhdmap.pile.corridor import BIN_M, DriftCorridor
from lhdmap.pile.end_frame import end_of, floor_before

FACE_M = 16.0


def _corridor(slope: float, half: FloatArray | float, bend_x_m: float = 0.0) -> DriftCorridor:
    x = 2.0 + (np.arange(40, dtype=np.float64) + 0.5) * BIN_M
    centre = slope * np.maximum(x - bend_x_m, 0.0)
    return DriftCorridor(x, centre, centre + half, centre - half)


@pytest.mark.parametrize("slope", [-0.2, -0.11, 0.0, 0.11, 0.2])
@pytest.mark.parametrize("bend_x_m", [0.0, 7.0])
def test_end_of_a_drift_that_runs_aslant_to_the_machine_has_its_walls(slope: float, bend_x_m: float) -> None:
    end = end_of(_corridor(slope, 1.7, bend_x_m), FACE_M)
    assert end is not None
    assert end.turn_rad == pytest.approx(math.atan(slope), abs=0.01)
    assert end.half_m == pytest.approx(1.7, abs=0.05)
    assert end.middle_m == pytest.approx(slope * (FACE_M - bend_x_m), abs=0.15)


@pytest.mark.parametrize("slope", [-0.15, 0.0, 0.15])
def test_stope_ends_the_drift_at_its_mouth(slope: float) -> None:
    x = _corridor(0.0, 1.0).x_m
    end = end_of(_corridor(slope, np.where(x > FACE_M - 4.0, 3.2, 1.8)), FACE_M)
    assert end is not None
    assert end.half_m == pytest.approx(1.8, abs=0.1)
    assert end.middle_m == pytest.approx(slope * FACE_M, abs=0.2)


def _hits(from_x_m: float, to_x_m: float, z_m: float) -> FloatArray:
    x, y = np.meshgrid(np.linspace(from_x_m, to_x_m, 20), np.linspace(-1.5, 1.5, 10))
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z_m) + 0.02 * np.sin(7.0 * x.ravel())])


def test_floor_before_a_toe_is_where_its_hits_lie() -> None:
    floor = floor_before(_hits(2.0, 9.0, 0.7), 10.0, 2.0, 0.0)
    assert floor == pytest.approx(0.7, abs=0.03)


def test_floor_seen_just_before_the_toe_is_one_where_the_path_leads() -> None:
    assert floor_before(_hits(8.8, 9.6, 0.2), 10.0, 2.0, 0.0) == pytest.approx(0.2, abs=0.03)


def test_rocks_of_the_face_before_its_toe_are_no_floor() -> None:
    """Seen from above, only the upper face is hit: its rocks lie before the plane's toe, a metre above the path's floor."""
    assert math.isnan(floor_before(_hits(8.8, 9.6, 1.0), 10.0, 2.0, 0.0))


def test_floor_is_not_known_where_nothing_lies_before_the_toe() -> None:
    assert math.isnan(floor_before(_hits(11.0, 13.0, 1.0), 10.0, 2.0, 0.0))

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.exports.lines import thinned
from lhdmap.messages import FloatArray

coordinates = st.floats(-100.0, 100.0)
lines = st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=40).map(np.array)


def from_stretch(point: FloatArray, a: FloatArray, b: FloatArray) -> float:
    """The distance of a point from a stretch, by many points on it."""
    on = a + np.linspace(0.0, 1.0, 2001)[:, None] * (b - a)
    return float(np.linalg.norm(on - point, axis=1).min())


@given(lines, st.floats(0.5, 20.0))
def test_what_is_left_out_lies_near_what_stays(line: FloatArray, tolerance_m: float) -> None:
    kept = thinned(line, tolerance_m)
    assert {0, len(line) - 1} <= set(kept.tolist())
    for first, last in pairwise(kept):
        for between in range(first + 1, last):
            assert from_stretch(line[between], line[first], line[last]) <= tolerance_m + 0.15


def test_a_straight_line_is_its_ends_and_a_corner_stays() -> None:
    straight = np.column_stack([np.arange(50.0), 2.0 * np.arange(50.0)])
    assert thinned(straight, 0.01).tolist() == [0, 49]
    corner = np.vstack([straight, straight[-1] + np.column_stack([np.arange(1.0, 9.0), np.zeros(8)])])
    assert thinned(corner, 0.01).tolist() == [0, 49, 57]


def test_a_ring_keeps_what_is_far_from_its_start() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 361)
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    ring[-1] = ring[0]
    kept = thinned(ring, 0.02)
    assert 12 <= len(kept) <= 40
    chords = 0.5 * (ring[kept[1:]] + ring[kept[:-1]])
    assert np.linalg.norm(chords, axis=1).min() == pytest.approx(1.0, abs=0.0201)

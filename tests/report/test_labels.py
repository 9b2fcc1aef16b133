"""Names on a plan: none over another, none outside, near to what they name."""

from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.report.labels import Label, extent, placed

SIZE = (600.0, 300.0)
NOTHING = np.empty((0, 2))
places = st.lists(
    st.tuples(st.floats(0.0, 600.0), st.floats(0.0, 300.0), st.text("ABCD12", min_size=1, max_size=12)), max_size=60
)


def boxes(labels: list[Label], drawn: np.ndarray = NOTHING) -> list[tuple[float, float, float, float]]:
    found = []
    for one in placed(labels, drawn, SIZE):
        (x, y), (width, height) = one.middle, extent(labels[one.number])
        found.append((x - width / 2, y - height / 2, x + width / 2, y + height / 2))
    return found


@given(places)
def test_no_name_covers_another_or_leaves_the_plan(rows: list[tuple[float, float, str]]) -> None:
    found = boxes([Label(text, np.array([x, y])) for x, y, text in rows])
    for a, b in itertools.combinations(found, 2):
        assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]
    for x0, y0, x1, y1 in found:
        assert x0 >= 0.0
        assert y0 >= 0.0
        assert x1 <= SIZE[0]
        assert y1 <= SIZE[1]


def test_a_name_alone_stands_beside_its_mark_and_does_not_cover_it() -> None:
    ((x0, y0, x1, y1),) = boxes([Label("DP1", np.array([300.0, 150.0]), mark=4.0)])
    nearest = np.clip([300.0, 150.0], [x0, y0], [x1, y1])
    assert 0.0 < np.hypot(*(nearest - [300.0, 150.0])) < 6.0


def test_names_keep_off_what_is_drawn_where_there_is_room() -> None:
    line = np.column_stack([np.arange(0.0, 600.0, 2.0), np.full(300, 150.0)])
    ((_, y0, _, y1),) = boxes([Label("a long name", np.array([300.0, 150.0]), mark=1.0)], line)
    assert y0 > 150.0 or y1 < 150.0


def test_forty_names_in_a_row_all_find_room() -> None:
    labels = [Label(f"S1.{k}", np.array([40.0 + 13.0 * k, 150.0])) for k in range(40)]
    assert len(boxes(labels)) == 40


def test_names_without_room_are_left_out_the_last_ones_first() -> None:
    labels = [Label("a name too many", np.array([300.0, 150.0])) for _ in range(200)]
    found = placed(labels, NOTHING, SIZE)
    assert 5 < len(found) < 200
    assert [one.number for one in found][:5] == [0, 1, 2, 3, 4]

"""The paper's own numbers through the code give its tables, and the 2.47 of the erratum."""

from __future__ import annotations

import pytest
from lhdmap.evaluation.loading.loads import Attempt, Load
from lhdmap.evaluation.loading.paper import paper_loads, printed_3, printed_5
from lhdmap.evaluation.loading.stats import stat_of
from lhdmap.evaluation.loading.tables import tables_of
from lhdmap.evaluation.loading.text import as_text
from lhdmap.loading.calibrate import student_95

NAN = float("nan")


def test_table_3() -> None:
    rows = tables_of(paper_loads()).table3
    assert [(row.attempts, row.n) for row in rows] == [(1, 9), (2, 4), (3, 11), (4, 6)]
    assert [round(100.0 * row.share) for row in rows] == [30, 13, 37, 20]
    assert [row.fill.mean for row in rows] == pytest.approx([0.88, 1.07, 0.87, 0.90])
    assert [row.n for row in printed_3()] == [row.n for row in rows]


def test_table_4_is_2_47_and_not_3_6() -> None:
    tables = tables_of(paper_loads())
    assert tables.attempts.mean == pytest.approx(74 / 30)
    assert tables.attempts_begun.mean == pytest.approx(81 / 30)
    assert tables.fill.mean == pytest.approx(0.906, abs=0.001)
    assert (tables.early, sum(row.attempts * row.n for row in tables.table3)) == (7, 74)
    assert tables.to_json()["table4"]["detection_right"] == pytest.approx(74 / 81)


def test_table_5() -> None:
    rows = tables_of(paper_loads()).table5
    for row, printed in zip(rows, printed_5(), strict=True):
        assert (row.attempt, row.n) == (printed.number, printed.n)
        assert row.fill.mean == pytest.approx(printed.fill)
        assert row.duration_s.mean == pytest.approx(printed.duration_s)


def test_what_went_on_had_less_before() -> None:
    """50.9, 69.9, 72.8 % by Tables 3 and 5: the attempts brought 26, 12 and 17 points, not 15, 5 and 8."""
    rows = tables_of(paper_loads()).table5[1:]
    assert [100.0 * row.before.mean for row in rows] == pytest.approx([50.9, 69.9, 72.8], abs=0.06)
    assert [100.0 * row.gain.mean for row in rows] == pytest.approx([26.1, 12.1, 17.2], abs=0.06)


def test_intervals_and_medians() -> None:
    one = stat_of([1.0, 2.0, 6.0, NAN])
    assert (one.n, one.mean, one.median) == (3, 3.0, 2.0)
    assert one.mean_95 == pytest.approx(student_95(2) * 7.0**0.5 / 3.0**0.5)
    assert stat_of([]).to_json() == {"n": 0, "mean": None, "std": None, "median": None, "mean_95": None}


def test_early_attempts_and_unknown_fills_are_apart() -> None:
    digs = (Attempt(0.0, 2.0, 0.0, early=True), Attempt(9.0, 10.0, 0.5), Attempt(30.0, 12.0))
    tables = tables_of([Load("a", digs), Load("b", (Attempt(0.0, 3.0, early=True),))])
    assert (tables.loads, tables.early) == (1, 1)
    assert tables.table5[1].fill.n == 0
    assert tables.fill.mean == 0.5
    assert "-" in as_text([Load("a", digs)])


def test_no_loads() -> None:
    assert tables_of([]).to_json()["table3"]["rows"] == []
    as_text([])

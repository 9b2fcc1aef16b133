"""Curves over the drive: deviations in millimetres and degrees, capped where nothing is observed; slip where something moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lhdmap.mapfolder import Diagnostics
from lhdmap.report import charts
from lhdmap.report.data import ReportData, SpeedSeries, Summary
from lhdmap.report.series_charts import deviation_chart, deviations

from tests.report.synthetic import START_NS, drive

N = 200


def _diagnostics(weak: slice = slice(100, 120)) -> Diagnostics:
    """Along 1e4 /m² (10 mm), nothing at all where weak; across 1e6 (1 mm); heading 3282.8 /rad² (1 degree)."""
    along, degenerate = np.full(N, 1e4), np.zeros(N, dtype=bool)
    along[weak], degenerate[weak] = 0.0, True
    one, zero = np.ones(N), np.zeros(N)
    heading = np.full(N, np.degrees(1.0) ** 2)
    stamps = START_NS + 100_000_000 * np.arange(N, dtype=np.int64)
    return Diagnostics(stamps, zero, one, along, 1e6 * one, heading, degenerate, [""] * N, 0.02 * one, ["used"] * N)


def _data(found: Diagnostics, wheel_mps: float = 2.0) -> ReportData:
    """The machine stands for the first quarter, and while the wheels turn in the last one."""
    speed = np.full(N, 2.0)
    speed[: N // 4] = speed[-N // 4 :] = 0.005
    wheels = np.where(np.arange(N) < N // 4, 0.004, wheel_mps)
    return ReportData(
        "t", Summary(N, N, 20.0, 30.0), [], drive(N), diagnostics=found,
        odometry_speed=SpeedSeries(found.stamp_ns, speed), tachometer_speed=SpeedSeries(found.stamp_ns, wheels),
    )  # fmt: skip


def test_a_deviation_is_one_over_the_root() -> None:
    assert deviations(np.array([1e6, 4.0])) == pytest.approx([1e-3, 0.5])
    assert deviations(np.array([0.0, -1.0])).tolist() == [np.inf, np.inf]
    assert np.isnan(deviations(np.array([np.nan]))).all()


def test_curves_are_in_millimetres_and_degrees_and_end_at_the_edge() -> None:
    found = _diagnostics()
    with charts.styled():
        panels = deviation_chart(_data(found), found).axes
    along, across, heading = (panel.lines[0].get_ydata() for panel in panels)
    assert [panel.get_ylabel() for panel in panels] == ["along, mm", "across, mm", "heading, °"]
    assert across == pytest.approx(1.0)
    assert heading == pytest.approx(1.0)
    top = panels[0].get_ylim()[1]
    assert 10.0 < top < 20.0, "the scale is that of what was observed"
    assert np.asarray(along)[110] == pytest.approx(top, rel=0.02)
    assert np.asarray(along)[50] == pytest.approx(10.0)
    assert len(panels[0].patches) == 1, "the unobserved stretch is shaded"


def test_a_drive_without_any_observation_is_drawn() -> None:
    found = _diagnostics(weak=slice(0, N))
    with charts.styled():
        panels = deviation_chart(_data(found), found).axes
    assert np.isfinite(panels[0].get_ylim()).all()


def test_the_first_scan_has_no_deviation() -> None:
    """It is matched with nothing: its information is set, the same in all directions."""
    found = _diagnostics()
    for column in (found.information_along, found.information_across, found.information_heading):
        np.asarray(column)[0] = 1e8
    with charts.styled():
        panels = deviation_chart(_data(found), found).axes
    for panel in panels:
        values = np.asarray(panel.lines[0].get_ydata())
        assert np.isnan(values[0])
        assert np.isfinite(values[1:]).all()


def test_slip_is_not_drawn_where_the_machine_stands() -> None:
    slip = _data(_diagnostics()).slip()
    assert slip is not None
    assert np.isnan(slip.share[: N // 4]).all()
    assert np.isfinite(slip.share[N // 4 + 1 :]).all(), "wheels that turn under a standing machine do slip"
    standing = _data(_diagnostics(), wheel_mps=0.0).slip()
    assert standing is not None
    assert np.isnan(standing.share[-N // 4 :]).all()


def test_a_machine_that_never_moves_has_no_slip() -> None:
    data = _data(_diagnostics(), wheel_mps=0.0)
    still = SpeedSeries(data.trajectory.stamps_ns[:2], np.zeros(2))
    assert replace(data, odometry_speed=still).slip() is None

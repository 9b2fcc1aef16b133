"""Curves of a long log are shortened without the loss of what is to be seen in them."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
from lhdmap.report.bounded import bounded
from lhdmap.report.data import AngleSeries, SpeedSeries

from tests.report.synthetic import report_data

DATA = report_data(scans=5000, points=100)


def test_a_short_drive_stays_as_it_is() -> None:
    same = bounded(DATA, 5000)
    assert same.trajectory is DATA.trajectory
    assert same.diagnostics is DATA.diagnostics
    assert same.odometry_speed is DATA.odometry_speed


def test_a_jump_a_flag_and_a_slip_are_kept() -> None:
    assert DATA.diagnostics is not None
    stamps, speed, flags = DATA.trajectory.stamps_ns, np.sin(np.arange(5000.0) / 500.0), np.zeros(5000, bool)
    slip, residual, across = (np.full(5000, value) for value in (0.01, 0.02, 1e4))
    speed[1234], flags[777], slip[4000], residual[31], across[2222] = 9.0, True, -0.7, 0.5, 3.0
    slip[4001], speed[10:400] = np.nan, np.nan
    found = DATA.diagnostics._replace(
        stamp_ns=stamps, inliers=residual, substitute=[""] * 5000, wheels=["used"] * 5000,
        degenerate=flags, slip=slip, residual=residual, information_across=across, information_along=2.0 * across,
        information_heading=4.0 * across,
    )  # fmt: skip
    data = replace(
        DATA, diagnostics=found, odometry_speed=SpeedSeries(stamps, speed), articulation=AngleSeries(stamps, -speed)
    )
    short = bounded(data, 500)
    assert short.diagnostics is not None
    assert short.odometry_speed is not None
    assert short.articulation is not None
    assert {len(column) for column in short.diagnostics if column is not None} == {500}
    assert short.diagnostics.degenerate.sum() == 1
    assert stamps[777] in short.diagnostics.stamp_ns
    assert np.nanmin(short.diagnostics.slip) == -0.7
    assert short.diagnostics.residual.max() == 0.5
    assert short.diagnostics.information_across.min() == 3.0
    assert len(short.odometry_speed.stamps_ns) == 500
    assert np.nanmax(short.odometry_speed.speed_mps) == 9.0
    assert np.nanmin(short.articulation.angle_rad) == -9.0
    for series in (short.diagnostics.stamp_ns, short.odometry_speed.stamps_ns, short.trajectory.stamps_ns):
        assert (np.diff(series) >= 0).all()


def test_the_path_keeps_its_ends() -> None:
    way = bounded(DATA, 500).trajectory
    assert len(way.stamps_ns) == 500
    assert (way.stamps_ns[[0, -1]] == DATA.trajectory.stamps_ns[[0, -1]]).all()
    rows = np.searchsorted(DATA.trajectory.stamps_ns, way.stamps_ns)
    assert (way.positions_m == DATA.trajectory.positions_m[rows]).all()


def test_what_the_report_weighs_does_not_grow_with_the_log() -> None:
    # what is compared with the truth is no part of a run
    whole = (replace(report_data(scans=n, points=100), evaluation=None) for n in (2000, 20_000))
    short, long = (len(pickle.dumps(bounded(data, 500))) for data in whole)
    assert long < 1.1 * short

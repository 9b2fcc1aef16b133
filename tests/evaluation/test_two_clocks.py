"""Trajectories whose clocks differ, or were set: paired all the same, since the motion tells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.evaluation.association import associate
from lhdmap.evaluation.ordering import file_in_order
from lhdmap.evaluation.trajectory import evaluate_trajectory
from lhdmap.evaluation.two_clocks import clock_offset_ns, shifted
from lhdmap.geometry.se3 import quaternions_from_rpy
from lhdmap.trajectory import Trajectory

SECOND = 10**9


def _drive(start_ns: int, count: int = 300, period_s: float = 0.1) -> Trajectory:
    """Speed up, bend, stop, drive on."""
    t = period_s * np.arange(count)
    speed = np.clip(t / 3.0, 0.0, 2.0) * (1.0 - 0.9 * ((t > 14.0) & (t < 17.0)))
    heading = np.cumsum(np.where((t > 8.0) & (t < 12.0), 0.2, 0.0)) * period_s
    xy = np.cumsum(np.column_stack([speed * np.cos(heading), speed * np.sin(heading)]) * period_s, axis=0)
    zero = np.zeros(count)
    stamps = start_ns + np.round(t * SECOND).astype(np.int64)
    return Trajectory(stamps, np.column_stack([xy, zero]), quaternions_from_rpy(zero, zero, heading))


def _part(one: Trajectory, rows: slice) -> Trajectory:
    return Trajectory(one.stamps_ns[rows], one.positions_m[rows], one.quaternions_xyzw[rows])


@pytest.mark.parametrize("rows", [slice(0, 300), slice(60, 300), slice(0, 220), slice(50, 250), slice(3, 299, 2)])
def test_simulation_time_beside_wall_time(rows: slice) -> None:
    truth = _drive(1_700_000_000 * SECOND)
    estimate = _part(_drive(0), rows)
    offset = clock_offset_ns(estimate, truth)
    assert offset == pytest.approx(1_700_000_000 * SECOND, abs=25_000_000)
    found = evaluate_trajectory(estimate, truth)
    assert found.ape_m.rmse < 0.05
    assert any("two clocks" in text for text in found.warnings)


def test_clocks_that_share_time_are_left_alone() -> None:
    truth = _drive(SECOND)
    assert clock_offset_ns(shifted(_drive(SECOND), 5 * SECOND), truth) is None


def test_another_drive_is_not_moved_onto_it() -> None:
    other = _drive(0)
    backwards = other._replace(positions_m=other.positions_m[::-1], quaternions_xyzw=other.quaternions_xyzw[::-1])
    assert clock_offset_ns(backwards, _drive(10**18)) is None
    with pytest.raises(InputError, match="clock"):
        associate(backwards, _drive(10**18))


@pytest.mark.parametrize("step_s", [-0.5, -5.0, -3600.0])
def test_a_clock_that_was_set_back_in_both(step_s: float, tmp_path: Path) -> None:
    one = _drive(4000 * SECOND)
    stamps = one.stamps_ns + np.where(np.arange(300) >= 130, round(step_s * SECOND), 0)
    truth = file_in_order(one._replace(stamps_ns=stamps), tmp_path / "truth.tum").trajectory
    assert (truth.stamps_ns == stamps).all()
    estimate = _part(one._replace(stamps_ns=stamps), slice(0, 300, 2))
    assert evaluate_trajectory(estimate, truth).ape_m.max < 1e-9

"""Distances to the walls in worlds of known geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.evaluation.navigation.path import WheelPath
from lhdmap.evaluation.navigation.walls import WallGauge, wall_figures
from lhdmap.kinematics import T_base_rear, articulation_for_curvature
from lhdmap.machine import Machine

from tests.evaluation.navigation.drives import (
    BEAMS,
    FIRST_RAD,
    START_NS,
    STEP_RAD,
    Array,
    corridor,
    mounts,
    ns,
    scan,
    signals,
)

MACHINE = Machine()
HALF_M = 0.5 * MACHINE.dimensions.width_m


def _straight(speed_mps: float, walls, length_s: float = 15.0, roles: str = "fr") -> WallGauge:  # type: ignore[no-untyped-def]
    path = WheelPath(signals(length_s, speed=lambda _: speed_mps), MACHINE)
    gauge, fixed = WallGauge(path, MACHINE, START_NS), mounts()
    for time_s in np.arange(0.0, length_s - 0.1, 0.04):
        for role, x_m, yaw in (("front", 0.8, 0.0), ("rear", -6.4, math.pi)):
            if role[0] in roles:
                pose = np.array([speed_mps * time_s + x_m, 0.0, yaw])
                gauge.update(scan(role, time_s, walls(pose)), fixed[role])
    return gauge


@pytest.mark.parametrize("speed_mps", [2.0, -2.0])
def test_a_straight_corridor(speed_mps: float) -> None:
    found = wall_figures(_straight(speed_mps, corridor(2.0, 1.8)).rows)
    assert found["adlw_m"] == pytest.approx(2.0 - HALF_M, abs=1e-3)
    assert found["mdlw_m"] == pytest.approx(2.0 - HALF_M, abs=1e-3)
    assert found["adrw_m"] == pytest.approx(1.8 - HALF_M, abs=1e-3)
    assert found["lw_share"] > 0.7  # type: ignore[operator]  # all but the first length of the machine


def test_one_scanner_is_enough_where_it_leads() -> None:
    ahead = wall_figures(_straight(2.0, corridor(2.0, 1.8), roles="f").rows)
    assert ahead["adrw_m"] == pytest.approx(1.8 - HALF_M, abs=1e-3)
    behind = wall_figures(_straight(-2.0, corridor(2.0, 1.8), roles="f").rows)
    assert behind["adrw_m"] is None  # it sees the bucket's sides alone
    assert behind["mdrw_m"] == pytest.approx(1.8 - HALF_M, abs=1e-3)


def _with_rib(pose: Array, from_m: float, to_m: float) -> Array:
    """Return ranges in the corridor of 2.0 and 1.8 m with a rib 0.3 m out of the left wall."""
    ranges = corridor(2.0, 1.8)(pose)
    way = pose[2] + FIRST_RAD + STEP_RAD * np.arange(BEAMS)
    with np.errstate(divide="ignore", invalid="ignore"):
        rib = 1.7 / np.sin(way)
    at = pose[0] + rib * np.cos(way)
    return np.where((rib > 0) & (at > from_m) & (at < to_m), rib, ranges)


def test_a_pinch_is_the_least_distance_and_lone_hits_are_not() -> None:
    def pinched(pose: Array) -> Array:
        """Return ranges with the rib at x = 12 to 13, and one false hit in a scan."""
        ranges = _with_rib(pose, 12.0, 13.0)
        if abs(pose[0] - 8.8) < 0.01:
            ranges[20] = 1.4
        return ranges

    found = wall_figures(_straight(2.0, pinched).rows)
    assert found["mdlw_m"] == pytest.approx(1.7 - HALF_M, abs=1e-3)
    assert found["mdrw_m"] == pytest.approx(1.8 - HALF_M, abs=1e-3)


def test_no_wall_on_one_side() -> None:
    found = wall_figures(_straight(2.0, corridor(2.0, 9.0)).rows)
    assert (found["adrw_m"], found["mdrw_m"], found["rw_share"]) == (None, None, 0.0)
    assert found["adlw_m"] == pytest.approx(2.0 - HALF_M, abs=1e-3)


def test_a_steady_bend() -> None:
    """Circles of 12 ± 2 m: against the points of both circles, put into the frames of both bodies."""
    radius_m, speed_mps, length_s = 12.0, 1.5, 20.0
    angle = articulation_for_curvature(1.0 / radius_m, MACHINE)
    path = WheelPath(signals(length_s, speed=lambda _: speed_mps, angle=lambda _: angle), MACHINE)
    gauge, fixed = WallGauge(path, MACHINE, START_NS), mounts()
    T_rear = T_base_rear(angle, MACHINE)
    for time_s in np.arange(0.0, length_s - 0.1, 0.04):
        turn = speed_mps * time_s / radius_m
        T = np.eye(4)
        T[:2, :2] = [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
        T[:2, 3] = radius_m * math.sin(turn), -radius_m * math.cos(turn)  # the circles' middle is the origin
        for role, T_body in (("front", T), ("rear", T @ T_rear)):
            gauge.update(scan(role, time_s, _ring(T_body @ fixed[role].T_parent_child)), fixed[role])
    found = wall_figures(gauge.rows)
    wanted = _by_points(radius_m, T_rear)
    assert found["mdlw_m"] == pytest.approx(wanted[0], abs=0.01)
    assert found["mdrw_m"] == pytest.approx(wanted[1], abs=0.01)
    assert found["adlw_m"] == pytest.approx(wanted[0], abs=0.02)
    assert found["adrw_m"] == pytest.approx(wanted[1], abs=0.02)


def _ring(T: Array, inner_m: float = 10.0, outer_m: float = 14.0) -> Array:
    """Return ranges to both circles around the origin from a scanner's pose."""
    yaw = math.atan2(T[1, 0], T[0, 0])
    way = yaw + FIRST_RAD + STEP_RAD * np.arange(BEAMS)
    along = T[0, 3] * np.cos(way) + T[1, 3] * np.sin(way)
    square = T[0, 3] ** 2 + T[1, 3] ** 2
    with np.errstate(invalid="ignore"):
        near = -along - np.sqrt(along**2 - square + inner_m**2)
    far = -along + np.sqrt(along**2 - square + outer_m**2)
    return np.where(near > 0, near, far)


def _by_points(radius_m: float, T_rear: Array) -> tuple[float, float]:
    """Return the least distances across on the left (inner circle) and right (outer) of the machine at (0, −R)."""
    around = np.linspace(0.0, 2.0 * math.pi, 200_001)
    least = []
    for wall_m, left in ((10.0, True), (14.0, False)):
        x, y = wall_m * np.sin(around), radius_m - wall_m * np.cos(around)  # in base_link: the middle is at (0, R)
        distances = []
        for frame, T in (("base_link", np.eye(4)), ("rear_link", np.linalg.inv(T_rear))):
            bx, by = T[0, 0] * x + T[0, 1] * y + T[0, 3], T[1, 0] * x + T[1, 1] * y + T[1, 3]
            for low, high in MACHINE.boxes(frame):
                beside = (bx >= low[0]) & (bx <= high[0])
                gap = (by - high[1] if left else low[1] - by)[beside]
                distances.append(gap[(gap >= 0.0) & (gap < 5.0)].min())
        least.append(float(min(distances)))
    return least[0], least[1]


def test_a_frozen_scanner_is_not_carried_along() -> None:
    """From 1 s on the front scanner repeats a scan with a rib ahead, 0.3 m out of the left wall at x = 4 to 5."""
    path = WheelPath(signals(9.0, speed=lambda _: 2.0), MACHINE)
    gauge, fixed = WallGauge(path, MACHINE, START_NS), mounts()
    for time_s in np.arange(0.0, 8.9, 0.04):
        at_s = min(time_s, 1.0)
        sweep = scan("front", at_s, _with_rib(np.array([2.0 * at_s + 0.8, 0.0, 0.0]), 4.0, 5.0))
        gauge.update(sweep._replace(stamp_ns=ns(time_s)), fixed["front"])
    left = np.array([(row.time_s, row.left_m) for row in gauge.rows])
    assert gauge.frozen > 150
    assert np.nanmin(left[left[:, 0] < 6.0, 1]) == pytest.approx(1.7 - HALF_M, abs=1e-3)
    assert np.nanmin(left[left[:, 0] > 6.5, 1]) == pytest.approx(2.0 - HALF_M, abs=1e-3)


def test_after_a_gap_nothing_is_carried_on() -> None:
    gauge = _straight(2.0, corridor(2.0, 1.8))
    assert len(gauge.rows) > 100
    path = WheelPath(signals(5.0), MACHINE)
    assert path.at(-1.0) is None
    assert path.at(99.0) is None

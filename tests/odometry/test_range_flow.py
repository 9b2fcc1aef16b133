"""Range flow against motions that are known: signs, scanners of any geometry, start, symmetry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray, LaserScan
from lhdmap.odometry.range_flow.flow import Flow, flow
from lhdmap.odometry.range_flow.scan import BEND, SLOPE, WALL, Pyramid, Y
from lhdmap.odometry.settings import RangeFlowSettings
from lhdmap.scan_matching.scan_points import planar_points
from lhdmap.simulation.planar import PlanarScanner, drive_along, simulate_scans

from tests.odometry.planar_drives import LEVEL, world

SETTINGS = RangeFlowSettings()
NO_PRIOR = 1e-3 * np.eye(3)
PLACE = drive_along(world().centre_line_m, 1.0, 1.0)[12]
MOTION = np.array([0.11, 0.02, math.radians(1.5)])


def levels(scan: LaserScan) -> Pyramid:
    return Pyramid(planar_points(scan, LEVEL, np.zeros(3)), SETTINGS.width_m, SETTINGS.levels)


def scan_at(pose: FloatArray, scanner: PlanarScanner, seed: int = 1) -> LaserScan:
    return simulate_scans(world(), np.array([pose, pose]), scanner, 25.0, seed)[0]


def between(first: LaserScan, second: LaserScan, guess: FloatArray | None = None) -> Flow:
    start = np.zeros(3) if guess is None else guess
    return flow(levels(first), levels(second), start, NO_PRIOR, 0.012, coarsest=4, iterations=8)


EXACT = PlanarScanner(noise_m=0.0)


@pytest.mark.parametrize(
    "motion",
    [(0.1, 0.0, 0.0), (-0.1, 0.0, 0.0), (0.0, 0.06, 0.0), (0.0, -0.06, 0.0), (0.0, 0.0, 0.03), (0.0, 0.0, -0.03)],
)
def test_each_axis_has_its_sign_and_size(motion: tuple[float, float, float]) -> None:
    first, second = scan_at(PLACE, EXACT), scan_at(se2.compose(PLACE, np.array(motion)), EXACT)
    found = between(first, second).pose_reference_current
    assert found[:2] == pytest.approx(motion[:2], abs=0.002)
    assert found[2] == pytest.approx(motion[2], abs=3e-4)


def turned_sensor(scan: LaserScan, offset_rad: float) -> LaserScan:
    """Return the same scan by a scanner whose zero angle points elsewhere."""
    return scan._replace(angle_min_rad=scan.angle_min_rad + offset_rad)


def reversed_order(scan: LaserScan) -> LaserScan:
    last = scan.angle_min_rad + scan.angle_increment_rad * (scan.ranges_m.size - 1)
    return scan._replace(
        angle_min_rad=last, angle_increment_rad=-scan.angle_increment_rad, ranges_m=scan.ranges_m[::-1].copy()
    )


def spoilt(scan: LaserScan, seed: int) -> LaserScan:
    """Return the scan with a tenth of its beams not a number, infinite, zero or negative."""
    rng = np.random.default_rng(seed)
    ranges = scan.ranges_m.copy()
    beams = rng.choice(ranges.size, ranges.size // 10, replace=False)
    ranges[beams] = rng.choice(np.array([np.nan, np.inf, -np.inf, 0.0, -1.0], dtype=np.float32), beams.size)
    return scan._replace(ranges_m=ranges)


@pytest.mark.parametrize(
    "scanner",
    [
        PlanarScanner(noise_m=0.0, field_of_view_deg=180.0, step_deg=1.0),
        PlanarScanner(noise_m=0.0, field_of_view_deg=270.0, step_deg=0.25),
        PlanarScanner(noise_m=0.0, field_of_view_deg=359.5, step_deg=0.5),
    ],
)
def test_any_field_of_view_gives_the_motion(scanner: PlanarScanner) -> None:
    first, second = scan_at(PLACE, scanner), scan_at(se2.compose(PLACE, MOTION), scanner)
    error = se2.between(MOTION, between(first, second).pose_reference_current)
    assert np.abs(error[:2]).max() < 0.004
    assert abs(error[2]) < 0.001


def test_negative_increment_is_the_same_scan() -> None:
    first, second = scan_at(PLACE, PlanarScanner()), scan_at(se2.compose(PLACE, MOTION), PlanarScanner(), 2)
    plain = between(first, second).pose_reference_current
    assert between(reversed_order(first), reversed_order(second)).pose_reference_current == pytest.approx(
        plain, abs=1e-6
    )


@pytest.mark.parametrize("offset_deg", [-90.0, 35.0, 170.0])
def test_an_angle_offset_turns_the_motion_with_it(offset_deg: float) -> None:
    offset = math.radians(offset_deg)
    first, second = (turned_sensor(scan_at(p, EXACT), offset) for p in (PLACE, se2.compose(PLACE, MOTION)))
    found = between(first, second).pose_reference_current
    c, s = math.cos(offset), math.sin(offset)
    expected = [c * MOTION[0] - s * MOTION[1], s * MOTION[0] + c * MOTION[1], MOTION[2]]
    assert found[:2] == pytest.approx(expected[:2], abs=0.004)
    assert found[2] == pytest.approx(expected[2], abs=0.001)


def test_invalid_beams_are_left_out_one_by_one() -> None:
    first = spoilt(scan_at(PLACE, PlanarScanner()), 3)
    second = spoilt(scan_at(se2.compose(PLACE, MOTION), PlanarScanner(), 2), 4)
    found = between(first, second)
    assert np.isfinite(found.information).all()
    error = se2.between(MOTION, found.pose_reference_current)
    assert np.hypot(error[0], error[1]) < 0.01
    assert abs(error[2]) < math.radians(0.1)


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0])
def test_a_scan_without_returns_gives_the_guess_and_no_information(value: float) -> None:
    first = scan_at(PLACE, PlanarScanner())
    blind = first._replace(ranges_m=np.full_like(first.ranges_m, value))
    for pair in ((first, blind), (blind, first), (blind, blind)):
        found = between(*pair, guess=MOTION)
        assert found.pose_reference_current == pytest.approx(MOTION)
        assert not found.information.any()
        assert found.support == 0.0


@pytest.mark.parametrize("hits", [1, 2, 11])
def test_a_few_hits_give_the_guess_and_no_information(hits: int) -> None:
    whole = planar_points(scan_at(PLACE, PlanarScanner()), LEVEL, np.zeros(3))
    few, many = (Pyramid(points, SETTINGS.width_m, 1) for points in (whole[:hits], whole))
    assert not flow(few, many, MOTION, NO_PRIOR, 0.012).information.any()
    assert not flow(many, few, MOTION, NO_PRIOR, 0.012).information.any()


def test_a_straight_wall_has_its_slope_at_every_level() -> None:
    """R = d / sin(theta): the slope dR/dtheta / R is -cot(theta), the beams' ends lie on the wall and nothing bends."""
    angles = np.radians(np.arange(20.0, 160.0, 0.5))
    pyramid = Pyramid(np.column_stack([2.0 / np.tan(angles), np.full(angles.size, 2.0)]), SETTINGS.width_m, 3)
    for k in range(3):
        level, theta = pyramid.level(k), angles[:: 1 << k]
        assert level[:, SLOPE] == pytest.approx(-1.0 / np.tan(theta), abs=1e-9)
        assert level[:, Y] == pytest.approx(2.0)
        assert level[:, BEND] == pytest.approx(0.0, abs=1e-12)
        assert level[:-1, WALL].all()
        assert level[-1, WALL] == 0.0


def test_a_jump_of_the_range_and_a_missing_beam_part_walls() -> None:
    angles = np.radians(np.arange(-60.0, 60.0, 0.5))
    ranges = np.where(angles < 0.0, 3.0, 5.0)
    kept = np.ones(angles.size, dtype=bool)
    kept[200:204] = False
    points = (ranges[:, None] * np.column_stack([np.cos(angles), np.sin(angles)]))[kept]
    parted = np.flatnonzero(Pyramid(points, SETTINGS.width_m, 1).level(0)[:-1, WALL] == 0.0)
    assert parted.tolist() == [119, 199]


@pytest.mark.parametrize("seed", [0, 1])
def test_the_order_of_the_hits_does_not_matter(seed: int) -> None:
    points = planar_points(scan_at(PLACE, PlanarScanner(field_of_view_deg=359.5)), LEVEL, np.zeros(3))
    mixed = points[np.random.default_rng(seed).permutation(len(points))]
    levels_of_both = [
        Pyramid(one, SETTINGS.width_m, 1).level(0) for one in (points, mixed, np.roll(points, 90, axis=0))
    ]
    assert np.array_equal(levels_of_both[0], levels_of_both[1])
    assert np.array_equal(levels_of_both[0], levels_of_both[2])


@pytest.mark.parametrize("motion", [(0.3, 0.0, 0.0), (0.5, 0.0, 0.0), (0.2, 0.05, 0.26), (0.0, 0.0, -0.26)])
def test_converges_from_no_motion(motion: tuple[float, float, float]) -> None:
    found = []
    for metre in (6, 9, 14, 18):
        place = drive_along(world().centre_line_m, 1.0, 1.0)[metre]
        first = scan_at(place, PlanarScanner())
        second = scan_at(se2.compose(place, np.array(motion)), PlanarScanner(), 2)
        error = se2.between(np.array(motion), between(first, second).pose_reference_current)
        found.append(np.hypot(error[0], error[1]) < 0.02 and abs(error[2]) < math.radians(0.3))
    assert sum(found) >= 3


def test_back_is_the_inverse_of_forth() -> None:
    first, second = scan_at(PLACE, PlanarScanner()), scan_at(se2.compose(PLACE, MOTION), PlanarScanner(), 2)
    forth = between(first, second).pose_reference_current
    back = between(second, first).pose_reference_current
    assert se2.compose(forth, back) == pytest.approx([0.0, 0.0, 0.0], abs=2e-4)


def test_a_smooth_straight_drift_is_not_observed_along() -> None:
    """Two straight walls fix across and heading, and nothing along, whatever the noise of the gradients suggests."""
    angles = np.radians(np.concatenate([np.arange(-90.0, -5.0, 0.5), np.arange(5.0, 90.0, 0.5)]))
    rng = np.random.default_rng(0)
    scans = []
    for _ in range(2):
        ranges = 2.0 / np.abs(np.sin(angles)) + 0.012 * rng.standard_normal(angles.size)
        points = ranges[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        scans.append(Pyramid(points, SETTINGS.width_m, SETTINGS.levels))
    found = flow(scans[0], scans[1], np.zeros(3), NO_PRIOR, 0.012)
    sigma = 1.0 / np.sqrt(np.maximum(np.diag(found.information), 1e-12))
    assert sigma[1] < 0.003
    assert sigma[0] > 5 * sigma[1]

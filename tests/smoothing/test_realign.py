"""Realignment against known paths: a rough drift in space, an odometry that is wrong as tilted scanners make it."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.pipeline.path import FinalPath
from lhdmap.pipeline.track import Track
from lhdmap.smoothing import realign
from lhdmap.smoothing.height_pairs import LINE, same_height, wall_lines
from lhdmap.smoothing.realign import AlignedScan, Realigner
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.window import Window, solved

SCANNER_M, FALL = 1.8, math.tan(math.radians(2.5))
JOINT_X_M, REAR_X_M = -1.7, -4.7
STEP_M, STEP_NS = 0.1, 40_000_000
SETTINGS = SmoothingSettings()


def wall_y(x_m: FloatArray, z_m: FloatArray, side: float) -> FloatArray:
    """Return y of a rough wall that changes with the height, too."""
    waves = [(0.9, 2.3, 0.05), (2.1, -3.7, 0.04), (4.3, 6.1, 0.03), (7.7, -9.0, 0.02)]
    rough = sum(size * np.sin(k * x_m + m * z_m + side * (k + m)) for k, m, size in waves)
    return np.asarray(side * 2.0 + rough, dtype=float)


def seen(pose_map_base: FloatArray, x_base_m: float, ahead: float, rng: np.random.Generator) -> FloatArray:
    """Return hits on both walls, base frame, of a scanner at x that looks ahead (1) or back (-1) and a little down."""
    away = np.geomspace(1.0, 16.0, 120)
    hits = []
    for side in (1.0, -1.0):
        x, z = pose_map_base[0] + x_base_m + ahead * away, SCANNER_M - FALL * away
        hits.append(np.column_stack([x, wall_y(x, z, side) + rng.normal(0.0, 0.008, len(x)), z]))
    return se2.transform(se2.inverse(pose_map_base), np.concatenate(hits))


def turned_about_joint(hits: FloatArray, angle_rad: float) -> FloatArray:
    about = np.array([JOINT_X_M, 0.0, 0.0])
    return se2.transform(np.array([0.0, 0.0, angle_rad]), hits - about) + about


def drive(length_m: float, *, rear: bool = True, joint_deg: float = 0.0) -> list[tuple[FloatArray, AlignedScan]]:
    """Return true poses and scans of a straight drive whose odometry reads short and wanders in heading."""
    rng = np.random.default_rng(3)
    scans, wrong, before = [], np.zeros(3), np.zeros(3)
    for k in range(round(length_m / STEP_M) + 1):
        true = np.array([STEP_M * k, 0.05 * math.sin(0.3 * STEP_M * k), 0.0])
        step = se2.between(before, true) * np.array([0.992, 1.0, 1.0])
        step[2] += rng.normal(0.0, math.radians(0.06) * math.sqrt(STEP_M))
        wrong, before = se2.compose(wrong, step), true
        front, behind = seen(true, 0.8, 1.0, rng), np.zeros((0, 3))
        if rear:
            behind = turned_about_joint(seen(true, REAR_X_M, -1.0, rng), math.radians(joint_deg))
        scans.append((true, AlignedScan(k * STEP_NS, wrong, front, behind, weak=False)))
    return scans


@pytest.mark.parametrize("joint_deg", [0.0, 0.3])
def test_a_wrong_scale_and_heading_are_put_right(joint_deg: float) -> None:
    """40 m, odometry 0.8 % short and wandering in heading; a joint's encoder that is off does not matter."""
    scans, realigner = drive(40.0, joint_deg=joint_deg), Realigner(SETTINGS, JOINT_X_M)
    for _, scan in scans:
        realigner.update(scan)
    realigner.finish()
    before, after = [], []
    for time_ns, pose_map_odom in realigner.moves:
        true, scan = scans[time_ns // STEP_NS]
        before.append(se2.between(true, scan.pose))
        after.append(se2.between(true, se2.compose(pose_map_odom, scan.pose)))
    error, left = np.abs(before).mean(axis=0), np.abs(after).mean(axis=0)
    assert left[0] < 0.2 * error[0]
    assert left[2] < 0.4 * error[2]
    assert np.hypot(*after[-1][:2]) < 0.25 * np.hypot(*before[-1][:2])


def test_without_rear_hits_the_odometry_stands() -> None:
    """Driving on a level floor the front scanner sees nothing twice at the same height from 3 m or more apart."""
    realigner = Realigner(SETTINGS)
    for _, scan in drive(20.0, rear=False):
        realigner.update(scan)
    realigner.finish()
    assert np.abs([T for _, T in realigner.moves]).max() < 1e-6


def test_poses_are_final_after_the_lag_and_not_before() -> None:
    realigner = Realigner(SmoothingSettings(lag_m=8.0))
    for _, scan in drive(12.0):
        realigner.update(scan)
    last_m = STEP_M * realigner.moves.last_ns / STEP_NS
    assert 12.0 - 1.3 * 8.0 - 2 * SETTINGS.node_m - 0.1 < last_m <= 12.0 - 8.0 + 0.1  # it is solved each 0.3 of the lag
    before = list(realigner.moves)
    realigner.finish()
    assert all(old[0] == new[0] and (old[1] == new[1]).all() for old, new in zip(before, realigner.moves, strict=False))
    assert realigner.moves.last_ns >= 12.0 / STEP_M * STEP_NS - 3 * STEP_NS


def test_a_slow_machine_has_no_solution_for_each_node(monkeypatch: pytest.MonkeyPatch) -> None:
    """Slower than the lag in travel by the lag in time, it had one: ten times the work of a fast drive."""
    windows: list[Window] = []

    def counted(window: Window) -> Window:
        windows.append(window)
        return window._replace(unpaired=len(window.nodes))

    monkeypatch.setattr(realign, "solved", counted)
    realigner, slow_ns, (_, scan) = Realigner(SETTINGS), 250_000_000, drive(0.0)[0]  # 0.4 m/s
    for k in range(800):
        pose = np.array([STEP_M * k, 0.0, 0.0])
        realigner.update(scan._replace(time_ns=k * slow_ns, pose=pose))
    duration_s = 800 * slow_ns * 1e-9
    assert len(windows) <= duration_s / (0.1 * SETTINGS.lag_s) + duration_s * 0.4 / (0.3 * SETTINGS.lag_m) + 1
    assert realigner.moves.last_ns >= (duration_s - 1.2 * SETTINGS.lag_s) * 1e9


def test_at_rest_the_path_goes_on() -> None:
    """What waits for it, sweeps of all scanners, must not grow while the machine stands."""
    realigner, (_, scan) = Realigner(SETTINGS), drive(0.0)[0]
    for second in range(120):
        realigner.update(scan._replace(time_ns=second * 10**9))
    assert realigner.moves.last_ns >= (119 - 1.3 * SETTINGS.lag_s) * 1e9


def test_a_machine_that_stands_for_hours_takes_no_more_memory() -> None:
    """Final poses went by travel alone: the matrix of a solution was quadratic in the time at rest."""
    realigner, (_, scan) = Realigner(SETTINGS), drive(0.0)[0]
    for k in range(1000):
        realigner.update(scan._replace(time_ns=k * int(0.21e9 * SETTINGS.lag_s)))
    assert len(realigner.moves) > 900
    assert len(realigner._nodes) < 400


def test_the_final_path_has_all_poses_once_and_keeps_heights() -> None:
    track = Track()
    path = FinalPath(track)
    path.realign(SETTINGS, JOINT_X_M)
    for k, (_, scan) in enumerate(drive(6.0)):
        track.append(scan.time_ns, scan.pose, 0.0, 0.01 * math.sin(k))
        path.update(scan)
    path.finish()
    odometry, final = track.rows(), path.final.rows()
    assert (final.times_ns == odometry.times_ns).all()
    assert (final.poses[:, 2:5] == odometry.poses[:, 2:5]).all()
    assert path.correction() is not None


def test_pairs_are_at_the_same_height_and_from_scans_apart() -> None:
    lines = wall_lines(np.column_stack([np.linspace(0.0, 1.0, 21), np.zeros(21), np.full(21, 1.0)]))
    assert lines.shape == (21, LINE)
    assert np.abs(lines[:, 4]) == pytest.approx(1.0)  # the normal is across the wall
    hits = np.array(
        [[0.5, 0.02, 1.01], [0.5, 0.02, 1.2], [0.5, 0.6, 1.0], [1e6, 1e6, 1.0], [0.5, 1e6, 1.0], [-1e6, -1e6, 1.0]]
    )
    owners, poses, travelled = (np.zeros(21, np.int64), np.ones(6, np.int64)), np.zeros((2, 3)), np.array([0.0, 10.0])
    found = same_height(lines, owners[0], hits, owners[1], poses, travelled, 3.0)
    assert lines[found[0], 0] == pytest.approx(0.5)  # the height and the place are right
    assert (found[1:] == -1).all()  # another height; other places, far from all walls, too
    assert (same_height(lines, owners[0], hits, owners[1], poses, travelled, 11.0) == -1).all()


def test_corners_and_lone_hits_are_no_walls() -> None:
    corner = np.array(
        [[0.0, 0.2, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [9.0, 9.0, 0.0]]
    )
    assert not (np.abs(wall_lines(corner)[:, :2] - corner[2, :2]).max(axis=1) < 0.05).any()
    assert not (wall_lines(corner)[:, 0] > 5.0).any()


def test_no_hits_at_all_are_no_pairs() -> None:
    none, owners = np.zeros((0, 3)), np.zeros(0, np.int64)
    hits, owner = np.zeros((2, 3)), np.zeros(2, np.int64)
    assert same_height(np.zeros((0, LINE)), owners, hits, owner, np.zeros((1, 3)), np.zeros(1), 3.0).tolist() == [
        -1,
        -1,
    ]
    realigner = Realigner(SETTINGS)
    for k in range(400):
        realigner.update(AlignedScan(k * STEP_NS, np.array([0.1 * k, 0.0, 0.0]), none, none, weak=False))
    realigner.finish()
    assert np.abs([T for _, T in realigner.moves]).max() < 1e-9


def test_the_result_does_not_depend_on_how_fast_the_worker_is(monkeypatch: pytest.MonkeyPatch) -> None:
    scans = drive(24.0)

    def moves() -> list[tuple[int, FloatArray]]:
        realigner = Realigner(SETTINGS, JOINT_X_M)
        for _, scan in scans:
            realigner.update(scan)
        realigner.finish()
        return list(realigner.moves)

    def slowly(window: Window) -> Window:
        time.sleep(0.05)
        return solved(window)

    at_once = moves()
    monkeypatch.setattr(realign, "solved", slowly)
    later = moves()
    assert [time_ns for time_ns, _ in later] == [time_ns for time_ns, _ in at_once]
    assert all((one == other).all() for (_, one), (_, other) in zip(at_once, later, strict=True))

"""Rows that need no drive: pairs of scans, pure rotation, cold starts, time a scan, peers."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

import numpy as np
from lhdmap.evaluation.planar_segments import planar_segments
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray, LaserScan
from lhdmap.odometry.range_flow.flow import flow
from lhdmap.odometry.range_flow.scan import Pyramid
from lhdmap.odometry.settings import RangeFlowSettings
from lhdmap.scan_matching.scan_points import planar_points
from lhdmap.simulation.planar import PlanarScanner, PlanarWorld, drive_along, simulate_scans

from tools.evaluate import peers
from tools.evaluate.figures import Figure
from tools.evaluate.odometry_rows import drive_run
from tools.evaluate.worlds import (
    LEVEL,
    ROUGH_M,
    SMOOTH_M,
    Drive,
    aligned,
    odometry,
    run,
    scans_of,
    world_of,
)

FLOW = RangeFlowSettings()
_NO_PRIOR = 1e-3 * np.eye(3)
_PAIR_M = 0.13
_PREDICTION_SIGMAS = np.array([0.01, 0.003, np.radians(0.1)])


def levels_of(scan: LaserScan) -> Pyramid:
    """Return the pyramid of a level scan."""
    return Pyramid(planar_points(scan, LEVEL, np.zeros(3)), FLOW.width_m, FLOW.levels)


def motion_between(first: Pyramid, second: Pyramid, noise_m: float = 0.012) -> FloatArray:
    """Return the motion (3,) by range flow from no motion, coarse to fine."""
    found = flow(first, second, np.zeros(3), _NO_PRIOR, noise_m, coarsest=FLOW.levels - 1, iterations=FLOW.iterations)
    return found.pose_reference_current


def pairs(seeds: Sequence[int]) -> Iterator[Figure]:
    """One pair at 13 cm with the motion model's prediction at hand, and from no motion: rms along, across, in heading."""
    predicted, from_rest, cpu = [], [], []
    for seed in seeds:
        world = world_of(seed, ROUGH_M)
        poses = drive_along(world.centre_line_m, _PAIR_M * 50.0, 50.0)
        scans = simulate_scans(world, poses, PlanarScanner(), 50.0, seed)
        rng = np.random.default_rng(seed)
        before = levels_of(scans[0])
        for k in range(1, len(scans)):
            true = se2.between(poses[k - 1], poses[k])
            guess = true + _PREDICTION_SIGMAS * rng.standard_normal(3)
            started = time.thread_time()
            finest = Pyramid(planar_points(scans[k], LEVEL, np.zeros(3)), FLOW.width_m, 1)
            found = flow(before, finest, guess, _NO_PRIOR, 0.012, iterations=FLOW.iterations)
            cpu.append(time.thread_time() - started)
            predicted.append(se2.between(true, found.pose_reference_current))
            now = levels_of(scans[k])
            from_rest.append(se2.between(true, motion_between(before, now)))
            before = now
    yield from _pair_figures("One pair at 13 cm, range flow (rms)", predicted, (2.0, 1.15, 0.016))
    yield from _pair_figures("One pair at 13 cm, range flow from no motion, coarse to fine (rms)", from_rest, None)
    cpu_ms = 1e3 * np.array(cpu)
    yield Figure(
        "Time a scan, 381 beams, CPU of one core",
        "range flow per pair, median",
        float(np.median(cpu_ms)),
        "ms",
        0.14,
        f"one level, prediction within 1 cm, scan prepared; p99 {np.percentile(cpu_ms, 99):.2f}",
    )


def _pair_figures(group: str, errors: list[FloatArray], targets: tuple[float, float, float] | None) -> Iterator[Figure]:
    rms = np.sqrt(np.mean(np.array(errors) ** 2, axis=0))
    found = np.mean(np.abs(np.array(errors)) < np.array([0.02, 0.02, np.radians(0.2)]), axis=0).min()
    along, across, heading = targets or (None, None, None)
    note = f"{len(errors)} pairs, {100 * found:.1f} % within 2 cm and 0.2°"
    yield Figure(group, "along", 1e3 * rms[0], "mm", along, note)
    yield Figure(group, "across", 1e3 * rms[1], "mm", across)
    yield Figure(group, "heading", float(np.degrees(rms[2])), "°", heading)


def rotation_gain(seeds: Sequence[int]) -> Iterator[Figure]:
    """Turning in place without noise: the angle through the whole odometry over the true one, less one."""
    for method, name in (("range_flow", "range flow"), ("anchored", "default")):
        group, worst = f"Rotation gain, turning in place, no noise, {name}", 0.0
        for degrees in (0.1, 0.2, 0.3, 0.75, 1.0, 3.0):
            gains = [_turned(seed, method, degrees) for seed in seeds]
            deviation = 100 * (float(np.mean(gains)) - 1.0)
            worst = max(worst, abs(deviation))
            each = ", ".join(f"{100 * (gain - 1.0):+.3f}" for gain in gains)
            note = each if method == "anchored" else f"{each}; single pairs {_pair_gain(seeds, degrees)}"
            yield Figure(group, f"{degrees:g}° a frame", deviation, "%", note=note)
        yield Figure(group, "largest deviation", worst, "%", 0.5)


def _turned(seed: int, method: str, degrees: float) -> float:
    """Return estimated over true angle of a turn in place of 30° and more, starting from rest."""
    world = world_of(seed, ROUGH_M)
    place = drive_along(world.centre_line_m, 5.0, 1.0)[5]
    frames = max(round(30.0 / degrees), 60)
    headings = np.radians(degrees) * np.arange(frames + 1)
    poses = place + np.column_stack([np.zeros((frames + 1, 2)), headings])
    scans = simulate_scans(world, poses, PlanarScanner(noise_m=0.0), 25.0, 1)
    found = run(scans, poses, lambda velocity: odometry(method, velocity))
    heading = np.unwrap(found.estimate[:, 2])
    return float((heading[-1] - heading[0]) / (poses[-1, 2] - poses[0, 2]))


def _pair_gain(seeds: Sequence[int], degrees: float) -> str:
    """Return mean and rms of the gain of single pairs, without a prediction, less one in per cent."""
    gains = []
    for seed in seeds:
        world = world_of(seed, ROUGH_M)
        for place in drive_along(world.centre_line_m, 10.0, 1.0):
            turned = place + np.array([0.0, 0.0, np.radians(degrees)])
            first, second = simulate_scans(world, np.array([place, turned]), PlanarScanner(noise_m=0.0), 1.0, 1)
            gains.append(motion_between(levels_of(first), levels_of(second))[2] / np.radians(degrees))
    return f"{100 * (np.mean(gains) - 1.0):+.2f} % (rms {100 * np.std(gains):.2f})"


def cold_start(seeds: Sequence[int], places: int = 40) -> Iterator[Figure]:
    """Two scans, the second displaced: share found within 5 cm and 1°."""
    group = "Cold start: share that is not found (within 5 cm and 1°) at the second scan"
    for dt_s in (0.04, 0.1, 0.2):
        for name, shift_m, turn_deg in (("0.75 m", 0.75, 0.0), ("30°", 0.0, 30.0)):
            motion = (shift_m, turn_deg)
            good = [found for seed in seeds for found in _starts(seed, motion, dt_s, places)]
            missed_pct = 100 * good.count(False) / len(good)
            yield Figure(group, f"{name}, {1 / dt_s:g} Hz", missed_pct, "%", 5.0, f"{len(good)} starts")


def _starts(seed: int, motion: tuple[float, float], dt_s: float, places: int) -> list[bool]:
    rng, world = np.random.default_rng(seed), world_of(seed, ROUGH_M)
    line = drive_along(world.centre_line_m, 1.0, 1.0)
    chosen = line[rng.choice(len(line), places, replace=False)]
    return [_found(world, place, _displaced(rng, *motion), dt_s) for place in chosen]


def _displaced(rng: np.random.Generator, shift_m: float, turn_deg: float) -> FloatArray:
    way = rng.uniform(-np.pi, np.pi)
    sign = rng.choice([-1.0, 1.0])
    lateral = 0.6 if shift_m else 0.0  # the drift is 4 m wide: mostly along it
    return np.array([shift_m * np.cos(way * lateral), shift_m * np.sin(way * lateral), sign * np.radians(turn_deg)])


def _found(world: PlanarWorld, place: FloatArray, motion: FloatArray, dt_s: float) -> bool:
    poses = np.array([place, se2.compose(place, motion)])
    scans = simulate_scans(world, poses, PlanarScanner(), 1.0 / dt_s, 5)
    stage = odometry()
    first = stage.update(scans[0], LEVEL)
    error = se2.between(motion, se2.between(first.pose_odom_base, stage.update(scans[1], LEVEL).pose_odom_base))
    return bool(np.hypot(error[0], error[1]) < 0.05 and abs(np.degrees(error[2])) < 1.0)


def time_a_scan() -> Iterator[Figure]:
    """CPU time of the anchored odometry; every scan processed at 12 km/h and 25 Hz."""
    group = "Time a scan, 381 beams, CPU of one core"
    for step_deg, targets in ((0.5, (0.5, 1.0)), (0.25, (None, None))):
        cpu_ms = drive_run(Drive(step_deg=step_deg)).cpu_ms[20:]
        beams = round(190 / step_deg) + 1
        yield Figure(group, f"anchored, {beams} beams, median", float(np.median(cpu_ms)), "ms", targets[0])
        yield Figure(group, f"anchored, {beams} beams, p99", float(np.percentile(cpu_ms, 99)), "ms", targets[1])


def peer_rows(seeds: Sequence[int]) -> Iterator[Figure]:
    """Peers on the same drives: 10 m, 12 km/h, 25 Hz, 381 beams."""
    group = "Peers in the same run, 12 km/h, 25 Hz, 381 beams (10 m)"
    methods = {"KISS-ICP 1.3, z = 0, 0.3 m voxels": peers.kiss_icp, "point-to-line ICP, key scans": peers.point_to_line}
    for walls, rms_m in (("rough", ROUGH_M), ("smooth", SMOOTH_M)):
        for name, method in methods.items():
            errors = []
            for seed in seeds:
                truth, scans = scans_of(Drive(seed, rms_m=rms_m))
                found = planar_segments(aligned(method(scans), truth), truth)
                errors.append(found.translation_pct)
            yield Figure(
                group, f"{name}, {walls}", float(np.mean(errors)), "%", note=", ".join(f"{e:.3f}" for e in errors)
            )

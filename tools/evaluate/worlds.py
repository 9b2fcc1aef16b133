"""Planar drives with truth: what the tables of the odometry are measured on, and the errors of an estimate against them."""

from __future__ import annotations

import functools
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray, LaserScan
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.settings import AnchorSettings, OdometrySettings, RangeFlowSettings, SearchSettings
from lhdmap.odometry.start import Maker, ScanInput, starting_velocity
from lhdmap.odometry.steps import OdometryStep, WheelStep
from lhdmap.pipeline.track import TrackRows, resample
from lhdmap.simulation.planar import PlanarScanner, PlanarWorld, drift_world, drive_along, simulate_scans

BoolArray = npt.NDArray[np.bool_]
LEVEL = np.eye(4)
ROUGH_M, MODERATE_M, SMOOTH_M = 0.12, 0.03, 0.005
SEEDS = (101, 102, 103)  # worlds that no setting was chosen on
WARM_SCANS = 50  # of the dry run at the start, as the pipeline takes


@dataclass(frozen=True, slots=True)
class Drive:
    """One drive of a table: world, speed, scanner."""

    seed: int = SEEDS[0]
    speed_kmh: float = 12.0
    rate_hz: float = 25.0
    rms_m: float = ROUGH_M
    step_deg: float = 0.5
    noise_m: float = 0.012
    max_range_m: float = 80.0
    sweep: bool = False
    dusty: bool = False


class Run(NamedTuple):
    """An estimate beside its truth: poses (N, 3), steps of the odometry, CPU time of the processed scans (ms)."""

    truth: FloatArray
    estimate: FloatArray
    steps: list[OdometryStep]
    cpu_ms: FloatArray


@functools.lru_cache(maxsize=6)
def world_of(seed: int, rms_m: float) -> PlanarWorld:
    """Return the drift of 180 m with that roughness."""
    return drift_world(seed, rms_m=rms_m)


@functools.lru_cache(maxsize=4)
def scans_of(drive: Drive) -> tuple[FloatArray, list[LaserScan]]:
    """Return true poses (N, 3) and scans of a drive."""
    world = world_of(drive.seed, drive.rms_m)
    poses = drive_along(world.centre_line_m, drive.speed_kmh / 3.6, drive.rate_hz)
    scanner = PlanarScanner(noise_m=drive.noise_m, max_range_m=drive.max_range_m, step_deg=drive.step_deg)
    scans = simulate_scans(world, poses, scanner, drive.rate_hz, drive.seed, sweep=drive.sweep)
    if drive.dusty:
        rng = np.random.default_rng(drive.seed + 7)
        scans = [dusty(scan, rng) for scan in scans]
    return poses, scans


def dusty(scan: LaserScan, rng: np.random.Generator) -> LaserScan:
    """Return the scan with 3 % early returns, half of the beams at depth edges mixed with a neighbour, 5 % drop-outs."""
    r = scan.ranges_m.astype(float)
    n = r.size
    neighbour = np.where(rng.random(n) < 0.5, np.roll(r, 1), np.roll(r, -1))
    mixed = _edges(r) & np.isfinite(neighbour) & (rng.random(n) < 0.5)
    share = rng.random(n)
    r = np.where(mixed, share * r + (1.0 - share) * neighbour, r)
    early = rng.random(n) < 0.03
    r = np.where(early & np.isfinite(r), 0.3 + rng.random(n) * (r - 0.3), r)
    r[rng.random(n) < 0.05] = np.inf
    return scan._replace(ranges_m=r.astype(np.float32))


def _edges(ranges_m: FloatArray) -> BoolArray:
    """Return which beams stand at a depth edge: a step of 0.3 m that is three times the steps beside it (no grazed wall)."""
    step = np.abs(np.diff(ranges_m, append=ranges_m[-1]))
    beside = np.maximum(np.roll(step, 1), np.roll(step, -1))
    after = np.isfinite(step) & (step > 0.3) & (step > 3.0 * beside)
    edges: BoolArray = (after | np.roll(after, 1)) & np.isfinite(ranges_m)
    return edges


def wheels_of(truth: FloatArray, rate_hz: float, seed: int) -> list[WheelStep]:
    """Return tachometer steps with 1 % scale error, 0.02 m/s noise (50 Hz), slip bursts of 2 s with half as much again."""
    rng = np.random.default_rng(seed + 11)
    scale = 1.0 + 0.01 * rng.choice([-1.0, 1.0])
    sigma_m = 0.02 / rate_hz * np.sqrt(rate_hz / 50.0)
    steps = [WheelStep(0.0, sigma_m, None, 0.0)]
    next_s = rng.uniform(4.0, 10.0)
    for k in range(1, len(truth)):
        time_s = k / rate_hz
        if time_s > next_s + 2.0:
            next_s = time_s + rng.uniform(8.0, 15.0)
        slip = 1.5 if next_s <= time_s <= next_s + 2.0 else 1.0
        forward = float(se2.between(truth[k - 1], truth[k])[0])
        steps.append(WheelStep(forward * scale * slip + sigma_m * rng.standard_normal(), sigma_m, None, 0.0))
    return steps


def odometry(method: str = "anchored", velocity: FloatArray | None = None, **values: float) -> PlanarOdometry:
    """Return a planar odometry with the default settings but for `values` of its first section."""
    settings = OdometrySettings(method=method, **values)  # type: ignore[arg-type]
    return PlanarOdometry(settings, AnchorSettings(), SearchSettings(), RangeFlowSettings(), velocity)


def run(
    scans: Sequence[LaserScan],
    truth: FloatArray,
    make: Maker,
    wheels: list[WheelStep] | None = None,
) -> Run:
    """Send all scans through the odometry as the pipeline does: a dry run first tells the speed at the start.

    `make` builds the odometry with a starting velocity. Skipped scans lie between the processed ones.
    """
    inputs = [ScanInput(scan, LEVEL, wheels[k] if wheels else None) for k, scan in enumerate(scans)]
    stage = make(starting_velocity(make, inputs[:WARM_SCANS]))
    steps, cpu = [], []
    for one in inputs:
        started = time.thread_time()
        step = stage.update(*one)
        if step.processed:
            cpu.append(time.thread_time() - started)
        steps.append(step)
    return Run(truth, aligned(interpolated(steps), truth), steps, 1e3 * np.array(cpu))


def interpolated(steps: list[OdometryStep]) -> FloatArray:
    """Return a pose (N, 3) at every scan's stamp, heading unwrapped; the odometry's are those of the sweeps' middles."""
    used = [step for step in steps if step.processed]
    planar = np.array([step.pose_odom_base for step in used])
    rows = np.zeros((len(used), 6))
    rows[:, [0, 1]], rows[:, 5] = planar[:, :2], np.unwrap(planar[:, 2])
    known = np.array([step.time_ns for step in used], dtype=np.int64)
    at = np.array([step.stamp_ns for step in steps], dtype=np.int64)
    return resample(TrackRows(known, rows), at).poses[:, [0, 1, 5]]


def aligned(estimate: FloatArray, truth: FloatArray) -> FloatArray:
    """Return the estimate (N, 3) moved so that its first pose is the true one."""
    move = se2.compose(truth[0], se2.inverse(estimate[0]))
    return np.array([se2.compose(move, pose) for pose in estimate])


def end_pct(run_: Run) -> float:
    """Return the distance of the last pose from the true one, per cent of the path."""
    path_m = float(np.hypot(*np.diff(run_.truth[:, :2], axis=0).T).sum())
    return float(np.hypot(*(run_.estimate[-1, :2] - run_.truth[-1, :2]))) / path_m * 100.0

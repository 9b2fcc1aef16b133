"""CPU time of each stage for one scan, beside a reference kernel that is timed in between: a ratio that any machine repeats."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numba as nb
import numpy as np
from lhdmap.config import Settings
from lhdmap.geometry import se2, se3
from lhdmap.integration.integrator import Integrator
from lhdmap.integration.project import SweepPoses
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, LaserScan, Mount
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.range_flow.flow import Flow, flow
from lhdmap.odometry.range_flow.scan import Pyramid
from lhdmap.odometry.settings import OdometrySettings, RangeFlowSettings
from lhdmap.scan_matching.matching import Hits
from lhdmap.scan_matching.scan_points import planar_points
from lhdmap.scan_matching.submap import Submap, unsure
from lhdmap.simulation.planar import PlanarScanner, drift_world, drive_along, simulate_scans

from tools.evaluate.figures import Figure

LEVEL, RATE_HZ, SPEED_MPS = np.eye(4), 25.0, 12.0 / 3.6
_GROUP = "CPU time a scan by stage"
_WARM = 30
_NO_PRIOR = 1e-3 * np.eye(3)
_SUBMAP_CELL_M = 0.04


@nb.njit(cache=True)
def reference_kernel(turns: int) -> float:
    """A fixed piece of work: sines, roots and divisions, one after the other."""
    total = 0.5
    for k in range(turns):
        total = math.sqrt(abs(math.sin(total + k))) / (1.0 + 0.1 * total) + 0.3
    return total


class Timer:
    """Times calls, and the reference kernel between them."""

    def __init__(self) -> None:
        reference_kernel(10)
        self.reference_ms: list[float] = []

    def times_ms(self, calls: Iterator[Callable[[], Any]]) -> FloatArray:
        """Return the CPU time of each call after the first ones, milliseconds."""
        found = []
        for k, call in enumerate(calls):
            started = time.thread_time()
            call()
            found.append(1e3 * (time.thread_time() - started))
            if k % 10 == 0:
                started = time.thread_time()
                reference_kernel(50_000)
                self.reference_ms.append(1e3 * (time.thread_time() - started))
        return np.array(found[_WARM:])


def stage_figures() -> Iterator[Figure]:
    """Measure all stages on a planar drive of 90 m."""
    timer = Timer()
    rows: list[tuple[str, FloatArray, tuple[float | None, float | None]]] = []
    for step_deg in (0.5, 0.25):
        poses, scans = _drive(step_deg)
        beams = f"{scans[0].ranges_m.size} beams"
        goal = step_deg == 0.5
        rows.append((f"hits in the level plane, {beams}", timer.times_ms(_points(scans)), (None, None)))
        rows.append(
            (f"range flow, a pair, {beams}", timer.times_ms(_pairs(poses, scans)), (0.14 if goal else None, None))
        )
        for method, name in (("anchored", "default odometry"), ("range_flow", "range-flow odometry")):
            targets = (0.5, 1.0) if goal and method == "anchored" else (None, None)
            rows.append((f"{name}, {beams}", timer.times_ms(_odometry(scans, method)), targets))
        rows.append((f"integration, {beams}", timer.times_ms(_integration(poses, scans)), (None, None)))
    poses, scans = _drive(0.19)  # 1,001 beams
    hits = [planar_points(scan, LEVEL, np.zeros(3))[:1000] for scan in scans[:300]]
    rows.append(("scan matching, 1,000 hits: map of a scan", timer.times_ms(_maps(hits)), (None, None)))
    rows.append(("scan matching, 1,000 hits: match with it", timer.times_ms(_matches(poses, hits)), (1.0, None)))
    reference = float(np.median(timer.reference_ms))
    yield Figure(_GROUP, "reference kernel (50,000 sines, roots, divisions)", reference, "ms", note="ratio 1")
    for name, times, (median, p99) in rows:
        middle = float(np.median(times))
        yield Figure(_GROUP, f"{name}: median", middle, "ms", median, f"{middle / reference:.2f} × reference")
        yield Figure(_GROUP, f"{name}: p99", float(np.percentile(times, 99)), "ms", p99)


def _drive(step_deg: float) -> tuple[FloatArray, list[LaserScan]]:
    world = drift_world(101)
    poses = drive_along(world.centre_line_m, SPEED_MPS, RATE_HZ)[:700]
    return poses, simulate_scans(world, poses, PlanarScanner(step_deg=step_deg), RATE_HZ, 1)


def _points(scans: list[LaserScan]) -> Iterator[Callable[[], Any]]:
    velocity = np.array([SPEED_MPS, 0.0, 0.0])
    for scan in scans:
        yield partial(planar_points, scan, LEVEL, velocity)


def _pairs(poses: FloatArray, scans: list[LaserScan]) -> Iterator[Callable[[], Any]]:
    """The newer scan prepared and compared on the finest level; the prediction is 1 cm off."""
    settings, none = RangeFlowSettings(), np.zeros(3)
    for k in range(1, len(scans)):
        before = Pyramid(planar_points(scans[k - 1], LEVEL, none), settings.width_m, 1)
        points = planar_points(scans[k], LEVEL, none)
        guess = se2.between(poses[k - 1], poses[k]) + np.array([0.01, 0.003, 0.001])
        yield partial(_compare, before, points, guess, settings)


def _compare(before: Pyramid, points: FloatArray, guess: FloatArray, settings: RangeFlowSettings) -> Flow:
    now = Pyramid(points, settings.width_m, 1)
    return flow(before, now, guess, _NO_PRIOR, 0.012, iterations=settings.iterations)


def _maps(hits: list[FloatArray]) -> Iterator[Callable[[], Any]]:
    for points in hits:
        yield partial(Submap.of, points, _SUBMAP_CELL_M)


def _matches(poses: FloatArray, hits: list[FloatArray]) -> Iterator[Callable[[], Any]]:
    """The newer scan aligned with the map of the one before; the prediction is 1 cm off."""
    for k in range(1, len(hits)):
        submap = Submap.of(hits[k - 1], _SUBMAP_CELL_M)
        guess = se2.between(poses[k - 1], poses[k]) + np.array([0.01, 0.003, 0.001])
        yield partial(submap.align, Hits(hits[k], len(hits[k]), layered=False), unsure(guess))


def _odometry(scans: list[LaserScan], method: str) -> Iterator[Callable[[], Any]]:
    stage = PlanarOdometry(OdometrySettings(method=method))
    for scan in scans:
        yield partial(stage.update, scan, LEVEL)


def _integration(poses: FloatArray, scans: list[LaserScan]) -> Iterator[Callable[[], Any]]:
    mount = Mount(0, "base_link", "laser", se3.from_rpy(0.0, 0.0, 0.0, (0.0, 0.0, 1.8)))
    stage = Integrator(Settings().integration, (mount,), replace(Machine(), bodies={}))
    for scan, pose in zip(scans, poses, strict=True):
        T = se3.from_rpy(0.0, 0.0, float(pose[2]), (float(pose[0]), float(pose[1]), 0.0))
        yield partial(stage.update, scan, SweepPoses(T, T, 0.0, 0.0))


def reading_figure(log: Path, reference_ms: float) -> Figure:
    """Return the time to read and decode one scan of a log."""
    started, scans = time.thread_time(), 0
    with LogSource([log]) as source:
        for _ in source.messages(["front", "rear"]):
            scans += 1
    each = 1e3 * (time.thread_time() - started) / max(scans, 1)
    return Figure(
        _GROUP,
        "reading a scan of the log (MCAP, CDR), 761 beams: mean",
        each,
        "ms",
        None,
        f"{each / reference_ms:.2f} × reference",
    )

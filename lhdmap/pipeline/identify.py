"""Pile identification of a log, alone: the stages of the mapping pipeline without cloud, report and recording."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lhdmap.config import Settings
from lhdmap.errors import InputError, UsageError
from lhdmap.geometry import se3
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, LaserScan, Message, Mount
from lhdmap.pile.clouds.heap import measure_cloud
from lhdmap.pile.face import FaceRegistration
from lhdmap.pile.result import PileApproach, PileReport, Snapshot
from lhdmap.pipeline.front_end import own_boxes
from lhdmap.pipeline.given import given_rows
from lhdmap.pipeline.mapping import MappingOptions, MappingPipeline, feed
from lhdmap.pipeline.mounts import SensorMounts, level_sensor, machine_of
from lhdmap.pipeline.pile import NO_INCLINOMETER, PileWatch, PlacedScan
from lhdmap.pipeline.said import said_once
from lhdmap.pipeline.sweep_times import SweepTimes
from lhdmap.pipeline.track import FinalTrack, TrackRows
from lhdmap.roles import PILE, read_by
from lhdmap.scan_matching.scan_points import half_sweep_ns

_LEVEL = (
    "no inclinometer in the log: no pile was looked for, its slope shows only where roll and pitch are known; "
    "--poses gives them"
)
_HALF_STEP_NS = 25_000_000
_GIVEN_POSES = FaceRegistration(scale=2e-4, pitch_rad=math.radians(0.15))  # the mounting's tilt is still the log's


def identify(
    log: Path,
    settings: Settings,
    poses: str = "",
    machine: Machine | None = None,
    topics: Mapping[str, str] | None = None,
) -> PileReport:
    """Find and measure the pile at the end of the drive in `log`; `poses`, `machine`, `topics`: as for `build-map`.

    Raises:
        InputError: the log holds no usable scan.
        UsageError: the settings say that no pile is looked for.
    """
    if settings.pile.method == "off":
        raise UsageError("pile.method = off: there is nothing to do; surface was wanted, or figure9")
    with LogSource([log], topics) as source:
        body = machine_of(source, machine)
        told = (*source.warnings, *source.damage)
        if "front" not in source.roles:
            if poses:
                raise UsageError(
                    "--poses: in the log of a 3D scanner the pile is looked for in the map of its own odometry"
                )
            return _warned(_in_cloud(source, settings, body), told)
        if poses:
            rows = given_rows(poses, [log], topics or {})
            return _warned(identify_along(rows, [log], settings, body, topics), (*told, *source.damage))
        pipeline = MappingPipeline(settings, body, MappingOptions(cloud=False))
        feed(pipeline, _read(source))
    if pipeline.pile is None or not len(pipeline.track):
        raise InputError(f"{log}: no usable scan of a front scanner in it; lhdmap doctor tells what is wrong")
    told = (*told, *source.damage, *pipeline.warnings)
    if not pipeline.has_inclinometer:
        return _warned(PileReport(None, None, method=settings.pile.method, reason=NO_INCLINOMETER), (*told, _LEVEL))
    return _warned(pipeline.pile.report(), told)


def _read(source: LogSource) -> Iterator[tuple[str, Message]]:
    return source.messages([role for role in read_by(PILE) if role in source.roles])


def _in_cloud(source: LogSource, settings: Settings, machine: Machine | None) -> PileReport:
    """Look for the pile in the cloud of a 3D scanner: it sees the face at once, no drive is needed to climb it."""
    pipeline = MappingPipeline(settings, machine, MappingOptions("points"))
    feed(pipeline, _read(source))
    if not len(pipeline.track):
        raise InputError(f"{source.paths[0]}: no usable cloud in it; lhdmap doctor tells what is wrong")
    estimate = measure_cloud(pipeline.sweeps.cloud().points_m.astype(np.float64), "z").estimate
    last = Snapshot(pipeline.track.last_ns or 0, math.nan, estimate)
    decision = last if estimate.found and estimate.status not in (None, "none") else None
    piles = () if decision is None else (PileApproach(decision, last),)
    return PileReport(decision, last, (last,), "cloud", piles=piles)


def _warned(report: PileReport, told: Sequence[str]) -> PileReport:
    """Return the report with what is to be said of its log, each once."""
    return replace(report, warnings=tuple(said_once((*report.warnings, *told))))


def identify_along(
    rows: TrackRows,
    logs: Sequence[Path],
    settings: Settings,
    machine: Machine | None,
    topics: Mapping[str, str] | None = None,
    window_ns: tuple[int, int] | None = None,
) -> PileReport:
    """Run the pile stage alone, on poses that are known: given ones, or those of a map whose loops were closed."""
    watch = PileWatch(settings, _GIVEN_POSES)
    for scan in placed_along(rows, logs, settings, machine, topics, window_ns):
        watch.update(scan)
    return watch.report()


def placed_along(
    rows: TrackRows,
    logs: Sequence[Path],
    settings: Settings,
    machine: Machine | None,
    topics: Mapping[str, str] | None = None,
    window_ns: tuple[int, int] | None = None,
) -> Iterator[PlacedScan]:
    """Yield the front scans with where they were taken, on poses that are known; scans without a pose are left out."""
    track, mounts, sweep_times = FinalTrack(rows), SensorMounts(machine), SweepTimes()
    boxes = own_boxes(machine, settings.integration.body_margin_m)
    with LogSource(list(logs), topics, window_ns=window_ns) as source:
        for _, message in source.messages([role for role in ("tf_static", "front") if role in source.roles]):
            if isinstance(message, Mount):
                mounts.update(message)
            elif isinstance(message, LaserScan):
                message = sweep_times.checked("front", message)
                time_ns = message.stamp_ns + half_sweep_ns(message)
                if not track.covers(time_ns):
                    continue
                T = track.matrices_at(np.array([time_ns]))[0]
                roll, pitch, heading = se3.to_rpy(T)
                pose = np.array([*T[:3, 3], heading])
                T_level_sensor = level_sensor(mounts.of(message.frame_id, "front"), roll, pitch)
                yield PlacedScan(message, T_level_sensor, _velocity(track, time_ns), boxes, pose)


def _velocity(track: FinalTrack, time_ns: int) -> FloatArray:
    """Return forward, lateral and turning speed (3,) at a time, from the poses around it."""
    before, after = track.matrices_at(np.array([time_ns - _HALF_STEP_NS, time_ns + _HALF_STEP_NS]))
    step = np.linalg.inv(before) @ after
    duration_s = 2e-9 * _HALF_STEP_NS
    velocity: FloatArray = np.array([step[0, 3], step[1, 3], math.atan2(step[1, 0], step[0, 0])]) / duration_s
    return velocity

"""`build-map` as a function: logs in, map folder out. Reads once, keeps what is finished when interrupted."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from lhdmap.config import Settings, settings_table, settings_toml
from lhdmap.errors import InputError
from lhdmap.integration.cloud import Cloud
from lhdmap.integration.cloud_io import write_cloud
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.mapfolder import MapFolderWriter, MapInfo
from lhdmap.messages import Joints, LaserScan, Message, PointCloud
from lhdmap.pile.result import PileReport
from lhdmap.pipeline.beside import Beside, HelperDied, Here
from lhdmap.pipeline.given import given_rows
from lhdmap.pipeline.identify import identify_along
from lhdmap.pipeline.inspection import Inspection, Inspector, PileBeside, peak_memory_mib
from lhdmap.pipeline.interruption import Interruption
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.mounts import machine_of
from lhdmap.pipeline.sweeps import SweepIntegration
from lhdmap.pipeline.track import FinalTrack, Rows, resample, trajectory_of
from lhdmap.proprioception.wheels import WheelOdometry
from lhdmap.provenance import source_entry
from lhdmap.report.data import ReportData, Summary, TopicRow
from lhdmap.report.recording import Thinning
from lhdmap.smoothing.smoother import corrected
from lhdmap.trajectory import Trajectory

ROLES_READ = ("front", "rear", "points", "inclinometer", "joints", "tachometer", "wheel_odometry", "tf_static")
_BESIDE_FROM_S = 60.0  # a process takes most of a second to start
Progress = Callable[[Iterable[tuple[str, Message]], float], Iterable[tuple[str, Message]]]


@dataclass(frozen=True, slots=True)
class BuildRequest:
    """What is to be built: logs, the folder to make, settings, topics by role, the machine, how to show progress.

    `poses`: given poses for the cloud and the final trajectory (`given.given_rows`); empty: the odometry's.
    `helper`: whether a second process may look for the pile, record and report; what comes out is the same.
    """

    logs: Sequence[Path]
    target: Path
    settings: Settings = field(default_factory=Settings)
    topics: Mapping[str, str] = field(default_factory=dict)
    machine: Machine | None = None
    progress: Progress | None = None
    poses: str = ""
    helper: bool = False


@dataclass(frozen=True, slots=True)
class BuildResult:
    """What came of it: the folder, the figures of `build-map --json`, the final trajectory."""

    folder: Path
    summary: dict[str, Any]
    warnings: list[str]
    trajectory: Trajectory


def build_map(request: BuildRequest) -> BuildResult:
    """Read the logs, run the pipeline, write the map folder.

    Raises:
        InputError: a log cannot be used, or holds no scan.
    """
    started = time.monotonic()
    given = given_rows(request.poses, request.logs, request.topics) if request.poses else None
    with LogSource(list(request.logs), request.topics) as source, MapFolderWriter(request.target) as folder:
        hashes, pool = _hash_in_background(request.logs)
        with pool, _inspector(request, source, folder.path) as inspector:
            primary: Literal["front", "points"] = "front" if "front" in source.roles else "points"
            pipeline = MappingPipeline(
                request.settings,
                machine_of(source, request.machine),
                _sweep_sink(inspector),
                primary,
                pile=PileBeside(inspector),
            )
            interrupted = _run(pipeline, source, request.progress)
            outcome = _Outcome(request, source, pipeline, started, given)
            beside_mib = _write(folder, outcome, inspector)
        if interrupted:  # what was finished is kept under the partial name
            raise KeyboardInterrupt
        info = MapInfo(request.logs, settings_table(request.settings), outcome.summary, outcome.warnings)
        final = folder.complete(info, {path: future.result() for path, future in hashes.items()})
    summary = outcome.summary | {"map": str(final)} | _cost(started, outcome.duration_s, beside_mib)
    return BuildResult(final, summary, outcome.warnings, outcome.final)


def _run(pipeline: MappingPipeline, source: LogSource, progress: Progress | None) -> bool:
    """Send all messages through the stages; return whether Ctrl-C ended it: the stages then finish with what they have."""
    interruption = Interruption()
    messages: Iterable[tuple[str, Message]] = source.messages([role for role in ROLES_READ if role in source.roles])
    if progress is not None:
        messages = progress(messages, source.duration_s)
    with interruption:
        for role, message in messages:
            pipeline.update(role, message)
            if interruption.asked:
                break
    pipeline.finish()
    if not len(pipeline.track):
        damage = f" ({source.damage[0]})" if source.damage else ""
        raise InputError(f"{source.paths[0]}: no usable scan in it{damage}; lhdmap doctor tells what is wrong")
    return interruption.asked


class _Outcome:
    """Everything that the files of the map folder are made from."""

    def __init__(
        self,
        request: BuildRequest,
        source: LogSource,
        pipeline: MappingPipeline,
        started: float,
        given: Rows | None = None,
    ) -> None:
        self.request, self.source, self.pipeline = request, source, pipeline
        records = pipeline.records
        stamps, times = np.array(records.stamps_ns, dtype=np.int64), np.array(records.times_ns, dtype=np.int64)
        self.odometry = trajectory_of(resample(pipeline.track.rows(), times), stamps)
        rows = pipeline.path.final.rows() if given is None else given
        correction = None if given is not None else pipeline.smoother.correction(pipeline.path.correction())
        if correction is not None:
            rows = Rows(rows.times_ns, corrected(rows.poses, rows.times_ns, correction))
        self.final = trajectory_of(resample(rows, times), stamps)
        moved = given is not None or correction is not None
        self.cloud: Cloud = integrate_again(request, pipeline, rows) if moved else pipeline.sweeps.cloud()
        self.pile = self._pile(rows, moved=moved)
        self.duration_s = float(times[-1] - times[0]) * 1e-9 if len(times) else 0.0
        self.warnings = [*source.warnings, *source.damage, *pipeline.warnings, *_remarks(pipeline)]
        steps = np.diff(rows.poses[:, :3], axis=0)
        self.summary: dict[str, Any] = {
            "scans": len(stamps),
            "scans_processed": records.processed,
            "duration_s": self.duration_s,
            "distance_m": float(np.linalg.norm(steps, axis=1).sum()),
            **_cost(started, self.duration_s),
            "degenerate_share": records.degenerate_share,
            "lost_stretches": records.lost_stretches,
            "closures": 0 if correction is None else correction.closures,
            "pile": self.pile.to_json()["status"] if self.pile is not None else None,
        }

    def _pile(self, rows: Rows, *, moved: bool) -> PileReport | None:
        """Return what is said of the pile, on the final poses; None where none was looked for."""
        stage, request = self.pipeline.pile, self.request
        if stage is None or not self.pipeline.has_inclinometer:
            return None
        if not moved:
            with contextlib.suppress(HelperDied):  # looked for anew below, and told of when the report is written
                return self.pipeline.path.moved(stage.report())
        machine = self.pipeline.machine
        return identify_along(rows, request.logs, request.settings, machine, request.topics)

    def report(self) -> ReportData:
        """Return the data of the HTML page and of the recording."""
        records = self.pipeline.records
        return ReportData(
            title=self.request.target.name,
            summary=Summary(**{key: value for key, value in self.summary.items() if key != "pile"}),
            topics=_topic_rows(self.source),
            trajectory=self.final,
            odometry=self.odometry,
            cloud=self.cloud,
            diagnostics=records.diagnostics(),
            odometry_speed=records.speed(),
            tachometer_speed=records.tachometer(),
            articulation=records.articulation(),
            has_inclinometer=self.pipeline.has_inclinometer,
            pile=self.pile,
            warnings=self.warnings,
            settings_text=settings_toml(self.request.settings),
            provenance={"log": ", ".join(path.name for path in self.request.logs)},
        )


def integrate_again(request: BuildRequest, pipeline: MappingPipeline, rows: Rows) -> Cloud:
    """Read the scans once more and integrate them at their final poses: closed loops have moved them, or they are given.

    Sweeps before the first pose or after the last are left out.
    """
    sweeps = SweepIntegration(request.settings, pipeline.machine, pipeline.mounts, None)
    wheels = WheelOdometry(request.settings.wheels, pipeline.machine or Machine())
    track, times = FinalTrack(rows), iter(pipeline.records.times_ns)
    with LogSource(list(request.logs), request.topics) as source:
        for role, message in source.messages(
            [role for role in ("front", "rear", "points", "joints") if role in source.roles]
        ):
            if isinstance(message, Joints):
                wheels.update(message)
            elif isinstance(message, (LaserScan, PointCloud)):
                time_ns = next(times, message.stamp_ns) if role == "front" else message.stamp_ns
                if track.covers(time_ns):
                    sweeps.add_final(role, time_ns, message, track, wheels)
    sweeps.wait(track, wheels)
    return sweeps.cloud()


def _write(folder: MapFolderWriter, outcome: _Outcome, inspector: Inspector) -> float:
    """Write all files of the map but `map.json`; return the memory that a process beside this one took, MiB."""
    shown = outcome.report(), outcome.pipeline.machine or Machine(bodies={})
    inspector.tell(Inspection.write, *shown)
    folder.write_trajectory(outcome.final)
    folder.write_odometry(outcome.odometry)
    folder.write_diagnostics(outcome.pipeline.records.diagnostics())
    write_cloud(folder.path / "cloud.ply", outcome.cloud)
    if outcome.pile is not None:
        folder.write_json("pile.json", outcome.pile.to_json())
    try:
        peak_mib = inspector.ask(Inspection.peak_memory_mib)
    except HelperDied as error:
        outcome.warnings.append(f"{error}; the recording has no scans in it")
        with _inspection(Here, outcome.request, outcome.source, folder.path) as here:
            here.ask(Inspection.write, *shown)
        return 0.0
    return peak_mib if isinstance(inspector, Beside) else 0.0


def _inspector(request: BuildRequest, source: LogSource, folder: Path) -> Inspector:
    """Return where the inspection happens: beside this process where that is wanted and pays."""
    beside = request.helper and source.duration_s >= _BESIDE_FROM_S and _cores() > 1
    return _inspection(Beside if beside else Here, request, source, folder)


def _inspection(make: Callable[..., Inspector], request: BuildRequest, source: LogSource, folder: Path) -> Inspector:
    return make(Inspection, folder, request.target.name, source.start_ns or 0, request.settings)


def _cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _sweep_sink(inspector: Inspector) -> Callable[[str, int, Any], None]:
    thinning = Thinning()

    def take(role: str, stamp_ns: int, points_map: Any) -> None:
        if thinning.take(stamp_ns, role):
            inspector.tell(Inspection.record, stamp_ns, points_map.copy(), role)

    return take


def _hash_in_background(logs: Sequence[Path]) -> tuple[dict[Path, Any], ThreadPoolExecutor]:
    pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix="hash")
    return {path: pool.submit(source_entry, path) for path in logs}, pool


def _topic_rows(source: LogSource) -> list[TopicRow]:
    used = {topic: role for role, topic in source.roles.items()}
    rows = []
    for inventory in source.inventory():
        for topic in inventory.topics.values():
            role = used.get(topic.name)
            remark = f"used as {role}" if role in ROLES_READ else "not an input"
            rows.append(TopicRow(topic.name, topic.type_name, topic.count, topic.rate_hz, remark))
    return rows


def _remarks(pipeline: MappingPipeline) -> list[str]:
    """Return warnings about the run as a whole."""
    remarks = []
    lost = pipeline.records.lost_stretches
    if lost:
        remarks.append(f"odometry: {lost} stretch(es) where the scan did not fit; the pose there is the motion model's")
    share = pipeline.records.degenerate_share
    if share > 0.2:
        remarks.append(f"odometry: in {100 * share:.0f} % of the scans a direction is weakly observed (smooth walls?)")
    if not pipeline.has_inclinometer and pipeline.clouds is None:
        remarks.append("no inclinometer in the log: the drive is treated as planar, heights are not observed")
    if pipeline.sweeps.integrator.totals.refused_sweeps:
        remarks.append(
            f"integration: {pipeline.sweeps.integrator.totals.refused_sweeps} sweeps without a finite pose left out"
        )
    return remarks


def _cost(started: float, duration_s: float, beside_mib: float = 0.0) -> dict[str, float]:
    wall_s = max(time.monotonic() - started, 1e-6)
    peak = peak_memory_mib() + beside_mib
    return {"wall_s": wall_s, "realtime_factor": duration_s / wall_s, "peak_memory_mib": peak}

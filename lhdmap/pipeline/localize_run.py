"""`localize` as a function: a log and a map in, the folder of the run out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.config import Settings, settings_table
from lhdmap.errors import InputError
from lhdmap.geometry import se3
from lhdmap.localization.changes import Change
from lhdmap.localization.episodes import episodes
from lhdmap.localization.rows import TRACKING, LocalizationRow, columns
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, Message
from lhdmap.outputs import free_folder
from lhdmap.pipeline.build import Progress, renamed
from lhdmap.pipeline.inputs import ROLES_READ
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.pipeline.localize import Localizer, LocalizerOptions
from lhdmap.pipeline.mounts import machine_of
from lhdmap.pipeline.stream import Stream
from lhdmap.provenance import source_entry
from lhdmap.report.live_recording import add_pose_now
from lhdmap.report.localization_data import LocalizationData
from lhdmap.report.localization_page import write_localization_report
from lhdmap.report.localization_recording import record_localization
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.recording_settings import Thinning
from lhdmap.runfolder import RunFolderWriter, RunInfo
from lhdmap.topology.model import TopologicalMap
from lhdmap.trajectory import Trajectory, write_tum

KIND = "localization"
_NOW_S = 0.2  # between the poses that those who follow a running machine are shown


@dataclass(frozen=True, slots=True)
class LocalizeRequest:
    """What is asked for: logs, map folder, the folder to make, settings, about where the drive starts (4,: x, y, yaw, z).

    `smoother`: rows are those of the fixed-lag smoother. `stream`: the log is still being written. `recorded_as`: names of logs
    in `run.json`, where they are moved later.
    """

    logs: Sequence[Path]
    map: Path
    target: Path
    settings: Settings = field(default_factory=Settings)
    topics: Mapping[str, str] = field(default_factory=dict)
    machine: Machine | None = None
    start: FloatArray | None = None
    progress: Progress | None = None
    force: bool = False
    smoother: bool = False
    stream: Stream | None = None
    recorded_as: Mapping[Path, Path] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class LocalizeResult:
    """What came of it: the folder, the figures of `localize --json`, a row for each front scan."""

    folder: Path
    summary: dict[str, Any]
    rows: list[LocalizationRow]


def localize(request: LocalizeRequest) -> LocalizeResult:
    """Localize a drive on a map and write the run's folder.

    Raises:
        UsageError: the folder is there already.
        InputError: map or log cannot be used, or the log holds no scan.
    """
    inputs = [request.map, *request.logs]
    free_folder(request.target, force=request.force, inputs=inputs)
    known = KnownMap.read(request.map)
    growing, port = (None, None) if request.stream is None else (request.stream.opened, request.stream.live_port)
    with (
        RunFolderWriter(KIND, request.target, force=request.force, inputs=inputs) as folder,
        LogSource(list(request.logs), request.topics, force=request.force, growing=growing) as source,
    ):
        machine = machine_of(source, request.machine)
        drawn = folder.path / "recording.rrd"
        with RecordingWriter(
            drawn, request.target.name, source.start_ns or 0, request.settings.recording, live_port=port
        ) as recording:
            localizer = _localized(request, known, source, machine, recording)
            told = renamed([*source.warnings, *source.damage, *localizer.pipeline.warnings], request.recorded_as)
            if not localizer.rows:
                raise InputError(f"{request.logs[0]}: no usable scan in it; lhdmap doctor tells what is wrong")
            summary = summary_of(localizer)
            changes = localizer.world.changes()
            table = changes_table(changes, known.topology, request)
            data = LocalizationData(
                request.target.name,
                known.topology,
                known.sheets,
                localizer.world.walls(),
                localizer.rows,
                localizer.searches,
                changes,
                episodes(localizer.rows, localizer.facts.reasons),
                summary,
                told,
                localizer.pipeline.records.articulation(),
                table["update"] or "",
            )
            record_localization(recording, data, machine or Machine())
        folder.finished(drawn)
        folder.write_table("localization.parquet", columns(localizer.rows))
        write_tum(folder.path / "localization.tum", trajectory_of(localizer.rows))
        folder.finished(folder.path / "localization.tum")
        folder.write_json("changes.json", table)
        write_localization_report(folder.path / "report.html", data)
        folder.finished(folder.path / "report.html")
        options = {
            **settings_table(request.settings),
            "request": {"map": str(request.map.resolve()), "smoother": request.smoother},
        }
        moved = request.recorded_as
        hashes = {log: source_entry(log) | {"path": str(moved[log])} for log in request.logs if log in moved}
        path = folder.complete(RunInfo(request.logs, options, summary, told), hashes)
    return LocalizeResult(path, summary | {"warnings": told}, localizer.rows)


def _localized(
    request: LocalizeRequest, known: KnownMap, source: LogSource, machine: Machine | None, recording: RecordingWriter
) -> Localizer:
    """Send the log through a localizer; scans that have a place are recorded."""
    options = LocalizerOptions(smoother=request.smoother)
    with Localizer(known, request.settings, machine, request.start, options) as localizer:
        messages: Iterable[tuple[str, Message]] = source.messages([role for role in ROLES_READ if role in source.roles])
        if request.progress is not None:
            messages = request.progress(messages, source.duration_s)
        if request.stream is not None:
            messages = request.stream.through(source, messages, localizer)
        now = Thinning(_NOW_S) if request.stream is not None and request.stream.live_port is not None else None
        for role, message in messages:
            localizer.update(role, message)
            if localizer.newest is not None:
                recording.add_scan(*localizer.newest)
                if now is not None and localizer.fix is not None and now.take(localizer.newest[0], "now"):
                    x, y, heading = localizer.fix.pose_map
                    add_pose_now(
                        recording, localizer.newest[0], np.array([x, y, localizer.fix.height_m, 0, 0, heading])
                    )
        localizer.finish()
    return localizer


def summary_of(localizer: Localizer) -> dict[str, Any]:
    """Return the figures of a run."""
    rows, first = localizer.rows, localizer.facts.first_fix
    latencies = np.array([row.latency_ms for row in rows])
    return {
        "scans": len(rows),
        "tracking_share": sum(row.status == TRACKING for row in rows) / len(rows),
        "first_fix_s": None if first is None else first[0],
        "first_fix_m": None if first is None else first[1],
        "lost_stretches": localizer.facts.lost_stretches,
        "false_fix_guard": localizer.facts.withheld,
        "changes": len(localizer.world.changes()),
        "latency_ms": {"median": float(np.median(latencies)), "p99": float(np.quantile(latencies, 0.99))},
    }


def trajectory_of(rows: Sequence[LocalizationRow]) -> Trajectory:
    """Return the poses of the rows that track."""
    kept = [row for row in rows if row.status == TRACKING and math.isfinite(row.x_m)]
    stamps = np.array([row.stamp_ns for row in kept], dtype=np.int64)
    positions = np.array([[row.x_m, row.y_m, row.z_m] for row in kept]).reshape(-1, 3)
    yaw = np.array([row.yaw_rad for row in kept])
    return Trajectory(stamps, positions, se3.quaternions_from_rpy(np.zeros(len(kept)), np.zeros(len(kept)), yaw))


def changes_table(changes: Sequence[Change], topology: TopologicalMap, request: LocalizeRequest) -> dict[str, Any]:
    """Return what is not as in the map as JSON values, and the command that takes it over."""
    names = {node.id: node.name for node in topology.nodes.values()}
    listed = [{"name": names.get(one.node, ""), **_rounded(one._asdict())} for one in changes]
    logs = [str(request.recorded_as.get(log, log)) for log in request.logs]
    command = " ".join(["lhdmap update-map", str(request.map), *logs]) if changes else None
    return {"changes": listed, "update": command}


def _rounded(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with millimetres, NaN as null."""

    def told(value: Any) -> Any:
        if isinstance(value, tuple):
            return [told(one) for one in value]
        if isinstance(value, float):
            return round(value, 3) if math.isfinite(value) else None
        return value

    return {key: told(value) for key, value in values.items()}

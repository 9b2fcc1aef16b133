"""The files of a map that several drives were joined to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lhdmap.config import settings_toml
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.cloud_io import write_cloud
from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.store import write_landmarks
from lhdmap.machine import Machine
from lhdmap.mapfolder import Diagnostics, MapFolder, MapFolderWriter
from lhdmap.movement.costs import connection_times
from lhdmap.names import name_of
from lhdmap.pile.result import PileReport
from lhdmap.pipeline.build import BuildRequest, BuildResult, frames_of, options_of
from lhdmap.pipeline.cost import CompileClock, Spent, cost, peak_memory_mib
from lhdmap.pipeline.topology import counts_of
from lhdmap.pipeline.update_files import joined, joined_diagnostics, later
from lhdmap.report.bounded import bounded
from lhdmap.report.data import ReportData, Summary
from lhdmap.report.page import write_report
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.run_recording import record_run
from lhdmap.runfolder import RunInfo
from lhdmap.topology.build import Topology
from lhdmap.topology.geojson import to_geojson
from lhdmap.topology.sheet import write_sheets
from lhdmap.topology.views import View
from lhdmap.topology.views_file import write_views
from lhdmap.trajectory import Trajectory

_SUMMED = ("scans", "scans_processed", "duration_s", "distance_m", "lost_stretches", "closures")


class Joined(NamedTuple):
    """A map of several drives: their own folders with what their times were moved by, logs and results, and all of them as one.

    `tied`: of each drive but the first, at how many places the others' walls hold it.
    """

    folders: Sequence[tuple[MapFolder, int]]
    logs: Sequence[Any]
    built: Sequence[BuildResult]
    trajectory: Trajectory
    views: Sequence[View]
    topology: Topology
    landmarks: Landmarks
    cloud: GridCloud
    pile: PileReport | None
    tied: Sequence[int]

    def odometry(self) -> Trajectory:
        """Return the ways by odometry alone, each in its own frame."""
        first, *others = (later(folder.odometry(), by_ns) for folder, by_ns in self.folders)
        for one in others:
            first = joined(first, one)
        return first

    def diagnostics(self) -> Diagnostics:
        """Return those of all drives, by time."""
        found = self.folders[0][0].diagnostics()
        for folder, by_ns in self.folders[1:]:
            found = joined_diagnostics(found, folder.diagnostics(), by_ns)
        return found


def write_joined(
    request: BuildRequest, made: Joined, warnings: list[str], started: float, compiling: CompileClock
) -> BuildResult:
    """Write the map folder; `started`: when the run began (monotonic, s)."""
    with MapFolderWriter(request.target, force=request.force, inputs=request.logs) as folder:
        _write_files(folder, request, made)
        duration_s = sum(one.summary["duration_s"] for one in made.built)
        spent = cost(started, duration_s, Spent(peak_memory_mib(), compiling.seconds), Spent())
        figures = _counts(made) | spent
        _write_shown(folder, request, made, figures, warnings)
        logs = list(dict.fromkeys(made.logs))
        path = folder.complete(RunInfo(logs, options_of(request), figures, warnings, frames_of(request)))
    said = [one for built in made.built for one in built.said]
    return BuildResult(path, figures | {"map": str(path)}, warnings, made.trajectory, said, made.pile)


def _write_files(folder: MapFolderWriter, request: BuildRequest, made: Joined) -> None:
    folder.write_trajectory(made.trajectory)
    folder.write_odometry(made.odometry())
    folder.write_diagnostics(made.diagnostics())
    write_cloud(folder.path / "cloud.ply", made.cloud)
    folder.finished(folder.path / "cloud.ply")
    if made.pile is not None:
        folder.write_json("pile.json", made.pile.to_json())
    topology = made.topology.map
    folder.write_json("topology.geojson", to_geojson(topology, connection_times(topology, request.settings.movement)))
    folder.finished(write_sheets(folder.path / "free_space.npz", made.topology.sheets))
    write_landmarks(folder.path / "landmarks.npz", made.landmarks)
    folder.finished(folder.path / "landmarks.npz")
    folder.finished(write_views(folder.path / "views.npz", made.views))


def _counts(made: Joined) -> dict[str, Any]:
    """Return the figures of all drives together; places where walls of one hold another count as closed loops."""
    parts = [one.summary for one in made.built]
    summed = {key: sum(one[key] for one in parts) for key in _SUMMED}
    share = sum(one["degenerate_share"] * one["scans_processed"] for one in parts) / max(summed["scans_processed"], 1)
    estimate = None if made.pile is None else made.pile.estimate
    return {
        **parts[0],
        **summed,
        "expected_error": None,
        "degenerate_share": share,
        "closures": summed["closures"] + sum(made.tied),
        "drives": len(parts),
        "tied": list(made.tied),
        "topology": counts_of(made.topology),
        "pile": None if estimate is None else estimate.status,
        "pile_reason": parts[0]["pile_reason"] if estimate is None else estimate.reason or None,
    }


def _write_shown(
    folder: MapFolderWriter, request: BuildRequest, made: Joined, figures: dict[str, Any], warnings: list[str]
) -> None:
    """Write page and recording."""
    data = ReportData(
        title=request.target.name,
        summary=Summary(**{key: value for key, value in figures.items() if key in Summary.__slots__}),
        topics=[],
        trajectory=made.trajectory,
        cloud=made.cloud,
        has_inclinometer=bool(np.ptp(made.trajectory.positions_m[:, 2]) > 0.0),
        pile=made.pile,
        pile_reason=figures["pile_reason"] or "",
        topology=made.topology.map,
        landmarks=made.landmarks,
        landmark_settings=request.settings.landmarks,
        sheets=made.topology.sheets,
        diagnostics=made.diagnostics(),
        drives=len(made.built),
        warnings=warnings,
        settings_text=settings_toml(request.settings),
        provenance={"log": ", ".join(name_of(path) for path in dict.fromkeys(made.logs))},
    )
    data = bounded(data)
    write_report(data, folder.path / "report.html")
    folder.finished(folder.path / "report.html")
    path, start_ns = folder.path / "recording.rrd", int(made.trajectory.stamps_ns[0])
    with RecordingWriter(path, data.title, start_ns, request.settings.recording) as recording:
        record_run(recording, data, request.machine or Machine())
    folder.finished(path)

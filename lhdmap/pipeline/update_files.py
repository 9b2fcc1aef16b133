"""The files of a map's new version: what both drives make of it, the difference, page and recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lhdmap.config import Settings, settings_toml
from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.cloud_io import write_cloud
from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.store import write_landmarks
from lhdmap.machine import Machine
from lhdmap.mapfolder import Diagnostics, MapFolder, MapFolderWriter
from lhdmap.movement.costs import connection_times
from lhdmap.names import name_of
from lhdmap.report import charts
from lhdmap.report.bounded import bounded
from lhdmap.report.data import Difference, Picture, ReportData, Summary
from lhdmap.report.difference_chart import difference_figures
from lhdmap.report.page import write_report
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.run_recording import record_run
from lhdmap.topology.geojson import to_geojson
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import Sheet, write_sheets
from lhdmap.topology.views import View
from lhdmap.topology.views_file import write_views
from lhdmap.trajectory import Trajectory
from lhdmap.update.difference import Walls


class Made(NamedTuple):
    """A new version: its name, what it came from (map, logs, settings, machine), and all that is to be written.

    `drives`: folders of the map before and of the drive's own map; `later_ns`: by how much the drive's times were moved.
    """

    title: str
    map: Path
    logs: Sequence[Path]
    settings: Settings
    machine: Machine
    drives: tuple[MapFolder, MapFolder]
    later_ns: int
    trajectory: Trajectory
    views: Sequence[View]
    topology: TopologicalMap
    sheets: Sequence[Sheet]
    landmarks: Landmarks
    cloud: GridCloud
    difference: dict[str, Any]
    walls: list[Walls]
    counts: dict[str, Any]
    warnings: list[str]


def write_version(folder: MapFolderWriter, made: Made) -> None:
    """Write all but `map.json`."""
    _write_files(folder, made)
    _write_shown(folder, made)


def _write_files(folder: MapFolderWriter, made: Made) -> None:
    known, drive = made.drives
    folder.write_trajectory(made.trajectory)
    folder.write_odometry(joined(known.odometry(), later(drive.odometry(), made.later_ns)))
    folder.write_diagnostics(joined_diagnostics(known.diagnostics(), drive.diagnostics(), made.later_ns))
    write_cloud(folder.path / "cloud.ply", made.cloud)
    folder.finished(folder.path / "cloud.ply")
    folder.write_json(
        "topology.geojson", to_geojson(made.topology, connection_times(made.topology, made.settings.movement))
    )
    folder.finished(write_sheets(folder.path / "free_space.npz", made.sheets))
    folder.finished(write_views(folder.path / "views.npz", made.views))
    write_landmarks(folder.path / "landmarks.npz", made.landmarks)
    folder.finished(folder.path / "landmarks.npz")
    folder.write_json("difference.json", made.difference)
    for one in (drive, known):  # the newer drive's pile, where it looked for one
        if (one.path / "pile.json").is_file():
            folder.write_json("pile.json", one.json("pile.json"))
            break


def _write_shown(folder: MapFolderWriter, made: Made) -> None:
    """Write pictures, page and recording."""
    names = ("scans", "scans_processed", "duration_s", "distance_m", "lost_stretches", "closures")
    data = ReportData(
        made.title,
        Summary(**{name: made.counts[name] for name in names}),
        [],
        made.trajectory,
        cloud=made.cloud,
        has_inclinometer=bool(np.ptp(made.trajectory.positions_m[:, 2]) > 0.0),
        topology=made.topology,
        sheets=made.sheets,
        difference=Difference(made.difference, _pictures(folder, made)),
        warnings=made.warnings,
        settings_text=settings_toml(made.settings),
        provenance={"map": name_of(made.map), "log": ", ".join(name_of(path) for path in made.logs)},
    )
    data = bounded(data)
    write_report(data, folder.path / "report.html")
    folder.finished(folder.path / "report.html")
    path, start_ns = folder.path / "recording.rrd", int(made.trajectory.stamps_ns[0])
    with RecordingWriter(path, data.title, start_ns, made.settings.recording) as recording:
        record_run(recording, data, made.machine)
    folder.finished(path)


def _pictures(folder: MapFolderWriter, made: Made) -> list[Picture]:
    """Write the picture of each level, and return them for the page."""
    found = []
    with charts.styled():
        for level, figure in enumerate(difference_figures(made.topology, made.sheets, made.walls)):
            name = "difference.svg" if level == 0 else f"difference_{level}.svg"
            charts.write_figure(figure, folder.path / name, "svg")
            folder.finished(folder.path / name)
            words = "walls that came and went, from above; grey is free space."
            caption = f"Level {level}: {words}" if len(made.sheets) > 1 else words.capitalize()
            found.append(Picture(charts.svg_uri(figure), caption))
    return found


def later(trajectory: Trajectory, by_ns: int) -> Trajectory:
    """Return a trajectory at later times."""
    return trajectory._replace(stamps_ns=trajectory.stamps_ns + by_ns)


def joined(first: Trajectory, second: Trajectory) -> Trajectory:
    """Return both trajectories in the order of time."""
    stamps = np.concatenate([first.stamps_ns, second.stamps_ns])
    order = np.argsort(stamps, kind="stable")
    positions = np.vstack([first.positions_m, second.positions_m])
    return Trajectory(
        stamps[order], positions[order], np.vstack([first.quaternions_xyzw, second.quaternions_xyzw])[order]
    )


def joined_diagnostics(first: Diagnostics, second: Diagnostics, later_ns: int) -> Diagnostics:
    """Return the diagnostics of two drives in the order of time, the second so much later."""
    columns: dict[str, Any] = {}
    second = second._replace(stamp_ns=np.asarray(second.stamp_ns) + later_ns)
    order = np.argsort(np.concatenate([np.asarray(first.stamp_ns), second.stamp_ns]), kind="stable")
    for name, a, b in zip(Diagnostics._fields, first, second, strict=True):
        columns[name] = None if a is None or b is None else np.concatenate([np.asarray(a), np.asarray(b)])[order]
    return Diagnostics(**columns)

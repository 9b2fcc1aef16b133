"""A finished run in a Rerun recording: the machine on its path, the map, curves and texts."""

from __future__ import annotations

import numpy as np

from lhdmap.machine import Machine
from lhdmap.report.data import ReportData
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.recording_settings import PathStyle
from lhdmap.report.topology_recording import add_topology
from lhdmap.trajectory import Trajectory

FINAL_PATH = PathStyle("final path", "blue", 0x2F86C9FF, 0.5)
GIVEN_PATH = FINAL_PATH._replace(label="path, as given")
ODOMETRY_PATH = PathStyle("odometry alone", "orange", 0xE69F00FF, 0.25)
_APART_M = 0.05  # paths that are nearer are one line on screen


def _apart(one: Trajectory, other: Trajectory) -> bool:
    """Return whether two paths can be told apart on screen."""
    if one.positions_m.shape != other.positions_m.shape:
        return True
    return bool(np.abs(one.positions_m - other.positions_m).max(initial=0.0) > _APART_M)


def record_run(writer: RecordingWriter, data: ReportData, machine: Machine) -> None:
    """Record all that a finished run knows; the scans and texts of the run itself are in `writer` already."""
    writer.add_motion(data.trajectory, machine)
    writer.add_path("final", data.trajectory, GIVEN_PATH if data.poses else FINAL_PATH)
    if data.odometry is not None and _apart(data.odometry, data.trajectory):
        writer.add_path("odometry", data.odometry, ODOMETRY_PATH)
    if data.articulation is not None and len(data.articulation.stamps_ns):
        writer.add_articulation(*data.articulation, machine)
    if data.cloud is not None:
        writer.add_cloud(data.cloud)
    if data.odometry_speed is not None:
        writer.add_curve("motion/speed/odometry", *data.odometry_speed, 0x2F86C9FF, "odometry, m/s")
    if data.tachometer_speed is not None:
        writer.add_curve("motion/speed/tachometer", *data.tachometer_speed, 0xD55E00FF, "tachometer, m/s")
    if data.diagnostics is not None and len(data.diagnostics.stamp_ns):
        writer.add_diagnostics(data.diagnostics)
    slip = data.slip()
    if slip is not None:
        writer.add_curve("motion/slip", slip.stamps_ns, 100.0 * slip.share, 0xD55E00FF, "slip, %")
    if data.topology is not None:
        add_topology(writer, data.topology, data.closures)
    for text in data.warnings:
        writer.add_text(text)

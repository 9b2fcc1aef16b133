"""A quick recording of a log as it is: scans in the frames of their sensors, speed and angles; no odometry, no map."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from lhdmap.errors import InputError
from lhdmap.integration.beams import scan_points
from lhdmap.kinematics import T_base_rear
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, Inclination, Joints, LaserScan, Message, Mount, PointCloud, Tachometer
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.recording_layout import LOG_CURVES
from lhdmap.report.recording_settings import RecordingSettings

SCAN_INTERVAL_S = 0.1
_BLUE, _ORANGE, _GREEN, _RED = 0x2F86C9FF, 0xE69F00FF, 0x009E73FF, 0xD55E00FF
_CURVES = {
    "motion/speed/tachometer": ("tachometer, m/s", _RED),
    "angles/roll": ("roll, deg", _BLUE),
    "angles/pitch": ("pitch, deg", _ORANGE),
    "angles/articulation": ("articulation, deg", _GREEN),
}


class LogRecorder:
    """Takes the messages of a log one by one; `scans` counts those that were recorded."""

    def __init__(self, path: Path, title: str) -> None:
        self.scans = 0
        self._path, self._title = path, title
        self._writer: RecordingWriter | None = None
        self._mounts: dict[str, Mount] = {}
        self._machine, self._articulation_rad = Machine(), 0.0
        self._curves: dict[str, list[tuple[int, float]]] = {}

    def update(self, role: str, message: Message) -> None:
        """Record a scan, ten a second, or keep what is drawn as a curve."""
        if isinstance(message, Mount):
            self._mounts[message.child_frame] = message
        elif isinstance(message, (LaserScan, PointCloud)):
            self._add_scan(role, message)
        else:
            if isinstance(message, Joints):
                self._articulation_rad = message.positions_rad.get("articulation", self._articulation_rad)
            for entity, value in _values(message):
                self._curves.setdefault(entity, []).append((message.stamp_ns, value))

    def finish(self, texts: Iterable[str] = ()) -> None:
        """Write the curves and the texts (what the reader noted) and close the file.

        Raises:
            InputError: there was no scan.
        """
        if self._writer is None:
            raise InputError(f"{self._title}: no scan in it, so there is nothing to show")
        for entity, rows in self._curves.items():
            stamps, values = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
            name, rgba = _CURVES[entity]
            self._writer.add_curve(entity, stamps, values, rgba, name)
        for text in texts:
            self._writer.add_text(text)
        self._writer.close()

    def _add_scan(self, role: str, message: LaserScan | PointCloud) -> None:
        if self._writer is None:
            settings = RecordingSettings(scan_interval_s=SCAN_INTERVAL_S)
            self._writer = RecordingWriter(self._path, self._title, message.stamp_ns, settings)
            self._writer.layout.curves = LOG_CURVES
        if self._writer.wants_scan(message.stamp_ns, role):
            T_base_sensor = self._pose(message.frame_id)
            points = _points(message) @ T_base_sensor[:3, :3].T + T_base_sensor[:3, 3]
            self._writer.add_scan(message.stamp_ns, points, role)
            self.scans += 1
            if len(points) and self.scans % 20 == 1:
                self._writer.widen(np.percentile(points, [10, 90], axis=0))

    def _pose(self, frame: str) -> FloatArray:
        """Return the pose of a frame in base_link, shape (4, 4): its mounts one after the other, the joint as it is."""
        T_base_frame = np.eye(4)
        for _ in range(len(self._mounts)):
            if frame not in self._mounts:
                break
            T_base_frame = self._mounts[frame].T_parent_child @ T_base_frame
            frame = self._mounts[frame].parent_frame
        return (
            T_base_rear(self._articulation_rad, self._machine) @ T_base_frame if frame == "rear_link" else T_base_frame
        )


def _points(message: LaserScan | PointCloud) -> FloatArray:
    """Return the points (N, 3) of a scan in its sensor's frame."""
    if isinstance(message, PointCloud):
        return message.points_m.astype(np.float64)
    points, _ = scan_points(message)
    return np.column_stack([points, np.zeros(len(points))]) if points.shape[1] == 2 else points


def _values(message: Message) -> list[tuple[str, float]]:
    """Return entity and value of what is drawn as a curve, angles in degrees."""
    if isinstance(message, Tachometer):
        return [("motion/speed/tachometer", message.speed_mps)]
    if isinstance(message, Inclination):
        degrees = np.degrees([message.roll_rad, message.pitch_rad])
        return [("angles/roll", float(degrees[0])), ("angles/pitch", float(degrees[1]))]
    if isinstance(message, Joints) and "articulation" in message.positions_rad:
        return [("angles/articulation", float(np.degrees(message.positions_rad["articulation"])))]
    return []

"""A replay in a Rerun recording, written while it goes on: machine, newest scan, curves, events as texts, states as steps.

Entities: `map/base_link/…` (the machine as it truly is), `map/scan/…`, `map/walls`, `map/path/…`, `motion/…`, `state/…`, `log`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.report.recording import PathStyle, RecordingWriter
from lhdmap.report.recording_layout import REPLAY_CURVES
from lhdmap.report.replay_data import COLUMNS, ReplayData
from lhdmap.trajectory import Trajectory

_BLUE, _ORANGE, _GREEN, _RED, _GREY = 0x2F86C9FF, 0xE69F00FF, 0x009E73FF, 0xD55E00FF, 0x8A949EFF
_COLOURS = (_BLUE, _ORANGE, _GREEN, _RED, 0xCC79A7FF, _GREY)
_TRUE = PathStyle("true path", "blue", _BLUE, 0.5)
_BELIEVED = PathStyle("path by perception", "orange", _ORANGE, 0.25)
_CURVES = (
    ("motion/speed/true", "speed_mps", 3.6, _BLUE, "true, km/h"),
    ("motion/speed/wanted", "wanted_mps", 3.6, _ORANGE, "commanded, km/h"),
    ("motion/articulation", "articulation_rad", 180.0 / np.pi, _GREEN, "articulation, deg"),
    ("motion/clearance", "clearance_m", 1.0, _RED, "clearance, m"),
)


class ReplayRecording:
    """Takes rows in batches, scans and texts as they come; `begin` comes first, `close` adds what is known at the end."""

    def __init__(self, path: Path, title: str, start_ns: int, machine: Machine, live_port: int | None = None) -> None:
        self._writer = RecordingWriter(path, title, start_ns, live_port=live_port)
        self._writer.curves = REPLAY_CURVES
        self._machine, self._start_ns, self._live = machine, start_ns, live_port is not None

    def begin(self, lines_m: Sequence[FloatArray], expected_s: float) -> None:
        """Record the machine's bodies and the walls as lines (N, 3); viewers that follow get their layout."""
        import rerun as rr

        self._writer.add_bodies(self._machine)
        if len(lines_m):
            lines = rr.LineStrips3D(list(lines_m), colors=_GREY, radii=rr.Radius.ui_points(1.0))
            self._writer.add_shape("map/walls", lines)
            self._writer.widen(np.concatenate(list(lines_m)))
            self._writer.explain("grey lines", "the mine's plan")
        if self._live:
            self._writer.lay_out(expected_s)

    def add_rows(self, rows: FloatArray, attitudes_rad: FloatArray) -> None:
        """Record rows (M, 9) of `replay_data.COLUMNS`, with roll and pitch (M, 2)."""
        stamps_ns = self._start_ns + np.round(1e9 * rows[:, 0]).astype(np.int64)
        quaternions = _quaternions(rows, attitudes_rad)
        self._writer.add_moving("map/base_link", stamps_ns, rows[:, 1:4], quaternions)
        self._writer.add_joint(stamps_ns, rows[:, COLUMNS.index("articulation_rad")], self._machine)
        for entity, column, scale, rgba, name in _CURVES:
            values = scale * rows[:, COLUMNS.index(column)]
            known = np.isfinite(values)
            if known.any():
                self._writer.add_curve(entity, stamps_ns[known], values[known], rgba, name)

    def wants_scan(self, stamp_ns: int) -> bool:
        """Return whether a scan of this stamp would be recorded."""
        return self._writer.wants_scan(stamp_ns)

    def add_scan(self, stamp_ns: int, points_map: FloatArray) -> None:
        """Record the points (N, 3) of a scan."""
        self._writer.add_scan(stamp_ns, points_map)

    def add_text(self, text: str, stamp_ns: int, *, grave: bool = False) -> None:
        """Record an event."""
        self._writer.add_text(text, stamp_ns, "WARN" if grave else "INFO")

    def close(self, data: ReplayData | None = None) -> None:
        """Add paths, walls and states, and close the file.

        Raises:
            InputError: it could not be written.
        """
        if data is not None:
            self._add_paths(data)
            self._add_states(data)
        self._writer.close()

    def _add_paths(self, data: ReplayData) -> None:
        import rerun as rr

        positions = data.rows[:, 1:4]
        self._writer.widen(positions)
        self._writer.add_path("true", _trajectory(positions), _TRUE)
        if len(data.believed_m):
            self._writer.add_path("believed", _trajectory(data.believed_m), _BELIEVED)
        spots = [contact["point_m"] for contact in data.verdict["contacts"]]
        if spots:
            points = rr.Points3D(spots, colors=_RED, radii=rr.Radius.ui_points(6.0))
            self._writer.add_shape("map/contacts", points)
            self._writer.explain("red points", "contacts")

    def _add_states(self, data: ReplayData) -> None:
        """Record the states of each process as steps; the legend says which step is which."""
        end_ns = self._start_ns + round(1e9 * data.verdict["duration_s"])
        for (process, changes), rgba in zip(data.changes.items(), _COLOURS * 10, strict=False):
            names = list(dict.fromkeys(change.state for change in changes))
            steps = [float(names.index(change.state)) for change in changes]
            stamps = np.array([*(change.t_ns for change in changes), max(end_ns, changes[-1].t_ns + 1)])
            self._writer.add_steps(f"state/{process}", stamps, np.array([*steps, steps[-1]]), rgba, process)
            self._writer.explain(f"state of {process}", ", ".join(f"{k} {name}" for k, name in enumerate(names)))


def _trajectory(positions_m: FloatArray) -> Trajectory:
    count = len(positions_m)
    return Trajectory(np.arange(count), positions_m, np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)))


def _quaternions(rows: FloatArray, attitudes_rad: FloatArray) -> FloatArray:
    """Return x y z w (M, 4) from roll, pitch (M, 2) and the rows' heading."""
    half = 0.5 * np.column_stack([attitudes_rad, rows[:, COLUMNS.index("yaw_rad")]])
    (sr, sp, sy), (cr, cp, cy) = np.sin(half).T, np.cos(half).T
    x, y = sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy
    z, w = cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy
    return np.column_stack([x, y, z, w])

"""A replay in a Rerun recording, written while it goes on: machine, newest scan, curves, events as texts, states as steps.

Entities: `map/base_link/…` (the machine as it truly is), `map/scan/…`, `map/walls`, `map/path/…`, `motion/…`, `state/…`, `log`; of
a machine that drives itself `map/topology/…`, `map/route/…` (its legs), `map/plan/horizon` (what guidance predicts), `place/…`; of
other machines of a crew `map/lhd2/base_link/…`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.report.loading_recording import add_load
from lhdmap.report.recording import RecordingWriter
from lhdmap.report.recording_end import rerun
from lhdmap.report.recording_layout import REPLAY_CURVES, REPLAY_GRAPH
from lhdmap.report.recording_settings import PathStyle
from lhdmap.report.replay_data import COLUMNS, DriveData, ReplayData
from lhdmap.report.topology_recording import add_topology, raised
from lhdmap.topology.model import TopologicalMap
from lhdmap.trajectory import Trajectory

_BLUE, _ORANGE, _GREEN, _RED, _GREY = 0x2F86C9FF, 0xE69F00FF, 0x009E73FF, 0xD55E00FF, 0x8A949EFF
_PINK, _DEG = 0xCC79A7FF, 180.0 / np.pi
BATCH_COLUMNS = (*COLUMNS, "planned_mps", "predicted_m")
_COLOURS = (_BLUE, _ORANGE, _GREEN, _RED, _PINK, _GREY)
_TRUE = PathStyle("true path", "blue", _BLUE, 0.5)
_BELIEVED = PathStyle("path by perception", "orange", _ORANGE, 0.25)
_CURVES = (
    ("motion/speed/true", "speed_mps", 3.6, _BLUE, "true, km/h"),
    ("motion/speed/wanted", "wanted_mps", 3.6, _ORANGE, "commanded, km/h"),
    ("motion/speed/planned", "planned_mps", 3.6, _GREEN, "planned, km/h"),
    ("motion/articulation", "articulation_rad", _DEG, _GREEN, "joint, deg"),
    ("motion/steering", "steering_rps", _DEG, _ORANGE, "steering command, deg/s"),
    ("motion/clearance/true", "clearance_m", 1.0, _RED, "true, m"),
    ("motion/clearance/predicted", "predicted_m", 1.0, _ORANGE, "predicted, m"),
)
_PLACE = (
    ("along", 100.0, _BLUE, "along, cm"),
    ("across", 100.0, _ORANGE, "across, cm"),
    ("heading", _DEG, _GREEN, "heading, deg"),
)
_GEARS = {"forward": (_GREEN, "green"), "reverse": (_ORANGE, "orange")}


class ReplayRecording:
    """Takes rows in batches, scans and texts as they come; `begin` comes first, `close` adds what is known at the end."""

    def __init__(self, path: Path, title: str, start_ns: int, machine: Machine, live_port: int | None = None) -> None:
        self._writer = RecordingWriter(path, title, start_ns, live_port=live_port)
        self._writer.layout.curves, self._writer.layout.beside_topology = REPLAY_CURVES, REPLAY_GRAPH
        self._machine, self._start_ns, self._live = machine, start_ns, live_port is not None
        self._planned = False

    def begin(self, lines_m: Sequence[FloatArray], expected_s: float) -> None:
        """Record the machine's bodies and the walls as lines (N, 3); viewers that follow get their layout."""
        rr = rerun()
        self._writer.add_bodies(self._machine)
        if len(lines_m):
            lines = rr.LineStrips3D(list(lines_m), colors=_GREY, radii=rr.Radius.ui_points(1.0))
            self._writer.add_shape("map/walls", lines)
            self._writer.widen(np.concatenate(list(lines_m)))
            self._writer.explain("grey lines", "the mine's plan")
        if self._live:
            self._writer.lay_out(expected_s)

    def add_rows(self, rows: FloatArray, attitudes_rad: FloatArray) -> None:
        """Record rows (M, 12) of `BATCH_COLUMNS`, with roll and pitch (M, 2)."""
        stamps_ns = self._start_ns + np.round(1e9 * rows[:, 0]).astype(np.int64)
        quaternions = _quaternions(rows, attitudes_rad)
        self._writer.add_moving("map/base_link", stamps_ns, rows[:, 1:4], quaternions)
        self._writer.add_joint(stamps_ns, rows[:, COLUMNS.index("articulation_rad")], self._machine)
        for entity, column, scale, rgba, name in _CURVES:
            values = scale * rows[:, BATCH_COLUMNS.index(column)]
            known = np.isfinite(values)
            if known.any():
                self._writer.add_curve(entity, stamps_ns[known], values[known], rgba, name)

    def wants_scan(self, stamp_ns: int) -> bool:
        """Return whether a scan of this stamp would be recorded."""
        return self._writer.wants_scan(stamp_ns)

    def add_scan(self, stamp_ns: int, points_map: FloatArray) -> None:
        """Record the points (N, 3) of a scan."""
        self._writer.add_scan(stamp_ns, points_map)

    def add_map(self, topology: TopologicalMap) -> None:
        """Record the topological map that is driven on."""
        add_topology(self._writer, topology)

    def add_horizon(self, stamp_ns: int, way_m: FloatArray) -> None:
        """Record the way (K, 3) that guidance predicts at a time; empty: none."""
        rr = rerun()
        if len(way_m) or self._planned:
            lines = [way_m] if len(way_m) else []
            strip = rr.LineStrips3D(lines, colors=_PINK, radii=rr.Radius.ui_points(3.0))
            self._writer.add_at(stamp_ns, "map/plan/horizon", strip)
            self._writer.explain("pink line", "way of the leading axle that guidance predicts")
        self._planned = bool(len(way_m))

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
            self._add_others(data)
            self._add_states(data)
        if data is not None and data.drive is not None:
            self._add_drive(data.drive)
        if data is not None and data.load is not None:
            add_load(self._writer, data.load, self._machine, self._start_ns)
        self._writer.close()

    def _add_paths(self, data: ReplayData) -> None:
        rr = rerun()
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

    def _add_others(self, data: ReplayData) -> None:
        """Record the bodies of the other machines of a crew as they moved, and their paths."""
        for (name, rows), rgba in zip(data.others.items(), (_PINK, _GREEN, _RED), strict=False):
            if not len(rows):
                continue
            entity = f"map/{name}/base_link"
            stamps = self._start_ns + np.round(1e9 * rows[:, 0]).astype(np.int64)
            self._writer.add_bodies(self._machine, entity)
            self._writer.add_moving(entity, stamps, rows[:, 1:4], _quaternions(rows, np.zeros((len(rows), 2))))
            self._writer.add_joint(stamps, rows[:, COLUMNS.index("articulation_rad")], self._machine, entity)
            self._writer.add_path(name, _trajectory(rows[:, 1:4]), PathStyle(f"path of {name}", "thin", rgba, 0.75))

    def _add_drive(self, drive: DriveData) -> None:
        """Record the map where it fits best, the legs that were asked for, and by how much the place on the map was off."""
        rr = rerun()
        if drive.topology is not None:
            self.add_map(drive.topology)
        for gear, (rgba, colour) in _GEARS.items():
            lines = [raised(leg.line_m) for leg in drive.legs if leg.gear == gear]
            if lines:
                self._writer.add_shape(
                    f"map/route/{gear}", rr.LineStrips3D(lines, colors=rgba, radii=rr.Radius.ui_points(2.5))
                )
                self._writer.explain(f"{colour} line", f"leg of the route, {gear}")
        if len(drive.places):
            stamps = self._start_ns + np.round(1e9 * drive.place("time_s")).astype(np.int64)
            for column, (name, scale, rgba, label) in enumerate(_PLACE, start=1):
                self._writer.add_curve(f"place/{name}", stamps, scale * drive.places[:, column], rgba, label)

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

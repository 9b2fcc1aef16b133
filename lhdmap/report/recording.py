"""The Rerun recording of a run: written to a file without a display, in bulk where it can be, so that it costs little.

Entities: `map/cloud/NNN` (parts of the cloud, each shown from the time it was first seen), `map/path/…` (static lines),
`map/topology/…` (tunnels, intersections, access points, waypoints, connections, closures; static), `map/route/…` (static),
`map/base_link` (the machine, moved over time), `map/scan/…`, `motion/…` and `scan_match/…` (curves), `log` (texts).
The timeline `time` is the duration since the first scan.
"""

from __future__ import annotations

from collections import deque
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.integration.cloud import GridCloud
from lhdmap.machine import Machine
from lhdmap.mapfolder import Diagnostics
from lhdmap.messages import FloatArray
from lhdmap.names import shown
from lhdmap.report.height_colours import height_colours
from lhdmap.report.recording_end import warn_if_left_out, write_out
from lhdmap.report.recording_layout import ViewerLayout, whole_of
from lhdmap.report.recording_settings import PathStyle, RecordingSettings, Thinning
from lhdmap.report.recording_start import open_recording
from lhdmap.trajectory import Trajectory

TIMELINE = "time"
SCAN = 0xF2F2F2FF
Stamps = npt.NDArray[np.int64]

_LEAP_M = 5.0  # from scan to scan: the end of one drive and the start of the next


class RecordingWriter:
    """Writes one `.rrd` file. Scans and texts may come while the run goes on, the rest comes when it is known."""

    def __init__(
        self,
        path: Path,
        title: str,
        start_ns: int,
        settings: RecordingSettings | None = None,
        *,
        live_port: int | None = None,
        warns: bool = True,
    ) -> None:
        """Open the file in the background; `start_ns` is the stamp that counts as time zero.

        `live_port`: viewers on this machine may follow there while it is written. `warns`: says where Rerun is not
        installed, and nothing will be written.
        """
        if warns:
            warn_if_left_out(path)
        self._settings = settings or RecordingSettings()
        self._path, self._failed = path, False
        self._start_ns = self._end_ns = start_ns
        self._thinning = Thinning(self._settings.scan_interval_s)
        self._floor: tuple[Stamps, FloatArray] | None = None
        self.layout = ViewerLayout()
        self._scans: deque[tuple[int, FloatArray, str]] = deque()
        loader = ThreadPoolExecutor(max_workers=1, thread_name_prefix="recording")
        self._opened = loader.submit(
            open_recording, path, title, start_ns, live_port
        )  # loading Rerun takes most of a second
        loader.shutdown(wait=False)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file; what was recorded before an interruption is kept."""
        self.close()

    @property
    def _rr(self) -> Any:
        return self._opened.result()[0]

    @property
    def _stream(self) -> Any:
        return self._opened.result()[1]

    def wants_scan(self, stamp_ns: int, name: str = "front") -> bool:
        """Return whether a scan of this stamp would be recorded, so that its points need not be made in vain."""
        return self._thinning.wants(stamp_ns, name)

    def add_scan(self, stamp_ns: int, points_map: FloatArray, name: str = "front") -> None:
        """Record the points (N, 3) of one scan in map, unless the last one was recorded just before; they are kept."""
        if not self._thinning.take(stamp_ns, name):
            return
        self._scans.append((stamp_ns, points_map, name))
        if self._opened.done():
            self._log_scans()

    def _log_scans(self) -> None:
        """Record the scans that have waited for the file to be open."""
        while self._scans:
            stamp_ns, points_map, name = self._scans.popleft()
            self._at(stamp_ns)
            points = self._rr.Points3D(points_map, colors=SCAN, radii=self._points_px(2.0))
            self._stream.log(f"map/scan/{name}", points)
            self.explain("white points", "the newest scan")

    def add_text(self, text: str, stamp_ns: int | None = None, level: str = "WARN") -> None:
        """Record a line of the text log; one without a stamp stands at the start."""
        self._at(self._start_ns if stamp_ns is None else stamp_ns)
        self._stream.log("log", self._rr.TextLog(shown(text), level=level))

    def add_shape(self, entity: str, shape: Any) -> None:
        """Record something that is there all the time."""
        self._stream.log(entity, shape, static=True)

    def add_at(self, stamp_ns: int, entity: str, shape: Any) -> None:
        """Record something that is there from a time on, until the next one."""
        self._at(stamp_ns)
        self._stream.log(entity, shape)

    def add_path(self, name: str, trajectory: Trajectory, drawn: PathStyle) -> None:
        """Record a whole trajectory as a line that carries its name."""
        positions = trajectory.positions_m
        step = max(1, len(positions) // 5000)
        drawn_m = positions[::step]
        leaps = np.flatnonzero(np.linalg.norm(np.diff(drawn_m, axis=0), axis=1) > max(_LEAP_M, 0.5 * step)) + 1
        line = self._rr.LineStrips3D(np.split(drawn_m, leaps), colors=drawn.rgba, radii=self._points_px(1.4))
        self._stream.log(f"map/path/{name}", line, static=True)
        at = positions[int(drawn.label_at * (len(positions) - 1))]
        label = self._rr.Points3D([at], colors=drawn.rgba, radii=self._points_px(3.0), labels=[drawn.label])
        self._stream.log(f"map/path/{name}/name", label, static=True)
        self.explain(f"{drawn.colour} line", drawn.label)

    def explain(self, drawn: str, meaning: str) -> None:
        """Add a line to the legend, once: what it looks like and what it is."""
        self.layout.explain(drawn, meaning)

    def add_motion(self, trajectory: Trajectory, machine: Machine) -> None:
        """Record the final trajectory: the machine moves along it, and the cloud is coloured by height over it."""
        order = np.argsort(trajectory.stamps_ns, kind="stable")
        step = max(1, len(order) // 10_000)
        rows = order[::step]
        stamps_ns, quaternions = trajectory.stamps_ns[rows], trajectory.quaternions_xyzw[rows]
        self.add_moving("map/base_link", stamps_ns, trajectory.positions_m[rows], quaternions)
        self._boxes("map/base_link/front_body", machine.boxes("base_link"))
        self._floor = trajectory.stamps_ns[order], trajectory.positions_m[order, 2]
        self.widen(trajectory.positions_m)

    def add_moving(self, entity: str, stamps_ns: Stamps, positions_m: FloatArray, quaternions_xyzw: FloatArray) -> None:
        """Record the poses (M, 3) and (M, 4) of a frame in that of its parent entity over time."""
        poses = self._rr.Transform3D.columns(translation=positions_m, quaternion=quaternions_xyzw)
        self._stream.send_columns(entity, [self._times(stamps_ns)], poses)

    def add_articulation(self, stamps_ns: Stamps, angles_rad: FloatArray, machine: Machine) -> None:
        """Record the rear body, which follows the joint angles (M,), positive when the machine bends to the left."""
        self.add_joint(stamps_ns, angles_rad, machine)
        self._boxes("map/base_link/rear_link/rear_body", machine.boxes("rear_link"))

    def add_bodies(self, machine: Machine, entity: str = "map/base_link") -> None:
        """Record the boxes of both bodies; their poses come with `add_moving` and `add_joint`."""
        self._boxes(f"{entity}/front_body", machine.boxes("base_link"))
        self._boxes(f"{entity}/rear_link/rear_body", machine.boxes("rear_link"))

    def add_joint(
        self, stamps_ns: Stamps, angles_rad: FloatArray, machine: Machine, entity: str = "map/base_link"
    ) -> None:
        """Record how the rear body stands to the front one, by joint angles (M,)."""
        front_m, rear_m = machine.dimensions.joint_to_front_axle_m, machine.dimensions.joint_to_rear_axle_m
        x, y = -front_m - rear_m * np.cos(angles_rad), rear_m * np.sin(angles_rad)
        zero = np.zeros(len(x))
        quaternions = np.column_stack([zero, zero, np.sin(-angles_rad / 2), np.cos(-angles_rad / 2)])
        self.add_moving(f"{entity}/rear_link", stamps_ns, np.column_stack([x, y, zero]), quaternions)

    def add_cloud(self, cloud: GridCloud) -> None:
        """Record the cloud in parts, each from the time on at which its points were first measured."""
        if not len(cloud):
            return
        stamps = cloud.stamps_ns if cloud.stamps_ns is not None else np.full(len(cloud), self._start_ns)
        order = np.argsort(stamps, kind="stable")
        colours = height_colours(cloud.points_m[:, 2], stamps, self._floor, self._settings.height_window_m)
        for number, rows in enumerate(np.array_split(order, min(self._settings.cloud_parts, len(order)))):
            self._at(int(stamps[rows[0]]))
            size = self._points_px(self._settings.point_size_px)
            part = self._rr.Points3D(cloud.points_m[rows], colors=colours[rows], radii=size)
            self._stream.log(f"map/cloud/{number:03d}", part)
        self.explain("points, blue to yellow", "the map, by height over the floor")
        self.widen(whole_of(cloud.points_m))

    def add_curve(self, entity: str, stamps_ns: Stamps, values: FloatArray, rgba: int, name: str) -> None:
        """Record a curve over time: stamps (M,), values (M,)."""
        self.layout.draws(entity)
        self._stream.log(entity, self._rr.SeriesLines(colors=rgba, names=name, widths=1.5), static=True)
        self._stream.send_columns(entity, [self._times(stamps_ns)], self._rr.Scalars.columns(scalars=values))

    def add_steps(self, entity: str, stamps_ns: Stamps, values: FloatArray, rgba: int, name: str) -> None:
        """Record values that each hold until the next one: stamps (M,), values (M,)."""
        self.add_curve(entity, stamps_ns, values, rgba, name)
        steps = self._rr.SeriesLines.from_fields(interpolation_mode="StepAfter", aggregation_policy="Off")
        self._stream.log(entity, steps, static=True)

    def add_diagnostics(self, found: Diagnostics) -> None:
        """Record the standard deviations that the information stands for, residual and flags."""
        stamps = found.stamp_ns
        along, across, heading = (
            1.0 / np.sqrt(np.maximum(values, 1e-12))
            for values in (found.information_along, found.information_across, found.information_heading)
        )
        self.add_curve("scan_match/deviation/along", stamps, 1e3 * along, 0x2F86C9FF, "along, mm")
        self.add_curve("scan_match/deviation/across", stamps, 1e3 * across, 0xE69F00FF, "across, mm")
        self.add_curve("scan_match/deviation/heading", stamps, 1e3 * heading, 0x009E73FF, "heading, mrad")
        self.add_curve("scan_match/weak", stamps, found.degenerate.astype(float), 0xCC79A7FF, "direction not observed")
        self.add_curve("scan_match/residual", stamps, 1e3 * found.residual, 0x999999FF, "residual, mm")

    def close(self) -> None:
        """Add the legend and the layout of the viewer and close the file.

        Raises:
            InputError: it could not be written.
        """
        if self._failed:
            return
        self._log_scans()
        if self.layout.legend:
            self.add_shape("legend", self._rr.TextDocument(self.layout.legend, media_type="text/markdown"))
        self._stream.send_blueprint(self.layout.blueprint(self.layout.used, self._end_ns - self._start_ns))
        try:
            write_out(self._stream, self._path)
        except InputError:
            self._failed = True
            raise

    def lay_out(self, duration_s: float) -> None:
        """Lay the viewer out for what is to come, for those who follow while it is written."""
        self._stream.send_blueprint(self.layout.blueprint(self.layout.curves, round(1e9 * duration_s)))

    def _at(self, stamp_ns: int) -> None:
        self._end_ns = max(self._end_ns, stamp_ns)
        self._stream.set_time(TIMELINE, duration=np.timedelta64(stamp_ns - self._start_ns, "ns"))

    def _times(self, stamps_ns: Stamps) -> Any:
        self._end_ns = max(self._end_ns, int(stamps_ns.max(initial=self._end_ns)))
        return self._rr.TimeColumn(TIMELINE, duration=(stamps_ns - self._start_ns).astype("timedelta64[ns]"))

    def _points_px(self, size: float) -> Any:
        return self._rr.Radius.ui_points(size)

    def _boxes(self, entity: str, corners_m: FloatArray) -> None:
        """Record boxes (K, 2, 3) of lower and upper corners, fixed to their parent entity."""
        if len(corners_m):
            sizes, centres = corners_m[:, 1] - corners_m[:, 0], corners_m.mean(axis=1)
            self.explain("yellow boxes", "the machine")
            boxes = self._rr.Boxes3D(centers=centres, sizes=sizes, colors=0xF0C419FF, fill_mode="solid")
            self._stream.log(entity, boxes, static=True)

    def widen(self, points_m: npt.NDArray[np.floating[Any]]) -> None:
        """Widen the bounds that the views are laid out for, so that they hold the points (N, 3) in map."""
        self.layout.widen(points_m)

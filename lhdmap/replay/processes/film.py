"""Who watches for the page and the recording: thinned rows of the truth, the newest scan, what perception believed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from lhdmap.geometry import se3
from lhdmap.integration.beams import scan_points
from lhdmap.kinematics import T_base_rear
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, LaserScan
from lhdmap.replay.journal import Event
from lhdmap.replay.parts import State
from lhdmap.replay.process import (
    CONTACT,
    EVERYWHERE,
    MILLISECOND_NS,
    POSE,
    STATE,
    Outgoing,
    Process,
    Received,
)
from lhdmap.replay.processes.film_drive import TOPICS, DriveFilm
from lhdmap.replay.processes.film_load import LOAD_TOPICS, LoadFilm
from lhdmap.replay.series import Series
from lhdmap.report.replay_data import COLUMNS
from lhdmap.report.replay_recording import ReplayRecording
from lhdmap.roles import ROLES
from lhdmap.simulation.history import SECOND_NS, START_NS

FILM = "film"
_SCAN, _COMMAND = ROLES["front"].topic, ROLES["command"].topic
_BATCH, _LIVE_BATCH = 100, 5  # rows of a tenth of a second
_GRAVE = ("contact", "overrun", "inbox full", "begins")


class _Batch:
    """Rows and attitudes that go into the recording so many at a time."""

    def __init__(self, recording: ReplayRecording, most: int) -> None:
        self._recording, self._most = recording, most
        self._rows: list[tuple[float, ...]] = []
        self._attitudes: list[tuple[float, float]] = []

    def add(self, row: tuple[float, ...], attitude: tuple[float, float]) -> None:
        """Take a row with roll and pitch."""
        self._rows.append(row)
        self._attitudes.append(attitude)
        if len(self._rows) >= self._most:
            self.flush()

    def flush(self) -> None:
        """Record what there is."""
        if self._rows:
            self._recording.add_rows(np.array(self._rows), np.array(self._attitudes))
            self._rows, self._attitudes = [], []


class Film(Process):
    """A row each 0.1 s; `recording` is None where none is wanted."""

    name, period_ns, priority, site = FILM, 100 * MILLISECOND_NS, 80, EVERYWHERE
    reads = tuple(dict.fromkeys((STATE, CONTACT, _COMMAND, _SCAN, *TOPICS, *LOAD_TOPICS)))
    inbox_size = 4000

    def __init__(
        self,
        machine: Machine,
        recording: ReplayRecording | None = None,
        *,
        live: bool = False,
        drive: DriveFilm | None = None,
        load: LoadFilm | None = None,
    ) -> None:
        """`drive`, `load`: what is watched of a machine that drives itself, and of one that loads; None: it does not."""
        self.series, self._believed = Series(len(COLUMNS)), Series(4)
        self._machine, self._recording = machine, recording
        self._batch = None if recording is None else _Batch(recording, _LIVE_BATCH if live else _BATCH)
        self.drive, self.load = drive, load
        self._wanted_mps = self._steering_rps = self._clearance_m = math.nan
        self._start: State | None = None
        self._mapped = False

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterable[Outgoing]:
        """Take what has come."""
        state: State | None = None
        for received in inbox:
            topic, _, message = received
            if self.load is not None:
                self.load.take(received)
            if self.drive is not None:
                self._watch(topic, message)
            if topic == STATE:
                state = message
            elif topic == POSE:
                x, y, z = message.T_odom_base[:3, 3].tolist()
                self._believed.add((message.stamp_ns * 1e-9, x, y, z))
            elif topic == _COMMAND:
                self._wanted_mps = message.propel * self._machine.dimensions.max_speed_kmh / 3.6
                self._steering_rps = message.steering_rate_rps
            elif topic == CONTACT:
                nearest_m = 0.0 if message.touches else message.clearance_m
                self._clearance_m = self._clearance_m if nearest_m is None else nearest_m
        if state is not None:
            self._row(state)
            self._scan(state, inbox)
            self._look(state)
        return ()

    def finish(self, now_ns: int, inbox: Sequence[Received]) -> None:
        """Take what is left."""
        self.step(now_ns, inbox)
        if self._batch is not None:
            self._batch.flush()

    def take(self, event: Event) -> None:
        """Take a line of the journal as a text of the recording."""
        if self._recording is None:
            return
        way = f": {event.before or '–'} → {event.after}" if event.after else f": {event.event}"
        cause = f" ({event.cause})" if event.cause else ""
        self._recording.add_text(f"{event.process}{way}{cause}", event.t_ns, grave=event.event in _GRAVE)

    def believed_m(self) -> FloatArray:
        """Return the path by perception (M, 3) in map: it begins where the machine truly stood."""
        points = self._believed.rows()[:, 1:]
        if self._start is None or not len(points):
            return np.empty((0, 3))
        T_map_odom = se3.from_rpy(0.0, 0.0, self._start.yaw_rad, _place(self._start))
        placed: FloatArray = points @ T_map_odom[:3, :3].T + T_map_odom[:3, 3]
        return placed

    def _row(self, state: State) -> None:
        self._start = self._start or state
        time_s = (state.time_ns - START_NS) / SECOND_NS
        own = (state.yaw_rad, state.articulation_rad, state.speed_mps)
        row = (time_s, *_place(state), *own, self._wanted_mps, self._clearance_m, self._steering_rps)
        self.series.add(row)
        if self._batch is not None:
            plans = None if self.drive is None else self.drive.plans
            planned = (math.nan,) * 2 if plans is None else (plans.planned_mps, plans.predicted_m)
            self._batch.add((*row, *planned), (state.roll_rad, state.pitch_rad))

    def _watch(self, topic: str, message: Any) -> None:
        """Let what is watched of a drive see it, the true states first."""
        assert self.drive is not None  # noqa: S101  # asked for by the caller
        if topic == STATE:
            self.drive.truth.add(message)
        elif topic in TOPICS:
            self.drive.take(topic, message)

    def _look(self, state: State) -> None:
        """Record what is planned now; the map, once it is aligned."""
        if self.drive is None:
            return
        way = self.drive.look(state.time_ns, state.pitch_rad)
        if self._recording is None or way is None:
            return
        self._recording.add_horizon(state.time_ns, way)
        if self.drive.map is not None and not self._mapped:
            self._mapped = True
            self._recording.add_map(self.drive.map)

    def _scan(self, state: State, inbox: Sequence[Received]) -> None:
        """Record the newest scan where the machine is now: it is a picture, not a measurement."""
        if self._recording is None:
            return
        scan = next((one.message for one in reversed(inbox) if one.topic == _SCAN), None)
        if isinstance(scan, LaserScan) and self._recording.wants_scan(scan.stamp_ns):
            points, _ = scan_points(scan)
            flat = np.column_stack([points, np.zeros(len(points))]) if points.shape[1] == 2 else points
            T = self._T_map_sensor(state, scan.frame_id)
            self._recording.add_scan(scan.stamp_ns, flat @ T[:3, :3].T + T[:3, 3])

    def _T_map_sensor(self, state: State, frame: str) -> FloatArray:  # noqa: N802  # frames in the name
        T = se3.from_rpy(state.roll_rad, state.pitch_rad, state.yaw_rad, _place(state))
        mount = self._machine.mounts.get(frame)
        if mount is None:
            return T
        if mount.parent == "rear_link":
            T = T @ T_base_rear(state.articulation_rad, self._machine)
        moved: FloatArray = T @ mount.T_parent_sensor
        return moved


def _place(state: State) -> tuple[float, float, float]:
    return state.x_m, state.y_m, state.z_m

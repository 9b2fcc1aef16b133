"""What is watched of a machine that loads: pedals, angles, pressures, speeds, skid, and what truly is in the bucket."""

from __future__ import annotations

import math
from typing import Any

from lhdmap.geometry import se3
from lhdmap.loading.skid import SkidFactor
from lhdmap.messages import Command, FloatArray
from lhdmap.pile.result import Snapshot
from lhdmap.replay.load_tally import embedded_m
from lhdmap.replay.process import LOADING, PILE, STATE, Received
from lhdmap.replay.processes.load_feed import SIGNAL_TOPICS, SignalFeed
from lhdmap.replay.series import Series
from lhdmap.report.loading_data import COLUMNS, LoadData
from lhdmap.roles import ROLES
from lhdmap.simulation.history import SECOND_NS, START_NS

COMMAND = ROLES["command"].topic
LOAD_TOPICS = (*SIGNAL_TOPICS, LOADING, PILE, COMMAND)
_EVERY_NS = 50_000_000
_FACE, _MOST_PILES = 400, 200
_WINDOW_S, _FLOOR_MPS = 1.0, 0.2


class LoadFilm:
    """Takes what goes over the bus, in order; a row each 50 ms. `full_kg` is a full bucket."""

    def __init__(self, full_kg: float) -> None:
        self._full_kg = full_kg
        self.series = Series(len(COLUMNS))
        self._feed, self._skid = SignalFeed(), SkidFactor(_WINDOW_S, _FLOOR_MPS)
        self._command: Command | None = None
        self._fill = math.nan
        self._truth = (math.nan, math.nan)
        self._last_ns = 0
        self._start: Any = None
        self._piles: list[tuple[int, FloatArray]] = []

    def take(self, received: Received) -> None:
        """Take a message."""
        topic, sent_ns, message = received
        if topic in SIGNAL_TOPICS:
            self._feed.take(received)
        elif topic == COMMAND:
            self._command = message
        elif topic == LOADING:
            self._fill = message.fill
        elif topic == PILE:
            self._see(message)
        elif topic == STATE:
            self._start = message if self._start is None else self._start
            self._truth = message.load_kg / self._full_kg, embedded_m(message)
        if sent_ns - self._last_ns >= _EVERY_NS:
            self._last_ns = sent_ns
            self._row(sent_ns)

    def data(self) -> LoadData:
        """Return what was seen."""
        return LoadData(self.series.rows(), self._piles)

    def _see(self, snapshot: Snapshot) -> None:
        """Keep an estimate's face, placed as the odometry began where the machine truly stood."""
        face = snapshot.estimate.face_m
        if self._start is None or not len(face):
            return
        start = self._start
        T_map_odom = se3.from_rpy(0.0, 0.0, start.yaw_rad, (start.x_m, start.y_m, start.z_m))
        kept = face[:: max(len(face) // _FACE, 1)]
        self._piles.append((snapshot.stamp_ns, kept @ T_map_odom[:3, :3].T + T_map_odom[:3, 3]))
        del self._piles[:-_MOST_PILES]

    def _row(self, now_ns: int) -> None:
        signals, command = self._feed.signals(), self._command
        if signals is None:
            return
        skid = self._skid.update(signals)
        given: tuple[Any, ...] = (0.0, 0.0, 0.0) if command is None else (command.propel, command.tilt, command.lift)
        angles = signals.bucket_rad, signals.boom_rad
        bars = signals.transmission_bar, signals.lift_bar, signals.tilt_bar
        self.series.add(
            ((now_ns - START_NS) / SECOND_NS, *given, *angles, *bars, signals.tacho_mps, signals.scan_mps, skid, self._fill,
             *self._truth)
        )  # fmt: skip

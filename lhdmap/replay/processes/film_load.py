"""What is watched of a machine that loads: pedals, angles, pressures, speeds, skid, and what truly is in the bucket."""

from __future__ import annotations

import math
from typing import Any

from lhdmap.loading.skid import SkidFactor
from lhdmap.messages import Command
from lhdmap.replay.load_tally import embedded_m
from lhdmap.replay.process import LOADING, STATE, Received
from lhdmap.replay.processes.load_feed import SIGNAL_TOPICS, SignalFeed
from lhdmap.replay.series import Series
from lhdmap.report.loading_data import COLUMNS, LoadData
from lhdmap.roles import ROLES
from lhdmap.simulation.history import SECOND_NS, START_NS

COMMAND = ROLES["command"].topic
LOAD_TOPICS = (*SIGNAL_TOPICS, LOADING, COMMAND)
_EVERY_NS = 50_000_000
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

    def take(self, received: Received) -> None:
        """Take a message."""
        topic, sent_ns, message = received
        if topic in SIGNAL_TOPICS:
            self._feed.take(received)
        elif topic == COMMAND:
            self._command = message
        elif topic == LOADING:
            self._fill = message.fill
        elif topic == STATE:
            self._truth = message.load_kg / self._full_kg, embedded_m(message)
        if sent_ns - self._last_ns >= _EVERY_NS:
            self._last_ns = sent_ns
            self._row(sent_ns)

    def data(self) -> LoadData:
        """Return what was seen."""
        return LoadData(self.series.rows())

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

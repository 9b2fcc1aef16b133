"""Machines on a level, or anywhere else: histories of a motion that is known in closed form, and worlds that are walls."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from lhdmap.messages import Float32Array, FloatArray, Record
from lhdmap.roles import ROLES
from lhdmap.simulation.history import START_NS, Column, History
from lhdmap.simulation.raycast import Surface
from lhdmap.simulation.sensing.sensor import Sensor, read_all
from lhdmap.simulation.surroundings import SurroundingsView


class Room:
    """A world that is `range_m` away whatever the ray; it counts how often it is looked at."""

    origin_m = np.zeros(3)

    def __init__(self, range_m: float = 5.0) -> None:
        self._range_m, self.casts = range_m, 0

    def dust(self, position_m: FloatArray) -> float:  # it is nowhere
        """Return the share of beams that dust returns at a place: it hangs nowhere, clouds come with time."""
        return 0.0

    def near(self, position_m: FloatArray) -> Surface:
        return self  # type: ignore[return-value]  # all that scanners ask of a surface

    def cast(self, rays: Float32Array) -> Float32Array:
        self.casts += 1
        return np.full(len(rays), self._range_m, dtype=np.float32)


def history(seconds: float, rate_hz: float = 100.0, **columns: Callable[[FloatArray], FloatArray]) -> History:
    """Return a history whose columns (by their names) are functions of time in s; the others are zero."""
    time_s = np.arange(round(seconds * rate_hz) + 1) / rate_hz
    rows = np.zeros((len(time_s), len(Column)))
    for name, function in columns.items():
        rows[:, Column[name]] = function(time_s)
    return History(rate_hz, rows)


def readings(sensors: Sensor | Sequence[Sensor], past: History, world: SurroundingsView | None = None) -> list[Record]:
    """Return all that sensors say of a history."""
    listed = [sensors] if not isinstance(sensors, Sequence) else list(sensors)
    return list(read_all(listed, past, world or Room()))


def times_s(records: list[Record]) -> FloatArray:
    """Return the stamps of records, s after the start."""
    return np.array([record.message.stamp_ns - START_NS for record in records]) * 1e-9


def of_role(records: list[Record], role: str) -> list[Record]:
    """Return the records of a role."""
    return [record for record in records if record.topic == ROLES[role].topic]

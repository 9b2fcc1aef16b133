"""What a log says of a loading: commands, boom and bucket, pressures, speed, mode, on one grid of time."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.evaluation.navigation.signals import MODES
from lhdmap.messages import Command, FloatArray, Joints, Message, Pressure, Tachometer, Text

STEP_S = 0.05
ROLES = ("command", "joints", "transmission_pressure", "lift_pressure", "tachometer", "mode")
_HELD_S = 0.5
_BAR_PA = 1e5
_NAMES = (
    "propel",
    "tilt",
    "lift",
    "full_rpm",
    "brake",
    "boom_rad",
    "bucket_rad",
    "transmission_bar",
    "lift_bar",
    "speed_mps",
)


class LoadingSignals(NamedTuple):
    """Values on a grid of `STEP_S`, shapes (N,); NaN where the log has none for more than 0.5 s. `start_ns`: of the grid."""

    start_ns: int
    propel: FloatArray
    tilt: FloatArray
    lift: FloatArray
    full_rpm: FloatArray
    brake: FloatArray
    boom_rad: FloatArray
    bucket_rad: FloatArray
    transmission_bar: FloatArray
    lift_bar: FloatArray
    speed_mps: FloatArray
    mode: npt.NDArray[np.object_]

    @property
    def time_s(self) -> FloatArray:
        """Times of the grid after its start."""
        return STEP_S * np.arange(len(self.propel), dtype=float)

    def any_of(self, name: str) -> bool:
        """Return whether the log has values of a name."""
        return bool(np.isfinite(getattr(self, name)).any())


class LoadingCollector:
    """Takes the messages of a log, each with its role; `signals` puts them on the grid."""

    def __init__(self) -> None:
        self._samples: dict[str, list[tuple[int, float]]] = {name: [] for name in _NAMES}
        self._modes: list[tuple[int, str]] = []

    def update(self, role: str, message: Message) -> None:
        """Take one message; those of other kinds than needed are passed over."""
        match message:
            case Command():
                for name in ("propel", "tilt", "lift", "full_rpm", "brake"):
                    self._add(name, message.stamp_ns, float(getattr(message, name)))
            case Joints():
                for name, joint in (("boom_rad", "boom_lift"), ("bucket_rad", "bucket_tilt")):
                    self._add(name, message.stamp_ns, message.positions_rad.get(joint, math.nan))
            case Pressure():
                if role in ("transmission_pressure", "lift_pressure"):
                    name = "transmission_bar" if role == "transmission_pressure" else "lift_bar"
                    self._add(name, message.stamp_ns, message.pressure_pa / _BAR_PA)
            case Tachometer():
                self._add("speed_mps", message.stamp_ns, message.speed_mps)
            case Text():
                word = message.text.strip().lower()
                if role == "mode" and word in MODES:
                    self._modes.append((message.stamp_ns, word))

    def _add(self, name: str, stamp_ns: int, value: float) -> None:
        if math.isfinite(value):
            self._samples[name].append((stamp_ns, value))

    def signals(self) -> LoadingSignals | None:
        """Return the signals; None where there are none."""
        stamps = [rows[k][0] for rows in map(sorted, self._samples.values()) if rows for k in (0, -1)]
        if not stamps:
            return None
        start_ns = min(stamps)
        grid_ns = start_ns + np.arange(int((max(stamps) - start_ns) * 1e-9 / STEP_S) + 1) * round(STEP_S * 1e9)
        columns = (_held(self._samples[name], grid_ns) for name in _NAMES)
        return LoadingSignals._make((start_ns, *columns, self._mode(grid_ns)))

    def _mode(self, grid_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.object_]:
        """Return the mode told last, before the first the first; empty texts where none was told."""
        if not self._modes:
            return np.full(len(grid_ns), "", dtype=object)
        rows = sorted(self._modes)
        at = np.searchsorted([row[0] for row in rows], grid_ns, side="right") - 1
        return np.array([row[1] for row in rows], dtype=object)[np.maximum(at, 0)]


def _held(samples: list[tuple[int, float]], grid_ns: npt.NDArray[np.int64]) -> FloatArray:
    """Return the newest sample at each time of the grid."""
    if not samples:
        return np.full(len(grid_ns), np.nan)
    rows = sorted(samples)
    stamps = np.array([row[0] for row in rows], dtype=np.int64)
    values = np.array([row[1] for row in rows])
    at = np.searchsorted(stamps, grid_ns, side="right") - 1
    fresh = (at >= 0) & (grid_ns - stamps[np.maximum(at, 0)] <= _HELD_S * 1e9)
    return np.where(fresh, values[np.maximum(at, 0)], np.nan)

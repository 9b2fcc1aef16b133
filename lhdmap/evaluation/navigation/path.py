"""Where the machine was by wheels and joint alone: Eq. (1) of the autonomous-loading paper, for a stretch of its own length.

It carries scan points past the machine, no farther; its drift over 15 m is centimetres.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lhdmap.evaluation.navigation.signals import Signals
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray

_GRID_HZ = 50.0
_AVERAGED = 9  # grid steps: the noise of the joint's encoder turns all points


class Moment(NamedTuple):
    """The machine at a time: pose of `base_link` (x, y, heading), articulation, way travelled; `stretch`: between gaps."""

    pose: FloatArray
    articulation_rad: float
    travelled_m: float
    speed_mps: float
    stretch: int


class WheelPath:
    """The path of a drive; `at` gives the moments of it."""

    def __init__(self, signals: Signals, machine: Machine) -> None:
        """Integrate the whole drive."""
        time_s = np.arange(round(signals.length_s * _GRID_HZ) + 1) / _GRID_HZ
        speed, angle = signals.speed_mps.at(time_s), signals.articulation_rad.at(time_s)
        known = np.isfinite(speed) & np.isfinite(angle)
        self._time_s, self._known = time_s, known
        self._stretch = np.cumsum(np.concatenate([[0], np.diff(known.astype(np.int8)) == 1]))
        speed, angle = np.where(known, speed, 0.0), _averaged(np.where(known, angle, 0.0))
        front_m, rear_m = machine.dimensions.joint_to_front_axle_m, machine.dimensions.joint_to_rear_axle_m
        turn = speed * np.sin(angle) + rear_m * np.gradient(angle, 1.0 / _GRID_HZ) if len(time_s) > 1 else speed
        heading = _integrated(turn / (front_m * np.cos(angle) + rear_m))
        columns = (_integrated(speed * np.cos(heading)), _integrated(speed * np.sin(heading)), heading)
        self._rows = np.column_stack([*columns, angle, _integrated(np.abs(speed)), speed])

    def at(self, time_s: float) -> Moment | None:
        """Return the moment, None where speed or articulation are not known."""
        row = time_s * _GRID_HZ
        before = int(np.floor(row))
        if before < 0 or before + 1 >= len(self._time_s) or not (self._known[before] and self._known[before + 1]):
            return None
        share = row - before
        values = (1.0 - share) * self._rows[before] + share * self._rows[before + 1]
        return Moment(values[:3], float(values[3]), float(values[4]), float(values[5]), int(self._stretch[before]))


def _averaged(values: FloatArray) -> FloatArray:
    if len(values) < _AVERAGED:
        return values
    padded = np.pad(values, _AVERAGED // 2, mode="edge")
    return np.convolve(padded, np.full(_AVERAGED, 1.0 / _AVERAGED), mode="valid")


def _integrated(rate: FloatArray) -> FloatArray:
    """Return the integral from the first sample on, by trapezia, shape (N,)."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))]) / _GRID_HZ

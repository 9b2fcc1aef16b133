"""A row of Tables 3 and 4: one log, its figures and what is to be said of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lhdmap.evaluation.navigation.drive import RATE_HZ
from lhdmap.evaluation.navigation.signals import Series, Signals

FIGURES = (
    "mean_speed_kmh", "max_speed_kmh", "length_s", "navigation_s", "stop_s", "teleoperation_s", "unknown_s",
    "td_net_m", "td_travelled_m", "tad_net_m", "tad_travelled_m",
    "acd", "mcd", "asd", "msd", "adlw_m", "mdlw_m", "adrw_m", "mdrw_m",
    "acd_moving", "asd_moving", "steering_rate_rms_dps", "steering_acceleration_rms_dps2", "acceleration_rms_mps2",
    "lw_share", "rw_share",
)  # fmt: skip
"""The figures of a row that groups have mean and deviation of."""


@dataclass(frozen=True, slots=True)
class Row:
    """A drive: `load` `E`, `L` or None (not told), `operation` who drove, `heading` F, B or both; figures None: not known."""

    log: str
    load: str | None
    operation: str | None
    heading: str | None
    figures: Mapping[str, float | None]
    warnings: tuple[str, ...] = ()
    problem: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return the row as one flat table."""
        told = {"log": self.log, "load": self.load, "operation": self.operation, "heading": self.heading}
        return told | dict(self.figures) | {"warnings": list(self.warnings), "problem": self.problem or None}


def row_of(log: str, load: str | None, found: Mapping[str, Any], warnings: Sequence[str], signals: Signals) -> Row:
    """Return the row of what was found of a log."""
    figures = {name: found.get(name) for name in FIGURES}
    said = dict.fromkeys([*warnings, *_slow(signals), *_beyond(found), *_unseen(found)])
    return Row(log, load, found.get("operation"), found.get("heading"), figures, tuple(said))


def failed(log: str, load: str | None, problem: str) -> Row:
    """Return the row of a log that could not be used."""
    return Row(log, load, None, None, dict.fromkeys(FIGURES), (), problem)


def _slow(signals: Signals) -> list[str]:
    """Return which signals come too seldom for the rate of the differences."""
    found = []
    named = {"tachometer": signals.speed_mps, "joints": signals.articulation_rad, "command": signals.propel}
    for name, series in named.items():
        rate_hz = _rate(series)
        if 0.0 < rate_hz < 0.9 * RATE_HZ:
            found.append(f"{name}: {rate_hz:.1f} Hz, differences are taken at {RATE_HZ:g} Hz and come out too small")
    return found


def _rate(series: Series) -> float:
    steps = np.diff(series.time_s)
    return float(1.0 / np.median(steps)) if len(steps) else 0.0


def _beyond(found: Mapping[str, Any]) -> list[str]:
    largest = found.get("largest_command")
    if largest is None or largest <= 1.001:
        return []
    return [f"commands reach {largest:.2f} of their largest; ±1 was wanted: check units and --machine"]


def _unseen(found: Mapping[str, Any]) -> list[str]:
    unknown_s, length_s = found.get("unknown_s") or 0.0, found.get("length_s") or 0.0
    if unknown_s <= 0.5 or unknown_s >= length_s:
        return []
    return [f"speed is not known for {unknown_s:.1f} s of {length_s:.1f} s: gaps of more than 0.5 s"]

"""Smoothness that does not depend on the rate of a log: rms of dγ/dt, d²γ/dt² and dv/dt after one low pass.

The low pass: straight lines between samples to 50 Hz, then a Butterworth filter of second order at 1 Hz, forwards and
backwards (no delay). A log at 10 Hz or more gives the same figures whatever its rate.
"""

from __future__ import annotations

import numpy as np

from lhdmap.evaluation.navigation.signals import Series, Signals
from lhdmap.messages import FloatArray

GRID_HZ, CUT_HZ, ORDER = 50.0, 1.0, 2
LOW_PASS = f"lines to {GRID_HZ:g} Hz, Butterworth of order {ORDER} at {CUT_HZ:g} Hz, forwards and backwards"
_LEAST_S = 2.0


def rate_free(signals: Signals) -> dict[str, float | None]:
    """Return rms of steering rate (deg/s), steering acceleration (deg/s²) and acceleration (m/s²) over the drive."""
    angle = _derivatives(signals.articulation_rad, signals.length_s, 2)
    speed = _derivatives(signals.speed_mps, signals.length_s, 1)
    return {
        "steering_rate_rms_dps": _rms(np.degrees(angle[0])),
        "steering_acceleration_rms_dps2": _rms(np.degrees(angle[1])),
        "acceleration_rms_mps2": _rms(speed[0]),
    }


def _derivatives(series: Series, length_s: float, count: int) -> list[FloatArray]:
    """Return the first `count` derivatives of the smoothed signal, stretches between gaps one after the other."""
    time_s = np.arange(round(length_s * GRID_HZ)) / GRID_HZ
    values = series.at(time_s)
    parts: list[list[FloatArray]] = [[] for _ in range(count)]
    for first, last in _stretches(np.isfinite(values)):
        if (last - first) / GRID_HZ < _LEAST_S:
            continue
        smooth = _low_passed(values[first:last])
        for part in parts:
            smooth = np.gradient(smooth, 1.0 / GRID_HZ)
            part.append(smooth)
    return [np.concatenate(part) if part else np.empty(0) for part in parts]


def _low_passed(values: FloatArray) -> FloatArray:
    from scipy.signal import butter, sosfiltfilt

    found: FloatArray = sosfiltfilt(butter(ORDER, CUT_HZ, fs=GRID_HZ, output="sos"), values)
    return found


def _stretches(known: FloatArray) -> list[tuple[int, int]]:
    """Return first row and the row after the last of each run of true flags (N,)."""
    steps = np.diff(np.concatenate([[0], np.asarray(known, dtype=np.int8), [0]]))
    return list(zip(np.flatnonzero(steps == 1).tolist(), np.flatnonzero(steps == -1).tolist(), strict=True))


def _rms(values: FloatArray) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None

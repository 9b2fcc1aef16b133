"""Digs and weighings found in the signals alone, for logs that have nothing but the contract's topics.

A dig: the machine pushes forward while the bucket is tilted, lifted, or the engine is asked for all its speed. Short pulses are
none (a bucket eased while charging); short breaks are not its end (a stuck machine that backs out a little).
A weighing: the machine stands, boom and bucket stand at β_weigh, and nothing is asked of them.
A load ends where the bucket is dumped, the machine goes far, or a bucket is weighed much lighter than before.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.evaluation.loading.loads import Attempt, Load
from lhdmap.evaluation.loading.signals import STEP_S, LoadingSignals
from lhdmap.loading.weighing_settings import WeighingSettings

_ASKED = 0.02
_PULSE_S, _BREAK_S, _LEAST_S = 0.3, 1.5, 1.0
_TURNED_RAD = 0.08  # boom or bucket, in a dig
_PRESSED_BAR = 120.0
_NEAR_RAD, _STILL_RAD, _STILL_MPS = 0.04, 0.01, 0.06
_SETTLED_S, _WINDOW_S = 0.8, 1.0
_FAR_M = 40.0
_DUMPED_RAD = -1.0  # a dig never tilts so far
_LIGHTER = 0.3
_NOTHING = 0.05


class Span(NamedTuple):
    """Rows of the grid, the last one not in it."""

    first: int
    end: int

    @property
    def length_s(self) -> float:
        """Its time."""
        return (self.end - self.first) * STEP_S


def spans_of(mask: npt.NDArray[np.bool_], break_s: float = 0.0, least_s: float = 0.0) -> list[Span]:
    """Return where a mask is true, spans that are no farther apart than `break_s` as one, without those under `least_s`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    found: list[Span] = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if found and (first - found[-1].end) * STEP_S <= break_s:
            found[-1] = Span(found[-1].first, end)
        else:
            found.append(Span(first, end))
    return [span for span in found if span.length_s >= least_s - 1e-9]


def digs_of(signals: LoadingSignals) -> list[Span]:
    """Return the digs of a log in order."""
    with np.errstate(invalid="ignore"):
        asked = (signals.tilt > _ASKED) | (signals.lift > _ASKED) | (signals.full_rpm > 0.5)
        pushing = (signals.propel > _ASKED) & ~(signals.brake > 0.5) & asked
    steady = np.zeros(len(pushing), dtype=bool)
    for span in spans_of(pushing, least_s=_PULSE_S):
        steady[span.first : span.end] = True
    return [span for span in spans_of(steady, _BREAK_S, _LEAST_S) if _digs(signals, span)]


def _digs(signals: LoadingSignals, span: Span) -> bool:
    """Return whether boom or bucket moved, against a pressure where the log has one."""
    rows = slice(span.first, span.end)
    turned = [
        np.ptp(v[np.isfinite(v)]) for v in (signals.boom_rad[rows], signals.bucket_rad[rows]) if np.isfinite(v).any()
    ]
    if turned and max(turned) < _TURNED_RAD:
        return False
    pressure = signals.transmission_bar[rows]
    return not np.isfinite(pressure).any() or float(np.nanmax(pressure)) >= _PRESSED_BAR


def weighed_in(signals: LoadingSignals, span: Span, settings: WeighingSettings) -> tuple[float, float]:
    """Return the fill and its deviation by the last weighing in a span; NaN where there is none."""
    with np.errstate(invalid="ignore"):
        still = np.abs(signals.boom_rad - settings.boom_rad) < _NEAR_RAD
        still &= ~(np.abs(signals.propel) > _ASKED) & ~(np.abs(signals.speed_mps) > _STILL_MPS)
        still &= ~(np.abs(signals.tilt) > _ASKED) & ~(np.abs(signals.lift) > _ASKED) & np.isfinite(signals.lift_bar)
    still[: span.first] = still[span.end :] = False
    spans = [
        one for one in spans_of(still, least_s=_SETTLED_S) if np.ptp(signals.boom_rad[one.first : one.end]) < _NEAR_RAD
    ]
    if not spans:
        return math.nan, math.nan
    last = spans[-1]
    first = max(last.first + round(_SETTLED_S / STEP_S / 2), last.end - round(_WINDOW_S / STEP_S))
    rows = signals.lift_bar[first : last.end]
    fill = settings.fill_per_bar * float(rows.mean()) - settings.fill_offset
    std_bar = math.hypot(
        settings.friction_bar, settings.zero_bar, float(rows.std()) / math.sqrt(max(len(rows) / 4.0, 1.0))
    )
    return fill, math.hypot(settings.fill_per_bar * std_bar, settings.centre_share * fill)


def loads_of(signals: LoadingSignals, name: str, settings: WeighingSettings) -> list[Load]:
    """Return the loads of a log; `name` is what they are called after."""
    digs, loads = digs_of(signals), []
    attempts: list[Attempt] = []
    for number, dig in enumerate(digs):
        until = digs[number + 1].first if number + 1 < len(digs) else len(signals.propel)
        fill, std = weighed_in(signals, Span(dig.end, until), settings)
        if attempts and _lighter(attempts, fill):
            loads.append(attempts)
            attempts = []
        attempts.append(_attempt(signals, dig, (fill, std), attempts))
        if _hauled(signals, Span(dig.end, until)):
            loads.append(attempts)
            attempts = []
    loads += [attempts] if attempts else []
    return [Load(name if len(loads) == 1 else f"{name} {i}", tuple(one)) for i, one in enumerate(loads, start=1)]


def _attempt(signals: LoadingSignals, dig: Span, weighed: tuple[float, float], before: list[Attempt]) -> Attempt:
    """Return an attempt; one that leaves an empty bucket empty was begun too early: it never met the pile."""
    fill, std = weighed
    last = next((one.fill for one in reversed(before) if math.isfinite(one.fill)), 0.0)
    early = fill < _NOTHING and last < _NOTHING
    return Attempt(dig.first * STEP_S, dig.length_s, fill, std, early, str(signals.mode[dig.first]))


def _lighter(attempts: list[Attempt], fill: float) -> bool:
    last = next((one.fill for one in reversed(attempts) if math.isfinite(one.fill)), math.nan)
    return fill < last - _LIGHTER


def _hauled(signals: LoadingSignals, span: Span) -> bool:
    """Return whether the bucket was dumped, or the machine went far."""
    rows = slice(span.first, span.end)
    bucket, speed = signals.bucket_rad[rows], signals.speed_mps[rows]
    dumped = np.isfinite(bucket).any() and float(np.nanmin(bucket)) < _DUMPED_RAD
    return bool(dumped) or float(np.nansum(np.abs(speed))) * STEP_S > _FAR_M

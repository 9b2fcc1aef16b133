"""Weighing, section 3.5: the boom is lifted to β_weigh from below, left to settle, and its pressure gives the fill, Eq. (9)."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from lhdmap.loading.signals import Pedals, Signals, Turn
from lhdmap.loading.weighing_settings import WeighingSettings
from lhdmap.loading.weighing_settle import Settled, mean_of, sinusoid_of

_LOOK_NS = 100_000_000
_FEW = 8


class Weighed(NamedTuple):
    """A fill factor (0 empty, 1 full) with its deviation, the pressure that it is of, and the time that it took to settle."""

    fill: float
    fill_std: float
    pressure_bar: float
    settling_s: float
    settled: bool


class Weighing:
    """The controller of weighing; ends with `weighed`, or `not settled` where patience ran out: `result` has the fill.

    `tare_bar`: pressure of the empty bucket, weighed the same way (by default that of the settings); it takes the zero of the
    sensor out (0.5 % of 600 bar are 6 % of a fill), and the friction. The values of its last turn: `fill`, `fill_std`,
    `pressure_bar`, `settling_s`.
    """

    def __init__(self, settings: WeighingSettings, tare_bar: float | None = None) -> None:
        self._settings, self.tare_bar = settings, tare_bar if tare_bar is not None else settings.tare_bar or None
        self.result: Weighed | None = None
        self._rows: deque[tuple[int, float, float]] = deque()  # time, pressure, the same low-passed
        self._held_ns = self._looked_ns = 0
        self._below = False

    def begin(self, signals: Signals) -> None:  # noqa: ARG002  # it begins anywhere
        """Forget the last weighing; the tare stays."""
        self.result, self._below, self._held_ns, self._looked_ns = None, False, 0, 0
        self._rows.clear()

    def step(self, signals: Signals) -> Turn:
        """Return the lift of this moment; the machine stands braked."""
        one = self._settings
        if not self._held_ns:
            lift = self._way(signals)
            if lift:
                return Turn(Pedals(lift=lift, full_rpm=lift < 0.0, brake=True))
            self._held_ns = signals.now_ns
        self._add(signals)
        found = self._looked(signals.now_ns)
        if found is None:
            return Turn(Pedals(brake=True))
        settling_s = (signals.now_ns - self._held_ns) * 1e-9
        settled = self._calm() and settling_s <= one.patience_s
        self.result = weighed = self._weighed(found, settling_s, settled=settled)
        values = [(name, float(getattr(weighed, name))) for name in ("fill", "fill_std", "pressure_bar", "settling_s")]
        return Turn(Pedals(brake=True), "weighed" if settled else "not settled", tuple(values))

    def _way(self, signals: Signals) -> float:
        """Return the lift command on the way: below β_weigh first, then up to it; 0 where it is reached."""
        one = self._settings
        self._below = self._below or signals.boom_rad <= one.boom_rad - one.below_rad
        if not self._below:
            return -1.0
        return one.lift if signals.boom_rad < one.boom_rad else 0.0

    def _add(self, signals: Signals) -> None:
        if not math.isfinite(signals.lift_bar):
            return
        low = signals.lift_bar
        if self._rows and self._settings.low_pass_s > 0.0:
            last_ns, _, before = self._rows[-1]
            low = before + (low - before) * (
                1.0 - math.exp((last_ns - signals.now_ns) * 1e-9 / self._settings.low_pass_s)
            )
        self._rows.append((signals.now_ns, signals.lift_bar, low))
        while self._rows[0][0] < signals.now_ns - self._settings.window_s * 1e9:
            self._rows.popleft()

    def _looked(self, now_ns: int) -> Settled | None:
        """Return the pressure where it has settled or patience is over; None while it is waited for."""
        one = self._settings
        waited_s = (now_ns - self._held_ns) * 1e-9
        if waited_s < one.window_s or now_ns - self._looked_ns < _LOOK_NS:
            return None
        self._looked_ns = now_ns
        over = waited_s >= one.patience_s
        if len(self._rows) < _FEW or not (over or self._calm()):
            return Settled(math.nan, math.nan, math.nan) if over else None
        rows = np.array(self._rows, dtype=float)
        return (
            mean_of(rows[:, 1]) if one.method == "mean" else sinusoid_of((rows[:, 0] - rows[0, 0]) * 1e-9, rows[:, 1])
        )

    def _calm(self) -> bool:
        """Return whether the low-passed pressure of the window deviates by less than `settled_bar`."""
        return len(self._rows) >= _FEW and float(np.std([row[2] for row in self._rows])) < self._settings.settled_bar

    def _weighed(self, found: Settled, settling_s: float, *, settled: bool) -> Weighed:
        """Return the fill by Eq. (9), the tare taken off, with all that makes it uncertain."""
        one = self._settings
        empty_bar = one.fill_offset / one.fill_per_bar
        zero_bar = 0.0 if self.tare_bar is None else self.tare_bar - empty_bar
        fill = one.fill_per_bar * (found.pressure_bar - zero_bar) - one.fill_offset
        unknown_bar = one.zero_bar if self.tare_bar is None else 0.0
        swing_bar = found.std_bar if settled else max(found.std_bar, found.residual_bar)
        std_bar = math.hypot(swing_bar, one.friction_bar, unknown_bar)
        std = math.hypot(one.fill_per_bar * std_bar, one.centre_share * fill)
        return Weighed(fill, std, found.pressure_bar, settling_s, settled)

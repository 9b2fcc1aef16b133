"""Wheel slip: the skid factor of the paper, the scale of the tachometer, and whether the wheels can be believed now."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.settings import setting


@dataclass(frozen=True, slots=True)
class SlipSettings:
    """Slip: the skid factor's window, and when a wheel speed is distrusted."""

    window_s: float = setting(
        3.0,
        unit="s",
        source="paper, Eq. (7), which gives no value",
        minimum=0.0,
        doc="Window of the largest speed v_Mm.",
    )
    min_speed_mps: float = setting(
        0.1, unit="m/s", minimum=1e-3, doc="v_Mm is not taken below this: a standing machine does not skid."
    )
    k_sigma: float = setting(
        3.5, unit="sigma", minimum=0.5, doc="A wheel speed this far from the expected one is slip."
    )
    wheel_std_mps: float = setting(0.03, unit="m/s", minimum=1e-4, doc="Noise of the tachometer.")
    acceleration: float = setting(
        0.3, unit="m/s/sqrt(s)", minimum=1e-3, doc="How far the machine's speed wanders: 0.3 m/s in 1 s, 0.42 in 2 s."
    )
    release_s: float = setting(
        0.3, unit="s", minimum=0.0, doc="Wheels are believed again after agreeing for this long."
    )
    max_slip_s: float = setting(
        5.0, unit="s", minimum=0.1, doc="Without a word from the scanner, wheels are distrusted no longer than this."
    )
    max_lidar_std_mps: float = setting(
        0.3, unit="m/s", minimum=0.0, doc="Lidar speeds that are less certain do not take part in the scale."
    )
    block_m: float = setting(1.0, unit="m", minimum=0.1, doc="Distance over which one ratio of both speeds is formed.")
    min_blocks: int = setting(5, unit="blocks", minimum=1, doc="The scale is used from so many ratios on.")
    max_blocks: int = setting(
        200, unit="blocks", minimum=1, doc="The scale is a robust mean of the last so many ratios."
    )


class SlipEstimator:
    """Compares wheel speed and lidar speed, one `update` for each processed scan.

    After each update: `trusted` (may the wheels be used?), `scale` and `scale_std` (lidar speed / wheel speed),
    `speed_mps` (the machine's speed from lidar, inertia and trusted wheels).
    """

    def __init__(self, settings: SlipSettings, scale_std: float = 0.02) -> None:
        self.settings = settings
        self.trusted = True
        self.scale, self.scale_std = 1.0, scale_std
        self.speed_mps: float | None = None
        self._variance = math.inf
        self._stamp_ns: int | None = None
        self._distrusted_ns = self._agreeing_ns = self._lidar_ns = 0
        self._peak_mps = 0.0
        self._window: deque[tuple[int, float]] = deque()
        self._ratios: deque[float] = deque(maxlen=settings.max_blocks)
        self._wheel_m = self._lidar_m = 0.0

    def update(
        self, stamp_ns: int, wheel_speed_mps: float, lidar_speed_mps: float, lidar_std_mps: float = 0.05
    ) -> float:
        """Take both speeds (m/s, signed, wheel speed as measured) and return the skid factor, Eq. (7).

        skid = (v_T - v_L) / v_Mm, with v_Mm the largest |v_T| or |v_L| of the last `window_s`, and no less than
        `min_speed_mps`: at a stand it is 0, not 0 / 0. v_T is taken times the scale that has been learnt, so that a
        tachometer that is 1 % off does not read as skid. NaN is returned where a speed is missing (NaN).
        `lidar_std_mps`: infinite where the scanner did not see the motion along the drift: nothing is learned then.
        """
        if self._stamp_ns is not None and stamp_ns <= self._stamp_ns:
            return self._skid(stamp_ns, wheel_speed_mps, lidar_speed_mps)
        dt = 0.0 if self._stamp_ns is None else (stamp_ns - self._stamp_ns) / 1e9
        self._stamp_ns = stamp_ns
        self._variance += self.settings.acceleration**2 * dt
        seen = math.isfinite(lidar_speed_mps) and math.isfinite(lidar_std_mps)
        if seen:
            self._fuse(lidar_speed_mps, lidar_std_mps)
            self._lidar_ns = stamp_ns
        if math.isfinite(wheel_speed_mps):
            self._judge(stamp_ns, wheel_speed_mps)
            if seen:
                self._learn(wheel_speed_mps * dt, lidar_speed_mps * dt, lidar_std_mps)
        return self._skid(stamp_ns, wheel_speed_mps, lidar_speed_mps)

    def agrees(self, stamp_ns: int, wheel_speed_mps: float) -> bool:
        """Return whether a wheel speed (as measured) can be believed before the scan of that time is matched.

        It is not while the wheels slip, nor where it is more than k sigma from where inertia lets the speed be.
        """
        if self.speed_mps is None or self._stamp_ns is None:
            return math.isfinite(wheel_speed_mps)
        ahead_s = max(stamp_ns - self._stamp_ns, 0) / 1e9
        variance = self._variance + self.settings.acceleration**2 * ahead_s
        near = abs(self._excess(wheel_speed_mps)) <= self.settings.k_sigma * math.hypot(
            math.sqrt(variance), self._wheel_std(wheel_speed_mps)
        )
        return self.trusted and near

    def _skid(self, stamp_ns: int, wheel_mps: float, lidar_mps: float) -> float:
        if not (math.isfinite(wheel_mps) and math.isfinite(lidar_mps)):
            return math.nan
        wheel_mps *= self.scale
        window = self._window
        speed = max(abs(wheel_mps), abs(lidar_mps))
        while window and window[-1][1] <= speed:  # never the largest again: the window stays sorted, its first leads
            window.pop()
        window.append((stamp_ns, speed))
        while window[0][0] < stamp_ns - self.settings.window_s * 1e9:
            window.popleft()
        return (wheel_mps - lidar_mps) / max(window[0][1], self.settings.min_speed_mps)

    def _excess(self, wheel_mps: float) -> float:
        return wheel_mps * self.scale - (self.speed_mps or 0.0)

    def _wheel_std(self, wheel_mps: float) -> float:
        return math.hypot(self.settings.wheel_std_mps, self.scale_std * wheel_mps)

    def _fuse(self, speed_mps: float, std_mps: float) -> None:
        """Correct the speed by a measurement (scalar Kalman filter)."""
        if self.speed_mps is None or math.isinf(self._variance):
            self.speed_mps, self._variance = speed_mps, std_mps**2
            return
        gain = self._variance / (self._variance + std_mps**2)
        self.speed_mps += gain * (speed_mps - self.speed_mps)
        self._variance *= 1.0 - gain

    def _judge(self, stamp_ns: int, wheel_mps: float) -> None:
        """Decide on trust: lost at once, regained after a while of agreement with a speed that is not too uncertain."""
        settings, wheel_std = self.settings, self._wheel_std(wheel_mps)
        if self.speed_mps is None:
            self._fuse(wheel_mps * self.scale, wheel_std)
            return
        spread = math.sqrt(self._variance)
        excess = abs(self._excess(wheel_mps))
        if self.trusted:
            self.trusted = excess <= settings.k_sigma * math.hypot(spread, wheel_std)
            self._distrusted_ns = self._agreeing_ns = stamp_ns
            self._peak_mps = excess
        else:
            # The uncertainty that grew while the wheels slipped must not be what lets them back in: the disagreement
            # has to have shrunk as well, or the wheels to stand (blocked wheels stop the machine).
            self._peak_mps = max(self._peak_mps, excess)
            near = excess <= settings.k_sigma * math.hypot(spread, wheel_std) and excess < 0.4 * self._peak_mps
            if not near and abs(wheel_mps) > settings.wheel_std_mps:
                self._agreeing_ns = stamp_ns
            self.trusted = stamp_ns - self._agreeing_ns >= settings.release_s * 1e9
            if stamp_ns - max(self._distrusted_ns, self._lidar_ns) > settings.max_slip_s * 1e9:
                self.trusted, self._variance = True, math.inf
        if self.trusted:
            self._fuse(wheel_mps * self.scale, wheel_std)

    def _learn(self, wheel_m: float, lidar_m: float, lidar_std_mps: float) -> None:
        """Add to the block of distance; where it is complete, its ratio joins the others.

        Slip does not bias the scale as long as it lasts for less than half of the way.
        """
        if lidar_std_mps > self.settings.max_lidar_std_mps:
            return
        self._wheel_m += abs(wheel_m)
        self._lidar_m += math.copysign(1.0, wheel_m) * lidar_m
        if max(self._wheel_m, abs(self._lidar_m)) < self.settings.block_m:
            return
        if self._wheel_m > 0.5 * self._lidar_m > 0.125 * self._wheel_m:
            self._ratios.append(self._lidar_m / self._wheel_m)
        self._wheel_m = self._lidar_m = 0.0
        if len(self._ratios) >= self.settings.min_blocks:
            self.scale, self.scale_std = _robust_mean(np.array(self._ratios))


def _robust_mean(values: FloatArray) -> tuple[float, float]:
    """Return the mean of the values that are no outliers, and its standard deviation (no less than 0.001).

    From the median on, values beyond 2.5 sigma (by the median deviation) are left out: outliers that are all on one
    side, as slip makes them, would pull the median itself.
    """
    centre, kept = float(np.median(values)), np.zeros(len(values), dtype=bool)
    for _ in range(5):
        off = np.abs(values - centre)
        before, kept = kept, off <= 2.5 * max(1.4826 * float(np.median(off)), 1e-4)
        if np.array_equal(kept, before):
            break
        centre = float(values[kept].mean())
    return centre, max(float(values[kept].std()) / math.sqrt(np.count_nonzero(kept)), 0.001)

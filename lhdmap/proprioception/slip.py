"""Wheel slip: the skid factor of the loading paper, Eq. (7)."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from lhdmap.settings import setting


@dataclass(frozen=True, slots=True)
class SlipSettings:
    """Slip: the skid factor's window."""

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


class SkidFactor:
    """skid = (v_T - v_L) / v_Mm: `update` with each pair of speeds, in the order of time."""

    def __init__(self, settings: SlipSettings) -> None:
        self.settings = settings
        self._window: deque[tuple[int, float]] = deque()

    def update(self, stamp_ns: int, wheel_mps: float, machine_mps: float) -> float:
        """Return the skid factor of the wheels' speed v_T and the machine's by the scanner, v_L (m/s, both signed).

        v_Mm is the largest |v_T| or |v_L| of the last `window_s`, and no less than `min_speed_mps`: at a stand it is 0, not 0 / 0.
        v_T is taken as the tachometer would read without its scale error: one that is 1 % off does not skid. NaN where a speed
        is missing (NaN): also where the scanner did not see the motion along the drift, and v_L is the wheels' own.
        """
        if not (math.isfinite(wheel_mps) and math.isfinite(machine_mps)):
            return math.nan
        window = self._window
        speed = max(abs(wheel_mps), abs(machine_mps))
        while window and window[-1][1] <= speed:  # never the largest again: the window stays sorted, its first leads
            window.pop()
        window.append((stamp_ns, speed))
        while window[0][0] < stamp_ns - self.settings.window_s * 1e9:
            window.popleft()
        return (wheel_mps - machine_mps) / max(window[0][1], self.settings.min_speed_mps)

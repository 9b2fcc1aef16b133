"""Whether the wheels' speed is to be believed at all: a sign, a unit or a topic may be wrong, a shaft may be torn off.

Scans that hold well against the walls decide it. Wheels that contradict these are not asked where the walls do not hold, either.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from lhdmap.odometry.wheels.stretch import Compared

_AGREES = (0.75, 1.33)  # wheels' way over that of the walls: worn wheels are off by 15 % (ACES), slipping ones by more
_MEMORY_M = 3.0
_FEWEST_M = 0.4
_TELL_M, _TELL_SHARE = 10.0, 0.1
_MOST_RATIOS = 500


class WheelTrust:
    """`learn` with each stretch that was compared with the walls; `believed` says what follows."""

    def __init__(self) -> None:
        self.compared_m = self.against_m = 0.0
        self._for_recently_m = self._against_recently_m = 0.0
        self._ratios: deque[float] = deque(maxlen=_MOST_RATIOS)

    @property
    def believed(self) -> bool:
        """Return whether the wheels are to be used."""
        return self._against_recently_m < max(_FEWEST_M, self._for_recently_m)

    def learn(self, stretch: Compared) -> None:
        """Take a stretch; one that was hardly driven says nothing of the speed."""
        length_m = max(abs(stretch.walls_m), abs(stretch.wheels_m))
        if length_m < _FEWEST_M:
            return
        ratio = stretch.wheels_m / stretch.walls_m if stretch.walls_m else math.inf
        against = not _AGREES[0] < ratio < _AGREES[1]
        keep = math.exp(-length_m / _MEMORY_M)
        self._for_recently_m = keep * self._for_recently_m + length_m * (not against)
        self._against_recently_m = keep * self._against_recently_m + length_m * against
        self.compared_m += length_m
        self.against_m += length_m * against
        if against:
            self._ratios.append(ratio)

    def contradicted(self) -> None:
        """Take it that wheels went the other way than the machine: a tachometer without sign. It has to prove right anew."""
        self._for_recently_m, self._against_recently_m = 0.0, max(self._against_recently_m, _FEWEST_M)

    def warning(self) -> str | None:
        """Return what a user should know of the wheels."""
        if self.against_m < max(_TELL_M, _TELL_SHARE * self.compared_m):
            return None
        ratio = float(np.median(self._ratios))
        return (
            f"wheels: over {self.against_m:.0f} of {self.compared_m:.0f} m they contradict the scans and were left out, with "
            f"{ratio:.2g} times the scans' speed{_reason(ratio)}"
        )


def _reason(ratio: float) -> str:
    """Return what a ratio of speeds is known to come from."""
    if -_AGREES[1] < ratio < -_AGREES[0]:
        return ": is the sign wrong, or missing in reverse?"
    if 0.75 < ratio / 3.6 < 1.33:
        return ": are they in km/h?"
    if abs(ratio) < 0.05:
        return ": does the sensor stand still?"
    return ""

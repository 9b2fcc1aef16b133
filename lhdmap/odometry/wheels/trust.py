"""Whether the wheels' speed is to be believed at all: a sign, a unit or a topic may be wrong, a shaft may be torn off.

Scans that hold well against the walls decide it. Wheels that contradict these are not asked where the walls do not hold, either.
"""

from __future__ import annotations

import math

from lhdmap.odometry.wheels.stretch import Compared
from lhdmap.odometry.wheels.tally import WordOfWalls

_AGREES = (
    0.75,
    1.33,
)  # distance by wheels over that by walls: worn wheels are off by 15 % (ACES), slipping ones by more
_MEMORY_M = 3.0  # that count as lately: a shaft that tears off is found out within as much
_FEWEST_M = 0.4  # a stretch that is shorter says nothing of a speed: a match is off by a centimetre
_TELL_M, _TELL_SHARE = 10.0, 0.1  # contradicted at least, and of what was compared, until a user is told
_KMH_AGREES = (0.75, 1.33)  # as `_AGREES`, of the ratio over 3.6: metres per second that are kilometres per hour
_STILL_RATIO = 0.05  # below it the sensor does not turn at all


class WheelTrust:
    """`learn` with each stretch that was compared with the walls; `believed` says what follows."""

    def __init__(self) -> None:
        self._tally = WordOfWalls(_MEMORY_M)

    @property
    def compared_m(self) -> float:
        """Distance over which wheels and walls were compared, m."""
        return self._tally.compared

    @property
    def against_m(self) -> float:
        """Part of it over which the wheels contradicted the walls, m."""
        return self._tally.against

    @property
    def believed(self) -> bool:
        """Return whether the wheels are to be used."""
        return self._tally.lately_against < max(_FEWEST_M, self._tally.lately_for)

    def learn(self, stretch: Compared) -> None:
        """Take a stretch; one that was hardly driven says nothing of the speed."""
        length_m = max(abs(stretch.walls_m), abs(stretch.wheels_m))
        if length_m < _FEWEST_M:
            return
        ratio = stretch.wheels_m / stretch.walls_m if stretch.walls_m else math.inf
        self._tally.take(length_m, ratio, agrees=_AGREES[0] < ratio < _AGREES[1])

    def contradicted(self) -> None:
        """Take it that wheels went the other way than the machine: a tachometer without sign. It has to prove right anew."""
        self._tally.lately_for, self._tally.lately_against = 0.0, max(self._tally.lately_against, _FEWEST_M)

    def warning(self) -> str | None:
        """Return what a user should know of the wheels."""
        if self.against_m < max(_TELL_M, _TELL_SHARE * self.compared_m):
            return None
        ratio = self._tally.ratio()
        return (
            f"wheels: over {self.against_m:.0f} of {self.compared_m:.0f} m they contradict the scans and were left out, with "
            f"{ratio:.2g} times the scans' speed{_reason(ratio)}"
        )


def _reason(ratio: float) -> str:
    """Return what a ratio of speeds is known to come from."""
    if -_AGREES[1] < ratio < -_AGREES[0]:
        return ": is the sign wrong, or missing in reverse?"
    if _KMH_AGREES[0] < ratio / 3.6 < _KMH_AGREES[1]:
        return ": are they in km/h?"
    if abs(ratio) < _STILL_RATIO:
        return ": does the sensor stand still?"
    return ""

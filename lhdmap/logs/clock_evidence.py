"""What the walls say of a pause: whether the scan behind it goes on where the scan before it was."""

from __future__ import annotations

from collections import deque

import numpy as np

from lhdmap.messages import Float32Array

_SCANS, _BEAMS = 64, 180
_FEWEST_BEAMS = 10
_USUAL_PAIRS = 5
_LARGEST_M = 1.0  # a beam that leaps into another drift shall not outweigh the others
_MOVES, _LAG = 1.3, 3  # scans of a moving machine differ the more, the farther apart they are
_TELLS = 1.6


class ScanMemory:
    """The last scans of one scanner, thinned."""

    def __init__(self) -> None:
        self._scans: deque[Float32Array] = deque(maxlen=_SCANS)

    def __len__(self) -> int:
        return len(self._scans)

    def add(self, ranges_m: Float32Array) -> None:
        """Take one scan, shape (N,)."""
        self._scans.append(ranges_m[:: max(len(ranges_m) // _BEAMS, 1)])

    def goes_on_with(self, ranges_m: Float32Array, scans: int) -> bool:
        """Return whether a scan is the next one rather than that after a way of so many `scans`.

        It says so only where the machine moves, and where the walls differ enough along the way to tell.
        """
        kept = list(self._scans)
        lag = min(scans, len(kept) - 1)
        if lag <= _USUAL_PAIRS:
            return False
        last, behind = kept[-1], ranges_m[:: max(len(ranges_m) // _BEAMS, 1)]
        usual = float(np.median([change_m(kept[-k - 1], kept[-k]) for k in range(1, _USUAL_PAIRS + 1)]))
        moving = change_m(kept[-1 - _LAG], last) > _MOVES * usual
        far = float(np.median([change_m(kept[-1 - k], last) for k in range(max(lag - 3, _USUAL_PAIRS), lag + 1)]))
        return bool(moving and far > _TELLS * usual and change_m(last, behind) < np.sqrt(usual * far))


def change_m(one: Float32Array, other: Float32Array) -> float:
    """Return by how much the ranges of two scans differ on the mean, metres; NaN where they cannot be compared."""
    if len(one) != len(other):
        return float("nan")
    with np.errstate(invalid="ignore"):
        apart = np.abs(one - other)
    apart = apart[np.isfinite(apart)]
    return float(np.minimum(apart, _LARGEST_M).mean()) if len(apart) >= _FEWEST_BEAMS else float("nan")

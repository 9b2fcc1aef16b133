"""A live profile is laid over all strips of a map: what each place costs, and which are the likeliest.

A place is where the newest bin of the live profile lies. It costs half the sum of squared differences over their variance,
truncated at 3 sigma, tempered by a third, as neighbouring bins are not independent (`lhdmap.landmarks.distinct`). What a fit
tells against another wall of the kind is taken off: so what is not known counts for nothing, and so does a tunnel outside the
map. From bin to bin each cost moves on by one place; where strips meet, the cheapest of those that lead in goes on: so all ways
through the graph are tried at the price of one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.landmarks.distinct import TEMPER, TRUNCATED
from lhdmap.localization.strips import Strips
from lhdmap.messages import FloatArray

_APART_M, _APART_RAD = 2.0, 0.35
_DIRECTION_RAD = 1.0
_LEVEL_M = 4.0
_PLACES = 5


class LiveProfile(NamedTuple):
    """Channels of the last metres: `values`, `variances` (3, J), NaN where not known; `line` (J, 2): the mid line in `odom`."""

    values: FloatArray
    variances: FloatArray
    line: FloatArray


class PlaceOnStrips(NamedTuple):
    """A bin of the strips where the live profile may end, what it costs (nats), its reduced χ², the share of bins compared.

    `probability`: against all other places, and against not being in the map.
    """

    place: int
    cost: float
    chi2: float
    compared: float
    probability: float


class Costs:
    """What each place of the strips costs a live profile, nats: 0 is what a tunnel costs that is not in the map.

    `weights` (3,): of the channels.
    """

    def __init__(self, strips: Strips, live: LiveProfile, weights: FloatArray) -> None:
        self._strips = strips
        known = np.isfinite(live.values) & np.isfinite(live.variances)
        values, variances = (
            np.where(known, one, other).astype(np.float32) for one, other in ((live.values, 0.0), (live.variances, 1.0))
        )
        scaled = (0.5 * TEMPER * weights).astype(np.float32)
        self._map, self._live = (strips.values, strips.variances, strips.known), (values, variances, known)
        self._bins = max(int(known[:2].sum()), 1)
        ways = strips.starts, strips.before, strips.before_starts
        self._costs, self._chosen = _slide(*self._map, strips.evidence, scaled, *self._live, *ways)
        least = min(float(self._costs.min()), 0.0)
        self._mass = np.exp(least - self._costs.astype(np.float64))
        self._all_mass = float(self._mass.sum()) + len(self._costs) * math.exp(least)

    def likeliest(self, count: int = _PLACES) -> list[PlaceOnStrips]:
        """Return the likeliest places, best first, each at one of its own."""
        found: list[PlaceOnStrips] = []
        left = self._costs.copy()
        while len(found) < count and math.isfinite(left.min()):
            best = int(left.argmin())
            same = self.near(self._strips.poses[best], float(self._strips.heights_m[best]))
            found.append(self._told(best, same))
            left[same] = np.inf
        return found

    def path(self, place: int) -> npt.NDArray[np.int64]:
        """Return the place of each live bin (J,) where the last one is at `place`; -1 outside the map."""
        path: npt.NDArray[np.int64] = _path(place, self._strips.starts, self._chosen)
        return path

    def at(self, line: FloatArray, height_m: float) -> PlaceOnStrips | None:
        """Return the best place about a pose (3,) of the live profile's last bin; None where the map has no walls there.

        Of its heading the direction counts alone: at its end a mid line may turn.
        """
        near = np.flatnonzero(self.near(line, height_m, _DIRECTION_RAD))
        if not len(near):
            return None
        best = int(near[self._costs[near].argmin()])
        return self._told(best, self.near(self._strips.poses[best], height_m))

    def near(self, pose: FloatArray, height_m: float, turn_rad: float = _APART_RAD) -> npt.NDArray[np.bool_]:
        """Return which places (B,) are about a pose (3,)."""
        apart = np.abs(self._strips.poses - pose)
        turn = np.abs((apart[:, 2] + math.pi) % (2.0 * math.pi) - math.pi)
        level = np.abs(self._strips.heights_m - height_m) < _LEVEL_M
        same: npt.NDArray[np.bool_] = (apart[:, 0] ** 2 + apart[:, 1] ** 2 < _APART_M**2) & (turn < turn_rad) & level
        return same

    def _told(self, place: int, same: npt.NDArray[np.bool_]) -> PlaceOnStrips:
        walls, live = self._map, self._live
        squares, number = _compared(self.path(place), *walls, *live)
        probability = float(self._mass[same].sum()) / self._all_mass
        cost = float(self._costs[place])
        return PlaceOnStrips(place, cost, squares / max(number, 1), number / self._bins, probability)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz", "contract"})
def _add(costs, values, variances, known, evidence, live):  # type: ignore[no-untyped-def]
    """Add to the costs of places (n,) what one channel of a live bin (value, variance, weight) costs there."""
    at, variance, weight = live
    truncated = np.float32(TRUNCATED)
    for b in range(costs.shape[0]):
        d = values[b] - at
        x = known[b] * d * d / (variances[b] + variance)
        costs[b] += weight * (min(x, truncated) - evidence[b])


@nb.njit(cache=True, nogil=True)
def _slide(  # type: ignore[no-untyped-def]
    values, variances, known, evidence, weights, live, live_variances, live_known, starts, before, before_starts
):
    """Return the cost (B,) of each place for the last bin, and which strip each was entered from: (J, S), -1 from outside."""
    count, strips, bins = live.shape[1], len(starts) - 1, values.shape[1]
    old, new = np.zeros(bins, np.float32), np.zeros(bins, np.float32)
    chosen = np.full((count, strips), -1, np.int32)
    for j in range(count):
        for s in range(strips):
            low, high = starts[s], starts[s + 1]
            if j > 0:
                first = np.float32(0.0) if before_starts[s] == before_starts[s + 1] else np.float32(np.inf)
                for k in range(before_starts[s], before_starts[s + 1]):
                    entered = old[starts[before[k] + 1] - 1]
                    if entered < first:
                        first, chosen[j, s] = entered, before[k]
                new[low] = first
                new[low + 1 : high] = old[low : high - 1]
            for c in range(3):
                if not live_known[c, j]:
                    continue
                here = slice(low, high)
                _add(
                    *(new[here], values[c, here], variances[c, here], known[c, here], evidence[c, here]),
                    (live[c, j], live_variances[c, j], weights[c]),
                )
        old, new = new, old
    return old, chosen


@nb.njit(cache=True, nogil=True)
def _path(place, starts, chosen):  # type: ignore[no-untyped-def]
    """Return where each live bin (J,) lies where the last one is at `place`; -1 outside the map."""
    out = np.full(chosen.shape[0], -1, np.int64)
    strip = np.searchsorted(starts, place, side="right") - 1
    b = place
    for j in range(chosen.shape[0] - 1, -1, -1):
        out[j] = b
        if b == starts[strip]:
            strip = chosen[j, strip]
            if strip < 0:
                break
            b = starts[strip + 1]
        b -= 1
    return out


@nb.njit(cache=True, nogil=True)
def _compared(path, values, variances, known, live, live_variances, live_known):  # type: ignore[no-untyped-def]
    """Return the sum of the truncated squares of both walls along a path (J,), and of how many bins."""
    total, number = 0.0, 0
    for j in range(path.shape[0]):
        b = path[j]
        for c in range(2):
            if b >= 0 and live_known[c, j] and known[c, b] > 0.0:
                d = values[c, b] - live[c, j]
                total += min(d * d / (variances[c, b] + live_variances[c, j]), TRUNCATED)
                number += 1
    return total, number

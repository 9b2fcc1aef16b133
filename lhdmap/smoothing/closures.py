"""Loop closures: is a key scan at a place that was seen before, and where exactly?

A candidate is searched widely against the hits of the earlier place, then matched like any scan. It counts when most hits agree
to the scanner's noise, every direction is fixed by the walls (a smooth drift looks the same everywhere), and the next closures
say the same.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.information import marginal_information
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.scan_matching.matching import Hits, Match
from lhdmap.scan_matching.places import Nearby
from lhdmap.scan_matching.scan_points import flattened
from lhdmap.scan_matching.search import SearchGrid
from lhdmap.scan_matching.submap import Submap, unsure
from lhdmap.smoothing.settings import SmoothingSettings

_SUBMAP_KEYS = 5  # keys on either side of the earlier one that make up its surroundings
_SUBMAP_M = 20.0  # ... of travel: keys may be far apart where a place has been seen often
_LEVEL_M, _CLIMB_DRIFT = 1.0, 0.02  # a degree of bias in pitch: levels of a mine are farther apart than that
_CELL_M, _WINDOW_CELLS = 0.04, 512
# One start for each heading: with more, niches that look alike cost a closure here and there (Intel: 396, not 397).
_GRID, _TURN_RAD = SearchGrid(0.15, math.radians(2.5), apart_m=math.inf), math.radians(25.0)
UNLIKE, SMOOTH, ALONE = (
    "the walls are not alike",
    "the walls do not tell one direction",
    "no neighbour says the same",
)
"""Why a place is no closure."""
_MOST_UNEVEN = 10.0  # of the sigmas: noise of straight walls' directions looks like a little information along them


class Closure(NamedTuple):
    """Key `current` seen from key `earlier` (indices): planar pose (3,) and its covariance (3, 3) in the earlier's axes.

    `support`: share of the hits that agree.
    """

    earlier: int
    current: int
    T_earlier_current: FloatArray
    covariance: FloatArray
    support: float = 1.0

    @property
    def sigma_m(self) -> float:
        """Standard deviation in the worse direction of the plane, metres."""
        return math.sqrt(float(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]))


class Refusal(NamedTuple):
    """A place that was looked at and is no closure: both keys (indices), why not, share of hits that agree, deviation (m)."""

    earlier: int
    current: int
    reason: str
    support: float
    sigma_m: float = math.nan


def find_closures(
    keys: list[KeyScan], settings: SmoothingSettings, refused: list[Refusal] | None = None
) -> list[Closure]:
    """Return the closures that neighbours confirm; `refused` receives the others, with what speaks against them.

    The cost grows with the keys, not with their square.
    """
    refused = [] if refused is None else refused
    places = np.array([(*key.pose, float(key.points[:, 2].mean())) for key in keys]).reshape(-1, 4)
    travelled = np.array([key.travelled_m for key in keys])
    found: list[Closure] = []
    nearby = Nearby(places[:, :2], settings.reach_limit_m)
    for current in range(len(keys)):
        closure = _close(keys, places, travelled, nearby, current, settings)
        if isinstance(closure, Closure):
            found.append(closure)
        elif closure is not None:
            refused.append(closure)
    kept = _confirmed(found, keys, settings)
    names = {(one.earlier, one.current) for one in kept}
    alone = [one for one in found if (one.earlier, one.current) not in names]
    refused += [Refusal(one.earlier, one.current, ALONE, one.support, one.sigma_m) for one in alone]
    return kept


def _close(
    keys: list[KeyScan],
    places: FloatArray,
    travelled: FloatArray,
    nearby: Nearby,
    current: int,
    settings: SmoothingSettings,
) -> Closure | Refusal | None:
    """Try the earlier key nearest to this one on its level; `places` (N, 4): poses and heights of the keys' hits."""
    early = int(np.searchsorted(travelled, travelled[current] - settings.apart_m))
    nearby.add_until(early)
    near = nearby.around(current)
    if not len(near):
        return None
    distances = np.hypot(*(places[near, :2] - places[current, :2]).T)
    above_m = np.abs(places[near, 3] - places[current, 3])
    distances[above_m > _LEVEL_M + _CLIMB_DRIFT * (travelled[current] - travelled[near])] = np.inf
    nearest = int(distances.argmin())
    candidate = int(near[nearest])
    reach_m = min(
        settings.reach_m + settings.drift * (travelled[current] - travelled[candidate]), settings.reach_limit_m
    )
    if distances[nearest] > reach_m:
        return None
    predicted = se2.between(places[candidate, :3], places[current, :3])
    result = _found(keys[current], _surroundings(keys, candidate, early), predicted, reach_m)
    if result is None or result.support < settings.min_support:
        return Refusal(candidate, current, UNLIKE, 0.0 if result is None else result.support)
    sigma = 1.0 / np.sqrt(np.maximum(marginal_information(result.information), 1e-12))
    if sigma[:2].max() > min(settings.max_sigma_m, _MOST_UNEVEN * sigma[:2].min()):
        return Refusal(candidate, current, SMOOTH, result.support, float(sigma[:2].max()))
    covariance: FloatArray = np.linalg.inv(result.information).astype(np.float64)
    covariance += np.diag([0.01**2, 0.01**2, math.radians(0.05) ** 2])
    return Closure(candidate, current, result.pose, covariance, result.support)


def _surroundings(keys: list[KeyScan], centre: int, before: int) -> Submap:
    """Return the walls that the keys around `centre` saw, in its frame, without heights; none after key `before`."""
    first, last = max(centre - _SUBMAP_KEYS, 0), min(centre + _SUBMAP_KEYS + 1, before)
    submap = Submap(_CELL_M, grid=_GRID, window_cells=_WINDOW_CELLS)
    for key in keys[first:last]:
        if abs(key.travelled_m - keys[centre].travelled_m) <= _SUBMAP_M:
            submap.insert(flattened(key.points), se2.between(keys[centre].pose, key.pose))
    return submap


def _found(key: KeyScan, submap: Submap, predicted: FloatArray, reach_m: float) -> Match | None:
    """Return where the key is most like the submap, None where it is nowhere."""
    points = flattened(key.points)
    hits = Hits(points, len(points), layered=False)
    return next(iter(submap.locate(hits, unsure(predicted), np.array([reach_m, _TURN_RAD]))), None)


def _confirmed(found: list[Closure], keys: list[KeyScan], settings: SmoothingSettings) -> list[Closure]:
    """Keep closures whose neighbour in the drive moves the odometry by the same."""
    kept = []
    for index, closure in enumerate(found):
        neighbours = found[max(index - 2, 0) : index] + found[index + 1 : index + 3]
        if any(_agree(closure, other, keys, settings) for other in neighbours):
            kept.append(closure)
    return kept


def _agree(a: Closure, b: Closure, keys: list[KeyScan], settings: SmoothingSettings) -> bool:
    """Compare by the loop through both closures and the odometry between their keys: it must end where it began."""
    if abs(keys[a.current].travelled_m - keys[b.current].travelled_m) > 5.0:
        return False
    there = se2.compose(a.T_earlier_current, se2.between(keys[a.current].pose, keys[b.current].pose))
    back = se2.compose(se2.between(keys[a.earlier].pose, keys[b.earlier].pose), b.T_earlier_current)
    gap = se2.between(there, back)
    turn = abs(float(se2.wrap(gap[2])))
    return float(np.hypot(gap[0], gap[1])) < settings.agree_m and turn < math.radians(settings.agree_deg)

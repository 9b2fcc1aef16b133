"""Loop closures: is a key scan at a place that was seen before, and where exactly?

A candidate is searched widely against the hits of the earlier place, then matched like any scan. It counts when most hits agree
to the scanner's noise, every direction is fixed by the walls (a smooth drift looks the same everywhere), no other place that the
odometry allows is as much like it, and the next closures say the same.
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
from lhdmap.smoothing.reach import Drift
from lhdmap.smoothing.settings import SmoothingSettings

_SUBMAP_KEYS = 5  # keys on either side of the earlier one that make up its surroundings
_SUBMAP_M = 20.0  # ... of travel: keys may be far apart where a place has been seen often
_LEVEL_M, _CLIMB_DRIFT = 1.0, 0.02  # a degree of bias in pitch: levels of a mine are farther apart than that
_CELL_M, _WINDOW_CELLS = 0.04, 512
# One start for each heading: with more, niches that look alike cost a closure here and there (Intel: 396, not 397).
_GRID, _TURN_RAD = SearchGrid(0.15, math.radians(2.5), apart_m=math.inf), math.radians(25.0)
_PLACE_M, _MOST_PLACES = 8.0, 8  # of the places that are tried
_AHEAD, _SAME_M = (
    0.08,
    2.0,
)  # share of hits by which the best is ahead of others; as the odometry has two ways to one place
UNLIKE, SMOOTH, ALIKE, ALONE = (
    "the walls are not alike",
    "the walls do not tell one direction",
    "another place is as much like it",
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
    pose_earlier_current: FloatArray
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
    search = _Search(keys, settings)
    found: list[Closure] = []
    for current in range(len(keys)):
        closure = search.close(current)
        if isinstance(closure, Closure):
            found.append(closure)
        elif closure is not None:
            refused.append(closure)
    kept = _confirmed(found, keys, settings)
    names = {(one.earlier, one.current) for one in kept}
    alone = [one for one in found if (one.earlier, one.current) not in names]
    refused += [Refusal(one.earlier, one.current, ALONE, one.support, one.sigma_m) for one in alone]
    return kept


class _Tried(NamedTuple):
    """An earlier key (index) and where the current one is most like the walls around it: None where it is nowhere."""

    earlier: int
    match: Match | None

    @property
    def support(self) -> float:
        """Share of hits that agree."""
        return 0.0 if self.match is None else self.match.support


class _Search:
    """Looks for the earlier place of one key after the other."""

    def __init__(self, keys: list[KeyScan], settings: SmoothingSettings) -> None:
        self._keys, self._settings = keys, settings
        self._places = np.array([(*key.pose, float(key.points[:, 2].mean())) for key in keys]).reshape(-1, 4)
        self._travelled = np.array([key.travelled_m for key in keys])
        self._drift = Drift(keys, settings)
        self._nearby = Nearby(self._places[:, :2], max(settings.reach_limit_m, self._drift.most_m))

    def close(self, current: int) -> Closure | Refusal | None:
        """Try the earlier keys on this one's level: the nearest, and one of each other place that the odometry allows."""
        early = int(np.searchsorted(self._travelled, self._travelled[current] - self._settings.apart_m))
        self._nearby.add_until(early)
        tried = [_Tried(one, self._found(current, one, early)) for one in self._candidates(current)]
        if not tried:
            return None
        best = max(tried, key=lambda one: one.support)
        if best.match is None or best.support < self._settings.min_support:
            return Refusal(best.earlier, current, UNLIKE, best.support)
        sigma = 1.0 / np.sqrt(np.maximum(marginal_information(best.match.information), 1e-12))
        if sigma[:2].max() > min(self._settings.max_sigma_m, _MOST_UNEVEN * sigma[:2].min()):
            return Refusal(best.earlier, current, SMOOTH, best.support, float(sigma[:2].max()))
        if any(self._rivals(best, other) for other in tried):
            return Refusal(best.earlier, current, ALIKE, best.support, float(sigma[:2].max()))
        covariance: FloatArray = np.linalg.inv(best.match.information).astype(np.float64)
        covariance += np.diag([0.01**2, 0.01**2, math.radians(0.05) ** 2])
        return Closure(best.earlier, current, best.match.pose, covariance, best.support)

    def _candidates(self, current: int) -> list[int]:
        """Return the earlier keys to try, the nearest first; none where no place is within reach."""
        near = self._nearby.around(current)
        distances = np.hypot(*(self._places[near, :2] - self._places[current, :2]).T)
        way_m = self._travelled[current] - self._travelled[near]
        level = np.abs(self._places[near, 3] - self._places[current, 3]) <= _LEVEL_M + _CLIMB_DRIFT * way_m
        within = level & (distances <= np.maximum(self._reach_m(way_m), self._drift.radius_m(near, current)))
        order = near[within][np.argsort(distances[within], kind="stable")]
        chosen: list[int] = []
        while len(order) and len(chosen) < _MOST_PLACES:
            chosen.append(int(order[0]))
            order = order[np.hypot(*(self._places[order, :2] - self._places[chosen[-1], :2]).T) > _PLACE_M]
        return chosen

    def _reach_m(self, way_m: FloatArray) -> FloatArray:
        s = self._settings
        return np.minimum(s.reach_m + s.drift * way_m, s.reach_limit_m)

    def _found(self, current: int, candidate: int, early: int) -> Match | None:
        """Return where the key is most like the walls around an earlier one, None where it is nowhere."""
        submap = _surroundings(self._keys, candidate, early)
        points = flattened(self._keys[current].points)
        predicted = se2.between(self._places[candidate, :3], self._places[current, :3])
        reach_m = float(self._reach_m(self._travelled[current] - self._travelled[candidate]))
        if math.hypot(predicted[0], predicted[1]) > reach_m:
            predicted[:2], reach_m = (
                0.0,
                min(reach_m, 0.5 * _PLACE_M),
            )  # the odometry may be off by more: the place as it is
        hits = Hits(points, len(points), layered=False)
        return next(iter(submap.locate(hits, unsure(predicted), np.array([reach_m, _TURN_RAD]))), None)

    def _rivals(self, best: _Tried, other: _Tried) -> bool:
        """Return whether another place is about as much like the key."""
        if best.match is None or other.match is None or other.support <= best.support - _AHEAD:
            return False
        here, there = (se2.compose(self._places[one.earlier, :3], one.match.pose) for one in (best, other) if one.match)
        return math.hypot(*(here - there)[:2]) > _SAME_M


def _surroundings(keys: list[KeyScan], centre: int, before: int) -> Submap:
    """Return the walls that the keys around `centre` saw, in its frame, without heights; none after key `before`."""
    first, last = max(centre - _SUBMAP_KEYS, 0), min(centre + _SUBMAP_KEYS + 1, before)
    submap = Submap(_CELL_M, grid=_GRID, window_cells=_WINDOW_CELLS)
    for key in keys[first:last]:
        if abs(key.travelled_m - keys[centre].travelled_m) <= _SUBMAP_M:
            submap.insert(flattened(key.points), se2.between(keys[centre].pose, key.pose))
    return submap


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
    there = se2.compose(a.pose_earlier_current, se2.between(keys[a.current].pose, keys[b.current].pose))
    back = se2.compose(se2.between(keys[a.earlier].pose, keys[b.earlier].pose), b.pose_earlier_current)
    gap = se2.between(there, back)
    turn = abs(float(se2.wrap(gap[2])))
    return float(np.hypot(gap[0], gap[1])) < settings.agree_m and turn < math.radians(settings.agree_deg)

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
from lhdmap.odometry.matching import Hits, Match, MatchModel, Prior, match
from lhdmap.odometry.search import search
from lhdmap.odometry.steps import marginal_information
from lhdmap.odometry.surface_map import SurfaceMap, empty_map, insert_all
from lhdmap.smoothing.keys import KeyScan
from lhdmap.smoothing.places import Nearby
from lhdmap.smoothing.settings import SmoothingSettings

_SUBMAP_KEYS = 5  # keys on either side of the earlier one that make up its surroundings
_SUBMAP_M = 20.0  # ... of travel: keys may be far apart where a place has been seen often
_SEARCH_BEAMS = 120
_LEVEL_M, _CLIMB_DRIFT = 1.0, 0.02  # a degree of bias in pitch: levels of a mine are farther apart than that
_CELL_M = 0.04
_MODEL = MatchModel(noise_m=0.02, cutoff_sigmas=3.0, min_cells=3.0, coarse_noise=0.05, rounds=8)
_STARTS = 3
_MOST_UNEVEN = 10.0  # of the sigmas: noise of straight walls' directions looks like a little information along them


class Closure(NamedTuple):
    """Key `current` seen from key `earlier` (indices): planar pose (3,) and its covariance (3, 3) in the earlier's axes."""

    earlier: int
    current: int
    T_earlier_current: FloatArray
    covariance: FloatArray


def find_closures(keys: list[KeyScan], settings: SmoothingSettings) -> list[Closure]:
    """Return the closures that neighbours confirm. The cost grows with the keys, not with their square."""
    places = np.array([(*key.pose, float(key.points[:, 2].mean())) for key in keys]).reshape(-1, 4)
    travelled = np.array([key.travelled_m for key in keys])
    found: list[Closure] = []
    nearby = Nearby(places[:, :2], settings.reach_limit_m)
    for current in range(len(keys)):
        closure = _close(keys, places, travelled, nearby, current, settings)
        if closure is not None:
            found.append(closure)
    return _confirmed(found, keys, settings)


def _close(
    keys: list[KeyScan],
    places: FloatArray,
    travelled: FloatArray,
    nearby: Nearby,
    current: int,
    settings: SmoothingSettings,
) -> Closure | None:
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
    surroundings = _surroundings(keys, candidate, early)
    predicted = se2.between(places[candidate, :3], places[current, :3])
    result = _match(keys[current], surroundings, predicted, reach_m)
    if result.support < settings.min_support:
        return None
    sigma = 1.0 / np.sqrt(np.maximum(marginal_information(result.information), 1e-12))
    if sigma[:2].max() > min(settings.max_sigma_m, _MOST_UNEVEN * sigma[:2].min()):
        return None
    covariance: FloatArray = np.linalg.inv(result.information).astype(np.float64)
    covariance += np.diag([0.01**2, 0.01**2, math.radians(0.05) ** 2])
    return Closure(candidate, current, result.pose, covariance)


def _surroundings(keys: list[KeyScan], centre: int, before: int) -> FloatArray:
    """Return the hits of the keys around `centre`, shape (M, 3), in its frame; none after key `before`."""
    first, last = max(centre - _SUBMAP_KEYS, 0), min(centre + _SUBMAP_KEYS + 1, before)
    parts = [
        se2.transform(se2.between(keys[centre].pose, key.pose), key.points.astype(np.float64))
        for key in keys[first:last]
        if abs(key.travelled_m - keys[centre].travelled_m) <= _SUBMAP_M
    ]
    return np.concatenate(parts)


def _match(key: KeyScan, surroundings: FloatArray, predicted: FloatArray, reach_m: float) -> Match:
    points = key.points.astype(np.float64)
    points[:, 2] = 0.0  # heights of two visits differ by the drift of the height
    flat = surroundings.copy()
    flat[:, 2] = 0.0
    place: SurfaceMap = empty_map(_CELL_M, 512)
    insert_all(place, flat, 50.0)
    no_prior = np.diag([1e-2, 1e-2, 1e-1])
    thin = points[:: max(len(points) // _SEARCH_BEAMS, 1)]
    reach = np.array([reach_m, math.radians(25.0)])
    starts = search(flat, thin, predicted, no_prior, reach, 0.15, math.radians(2.5))
    usable = [start for start in starts if (np.abs(start) < 1e29).all()][:_STARTS] or [predicted]
    hits = Hits(points, len(points), layered=False)
    tried = [match(place, hits, Prior(start, no_prior), start, _MODEL) for start in usable]
    return max(tried, key=lambda one: one.support)


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

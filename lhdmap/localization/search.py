"""Where on the whole map: the wall profile of the last metres is laid over all ways through it (`lhdmap.localization.placing`).

The best place is believed when the next one, or a tunnel that is not in the map, is less likely by a gap over the reduced χ²
(the variances are too sure beside niches and bends). Then it is refined against the fused walls. It counts once a tracker that was
started there has kept its support for some metres, and a second search says the same.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.geometry import se2
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.localization.placing import Costs, LiveProfile, PlaceOnStrips
from lhdmap.localization.recent_way import RecentWindow
from lhdmap.localization.settings import LocalizationSettings
from lhdmap.localization.strips import Strips
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.matching import Hits, Match, Prior, match
from lhdmap.scan_matching.submap import OTHER_VISIT
from lhdmap.scan_matching.surface_map import SurfaceMap

_AROUND = [(x, y, math.radians(turn)) for x in (-0.4, 0.0, 0.4) for y in (-0.5, 0.0, 0.5) for turn in (-7.0, 0.0, 7.0)]
"""Of the profile's place in bends, measured: it may be 0.3 m off across and 5 degrees in heading."""
_FEW_HITS, _HITS = 150, 600
_PROFILE_STD = np.array([0.1, 0.3, math.radians(3.0)])
"""Of the profile's place, measured: along smooth walls it is far better than a match of hits."""
_LAID_M = 6.0  # of the mid line to each side of the machine
_KAPPA = 10.0  # hits that are neighbours share the map's errors
_LEAST_COMPARED = 0.5
_SAME_M, _SAME_RAD = 1.0, math.radians(10.0)

FIND, CONFIRM, CHECK = "find", "confirm", "check"


class PlaceCandidate(NamedTuple):
    """A place where the machine may be: pose (3,) in `map`, height of the floor, node (id).

    `probability`: of it against all others and against not being in the map; `chi2`: reduced, of its walls; `evidence` (nats):
    what its walls tell for it, against other ones of the kind; `gap` (nats): how much less likely the best other place is, or
    none in the map, negative where that is better; `support`: share of hits that agree with the fused walls once refined, NaN
    where it was not.
    """

    pose: FloatArray
    height_m: float
    node: str
    probability: float
    chi2: float
    evidence: float
    gap: float
    support: float


class Search(NamedTuple):
    """What one search said, at `stamp_ns` after `travelled_m`, of the walls of the last `window_m`.

    `purpose`: `find` a place, `confirm` the one on trial, `check` the one that is tracked. `candidates`: best first. `refused`:
    why the best one is not believed, empty where it is. `claimed`: what it said of the place that is on trial or tracked;
    `denied`: why the machine is not there, empty where it may be.
    """

    stamp_ns: int
    travelled_m: float
    window_m: float
    purpose: str
    candidates: tuple[PlaceCandidate, ...]
    refused: str
    claimed: PlaceCandidate | None = None
    denied: str = ""

    @property
    def confirms(self) -> bool:
        """Whether it believes in the place that was claimed, or cannot tell of any."""
        return not self.candidates or not (self.refused or self.denied)


class Question(NamedTuple):
    """What a search is asked: purpose, last walls, pose (3,) in `odom`; `claimed` (4,): x, y, yaw, height in `map`."""

    stamp_ns: int
    travelled_m: float
    purpose: str
    window: RecentWindow
    pose_odom_base: FloatArray
    claimed: FloatArray | None


class GlobalSearch:
    """Searches the strips of a map."""

    def __init__(
        self, strips: Strips, walls: MapWalls, settings: LocalizationSettings, landmarks: LandmarkSettings
    ) -> None:
        self._strips, self._walls, self._settings, self._landmarks = strips, walls, settings, landmarks
        self._weights = np.array([1.0, 1.0, landmarks.profile_m / landmarks.smooth_m])

    def answer(self, asked: Question) -> Search:
        """Search the whole map."""
        window, said = asked.window, Search(*asked[:2], asked.window.length_m, asked.purpose, (), "no walls in reach")
        live = window.profile(self._landmarks, self._strips.noise)
        if not len(self._strips.poses) or not np.isfinite(live.values[:2]).any():
            return said
        costs = Costs(self._strips, live, self._weights)
        places = costs.likeliest()
        rivals = [min([0.0, *(other.cost for other in places if other is not one)]) for one in places]
        candidates = [
            self._candidate(one, rival - one.cost, self._machine(costs.path(one.place), live, asked.pose_odom_base))
            for one, rival in zip(places, rivals, strict=True)
        ]
        refused = self._refused(places[0], candidates[0], asked)
        if not refused:
            candidates[0] = self._refined(candidates[0], window, asked.pose_odom_base)
        said = said._replace(candidates=tuple(candidates), refused=refused)
        return said if asked.claimed is None else self._judged(said, costs, asked.claimed, asked, live)

    def _judged(self, said: Search, costs: Costs, claimed: FloatArray, asked: Question, live: LiveProfile) -> Search:
        """Add what is said of a place (4,) that is claimed."""
        best, own = said.candidates[0], None
        pose_map_odom = se2.compose(claimed[:3], se2.inverse(asked.pose_odom_base))
        ahead = live.line[-1] - live.line[-2]
        line = np.array([*live.line[-1], math.atan2(ahead[1], ahead[0])])
        place = costs.at(se2.compose(pose_map_odom, line), claimed[3])
        denied = ""
        if place is not None:
            own = self._candidate(place, min(-best.evidence, 0.0) - place.cost, claimed[:3])
            if own.evidence < -self._settings.gap and place.compared >= _LEAST_COMPARED:
                denied = f"other walls than there, {-own.evidence:.0f} nats"
        off = se2.between(claimed[:3], best.pose)
        if not said.refused and (math.hypot(off[0], off[1]) > _SAME_M or abs(off[2]) > _SAME_RAD):
            denied = f"it is at {best.pose[0]:.1f}, {best.pose[1]:.1f}"
        return said._replace(claimed=own, denied=denied)

    def _machine(self, path: npt.NDArray[np.int64], live: LiveProfile, pose_odom_base: FloatArray) -> FloatArray:
        """Return the machine's pose (3,) in `map`: the mid line about it is laid onto that of the path (J,), rigidly."""
        apart = np.hypot(*(live.line - pose_odom_base[:2]).T)
        near = (path >= 0) & (apart <= max(_LAID_M, float(apart[path >= 0].min()) + _LAID_M))
        pose_map_odom = _laid(live.line[near], self._strips.poses[path[near], :2])
        pose: FloatArray = se2.compose(pose_map_odom, pose_odom_base)
        return pose

    def _candidate(self, place: PlaceOnStrips, gap: float, pose: FloatArray) -> PlaceCandidate:
        height, node = float(self._strips.heights_m[place.place]), self._strips.node_at(place.place)
        return PlaceCandidate(pose, height, node, place.probability, place.chi2, -place.cost, gap, math.nan)

    def _refused(self, place: PlaceOnStrips, best: PlaceCandidate, asked: Question) -> str:
        """Return why the best place is not believed; one that was found by the whole rule is confirmed by the gap alone."""
        window_m = asked.window.length_m
        if window_m < self._settings.search_m:
            return f"{window_m:.1f} m of way are too few"
        if place.compared < _LEAST_COMPARED:
            return f"{place.compared:.0%} of the walls are in the map"
        told = best.gap if asked.purpose == CONFIRM else best.gap / max(best.chi2, 1.0)
        if told <= self._settings.gap:
            return f"the next place is less likely by {told:.0f} of {self._settings.gap:.0f} nats"
        return ""

    def _refined(self, found: PlaceCandidate, window: RecentWindow, pose_odom_base: FloatArray) -> PlaceCandidate:
        """Match the walls about the machine as one scan, from several starts around a place."""
        local = se2.transform(se2.inverse(pose_odom_base), window.points)
        near = local[np.hypot(local[:, 0], local[:, 1]) < self._settings.range_m]
        walls, origin = self._walls.around(np.array([*found.pose[:2], found.height_m]))
        shift = np.array([origin[0], origin[1], 0.0])
        prior = _prior(found.pose - shift)
        coarse = _matched(walls, near[:: max(len(near) // _FEW_HITS, 1)], prior, found.pose - shift, _AROUND)
        best = _matched(walls, near[:: max(len(near) // _HITS, 1)], prior, coarse.pose, [(0.0, 0.0, 0.0)])
        return found._replace(pose=best.pose + shift, support=float(best.support))


def _laid(points: FloatArray, onto: FloatArray) -> FloatArray:
    """Return the rigid motion (3,) that lays points (N, 2) onto others, least squares."""
    middle, target = points.mean(axis=0), onto.mean(axis=0)
    (x, y), (u, v) = (points - middle).T, (onto - target).T
    turn = math.atan2(float((x * v - y * u).sum()), float((x * u + y * v).sum()))
    c, s = math.cos(turn), math.sin(turn)
    return np.array([target[0] - c * middle[0] + s * middle[1], target[1] - s * middle[0] - c * middle[1], turn])


def _prior(pose: FloatArray) -> Prior:
    """Return how well the profile knows a pose (3,), against hits that are taken for independent."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Prior(pose, R @ np.diag(_KAPPA / _PROFILE_STD**2) @ R.T)


def _matched(
    walls: SurfaceMap, points: FloatArray, prior: Prior, pose: FloatArray, starts: list[tuple[float, float, float]]
) -> Match:
    """Return the best of the matches of points (N, 2) from starts (x, y, turn in the machine's axes) about a pose (3,)."""
    hits = Hits(np.column_stack([points, np.zeros(len(points))]), len(points), layered=False)
    found = []
    for offset in starts:
        start = se2.compose(pose, np.array(offset))
        found.append(match(walls, hits, prior, start, OTHER_VISIT))
    best: Match = max(found, key=lambda one: one.support)
    return best

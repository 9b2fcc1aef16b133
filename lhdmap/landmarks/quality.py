"""How well a node's own scans fit its fused walls: what localization compares a live scan with.

* support: share of hits that agree, of the node's scans matched at their own poses; mean, and the least (5th percentile).
* kappa: what the information of a match is to be divided by, as neighbouring hits share the map's errors. The larger of two: what
  the scale of the map asks for (measured with a second drive: 3 at 0.1 %, 10 at 0.5 %), and the mean squared deviation of scans
  from their poses over its stated variance, matched with walls that they had no part in.
* scale: by how much poses near each other are stretched against the scans. Matched with what lies ahead of it alone, a scan of a
  stretched map moves ahead, with what lies behind it alone, back: half the difference over the mean distance of these hits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.landmarks.scans import NodeScan, in_node, near
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.landmarks.surface import Cells, fused, most_reach_m, placed, surface_map
from lhdmap.messages import FloatArray
from lhdmap.scan_matching.information import body_information, marginal_information
from lhdmap.scan_matching.matching import Hits, Match, Prior, match
from lhdmap.scan_matching.submap import OTHER_VISIT
from lhdmap.scan_matching.surface_map import SurfaceMap, empty_map

KAPPA_SCALES, KAPPAS = (0.001, 0.005, 0.05), (3.0, 10.0, 100.0)
_SCANS, _HITS = 60, 400
_PRIOR = np.diag([1.0 / 0.3**2, 1.0 / 0.3**2, 1.0 / math.radians(2.0) ** 2])
_PART_M = 40.0
_LEAST_SCANS = 4


class Quality(NamedTuple):
    """Of a node, NaN where not measured.

    `support`, `support_least`: shares; `along_m`: standard deviation along the machine that a match states, median; `scale`: 0 is
    right, with its standard deviation. `chi2`: reduced, of the profile of one half of a tunnel's scans against that of the other.
    """

    support: float
    support_least: float
    residual_sigmas: float
    along_m: float
    kappa: float
    scale: float
    scale_std: float
    chi2: float = math.nan


UNMEASURED = Quality(math.nan, math.nan, math.nan, math.nan, 10.0, math.nan, math.nan)
"""Of a node with too few scans; kappa is that of a map whose local scale is off by half a per cent."""


def quality_of(
    cells: Cells, scans: Sequence[NodeScan], pose_map_node: FloatArray, settings: LandmarkSettings
) -> Quality:
    """Return how well scans, in order along the node, fit its walls; of 60 of them at most."""
    if len(scans) < _LEAST_SCANS:
        return UNMEASURED
    chosen = sorted({int(k) for k in np.linspace(0, len(scans) - 1, _SCANS)})
    walls = _Walls(cells, settings)
    whole = [_matched(walls, scans[k], pose_map_node, settings) for k in chosen]
    halves = [
        _Walls(fused([placed(scan, pose_map_node, settings) for scan in scans[k::2]], settings.cell_m), settings)
        for k in (0, 1)
    ]
    apart = [_deviation(halves[1 - k % 2], scans[k], pose_map_node, settings) for k in chosen]
    support = np.array([one.support for one in whole])
    scale, scale_std = _scale(walls, _inner([scans[k] for k in chosen], settings), pose_map_node, settings)
    return Quality(
        float(support.mean()),
        float(np.percentile(support, 5.0)),
        float(np.mean([one.residual_sigmas for one in whole])),
        float(np.median([_along_m(one) for one in whole])),
        max(float(np.nanmean(apart)), _kappa_of(scale)),
        scale,
        scale_std,
    )


class _Walls:
    """The walls of a node, as maps of its parts: one at a time, as scans in order ask for them."""

    def __init__(self, cells: Cells, settings: LandmarkSettings) -> None:
        self._cells = cells
        self._reach_m = min(0.5 * _PART_M + settings.surface_range_m + 2.0, most_reach_m(cells.cell_m))
        self._part: tuple[int, int] | None = None
        self._map = empty_map(cells.cell_m, 8)

    def about(self, pose: FloatArray) -> SurfaceMap:
        """Return a map of all that is in reach of a pose (3,)."""
        part = (round(pose[0] / _PART_M), round(pose[1] / _PART_M))
        if part != self._part:
            self._part = part
            self._map = surface_map(self._cells, _PART_M * np.array(part), self._reach_m)
        return self._map


def _kappa_of(scale: float) -> float:
    """Return what the scale of a map asks for; where it is not known, what one of half a per cent does."""
    return float(np.interp(0.005 if math.isnan(scale) else abs(scale), KAPPA_SCALES, KAPPAS))


def _matched(
    walls: _Walls, scan: NodeScan, pose_map_node: FloatArray, settings: LandmarkSettings, side: int = 0
) -> Match:
    """Return the match of a scan with the walls from its own pose; `side`: 1 its hits ahead alone, -1 those behind."""
    pose, points = in_node(scan, pose_map_node), near(scan.points_m, settings.surface_range_m, settings.centre_m)
    if side:
        points = points[side * (points[:, 0] - settings.centre_m) > 0.0]
    points = points[:: max(len(points) // _HITS, 1)]
    hits = Hits(np.column_stack([points, np.zeros(len(points))]), len(points), layered=False)
    return match(walls.about(pose), hits, Prior(pose, _PRIOR), pose, OTHER_VISIT)


def _deviation(walls: _Walls, scan: NodeScan, pose_map_node: FloatArray, settings: LandmarkSettings) -> float:
    """Return the squared deviation of a match along and across from the scan's pose, over its stated variance; mean of both."""
    found, pose = _matched(walls, scan, pose_map_node, settings), in_node(scan, pose_map_node)
    off = se2.between(pose, found.pose)
    information = marginal_information(body_information(found.information, pose[2]) + _PRIOR)
    return float(np.mean(off[:2] ** 2 * information[:2]))


def _inner(scans: Sequence[NodeScan], settings: LandmarkSettings) -> Sequence[NodeScan]:
    """Return the scans whose walls were seen from both sides; all of them where the node is too short."""
    first, last = scans[0].at_m + settings.surface_range_m, scans[-1].at_m - settings.surface_range_m
    inner = [scan for scan in scans if first <= scan.at_m <= last]
    return inner if len(inner) >= _LEAST_SCANS else scans


def _along_m(found: Match) -> float:
    """Return the standard deviation along the machine that a match states, m."""
    return float(marginal_information(body_information(found.information, found.pose[2]))[0] + 1e-9) ** -0.5


def _scale(
    walls: _Walls, scans: Sequence[NodeScan], pose_map_node: FloatArray, settings: LandmarkSettings
) -> tuple[float, float]:
    """Return by how much the map is stretched near each scan (0: not), and the deviation of that."""
    values, weights = [], []
    for scan in scans:
        pose = in_node(scan, pose_map_node)
        found = [_matched(walls, scan, pose_map_node, settings, side) for side in (1, -1)]
        distances = [_reach(one, pose) for one in found]
        shifts = [se2.between(pose, one.pose)[0] for one in found]
        information = [body_information(one.information, pose[2])[0, 0] for one in found]
        if min(distances) > 1.0 and min(information) > 0.0:
            apart = sum(distances)
            values.append((shifts[0] - shifts[1]) / apart)
            weights.append(apart**2 / sum(1.0 / one for one in information))
    if len(values) < _LEAST_SCANS:
        return math.nan, math.nan
    each, weight = np.array(values), np.array(weights)
    mean = float(np.average(each, weights=weight))
    spread = float(np.average((each - mean) ** 2, weights=weight))
    return mean, math.sqrt(spread / len(each))


def _reach(found: Match, pose: FloatArray) -> float:
    """Return how far from the machine the walls are that hold a match along its axis, m."""
    lines = found.lines[found.lines[:, 6] > 0.0]
    along = (lines[:, 2] * math.cos(pose[2]) + lines[:, 3] * math.sin(pose[2])) ** 2 / (lines[:, 4] + 1e-4)
    ahead = (lines[:, 0] - pose[0]) * math.cos(pose[2]) + (lines[:, 1] - pose[1]) * math.sin(pose[2])
    return float(np.average(np.abs(ahead), weights=along)) if along.sum() > 0.0 else 0.0

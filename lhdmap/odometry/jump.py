"""Where a scan fits elsewhere than foretold: a search all around the prediction, and the odds for a jump against the wheels."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.motion import Motion
from lhdmap.odometry.settings import SearchSettings
from lhdmap.scan_matching.matching import Hits, Match, MatchModel, Prior, match
from lhdmap.scan_matching.search import search
from lhdmap.scan_matching.surface_map import SurfaceMap

_JUMP_PRIOR = 0.01
# A jump must bring that much more support, and more where wheels speak against it: the logarithm of the odds (Student's t, for
# wheels that slip or lag) over the nats that support is worth. Measured: crowds win by chance with more, slip stays with less.
NOTHING_OWED = np.zeros(3)
_GAIN, _NATS_PER_SUPPORT, _WHEELS_FREEDOM = 0.02, 22.0, 4.0


class Place(NamedTuple):
    """What a scan is compared with: the map, the hits (N, 3) of the last scans in it, and the model of the match."""

    walls: SurfaceMap
    seen: FloatArray
    model: MatchModel


def jump(
    place: Place,
    hits: Hits,
    near: Match,
    prior: Prior,
    motion: Motion,
    s: SearchSettings,
    owed: FloatArray = NOTHING_OWED,
) -> Match | None:
    """Return the best match from all around the prediction, None where none is better enough than the one near it.

    Args:
        place: the map that is matched against, and what the search compares with.
        hits: the scan.
        near: the match that was found from the prediction.
        prior: the prediction.
        motion: tells how far to search, and whether wheels have measured.
        s: limits and steps of the search.
        owed: by how much jumps a moment ago left the motion (3,): wheels speak against staying there, and for the way back.
    """
    points = hits.points[: hits.front]
    thin = points[:: max(len(points) // s.beams, 1)]
    starts = search(
        place.seen, thin, prior.pose, prior.information, _reach(motion, s), s.cell_m, math.radians(s.step_deg)
    )
    best = near
    # A jump contradicts the prior by definition: it must not hold the match back, so it is weakened here.
    for start in starts[(np.abs(starts) < 1e29).all(axis=1)]:
        found = match(place.walls, hits, weakened(prior), start, place.model)
        dissent = _dissent(found, prior, motion, owed) - _dissent(best, prior, motion, owed)
        if found.support > best.support + _GAIN + dissent / _NATS_PER_SUPPORT:
            best = found
    return None if best is near else best


def left_by(result: Match, prior: Prior) -> FloatArray:
    """Return by how much a match is off the motion, shape (3,)."""
    error: FloatArray = result.pose - prior.pose
    error[2] = se2.wrap(error[2])
    return error


def weakened(prior: Prior) -> Prior:
    """Return a prior that holds a match back only where the scan says nothing."""
    return Prior(prior.pose, _JUMP_PRIOR * prior.information)


def _dissent(result: Match, prior: Prior, motion: Motion, owed: FloatArray) -> float:
    """Return how much (nats) the wheels speak against a pose: with slip and lag, large errors are likelier than normal."""
    if not motion.measured:
        return 0.0
    error = left_by(result, prior) + owed
    return 0.5 * _WHEELS_FREEDOM * math.log1p(float(error @ prior.information @ error) / _WHEELS_FREEDOM)


def _reach(motion: Motion, s: SearchSettings) -> FloatArray:
    """Return how far to search: three sigmas of the prediction within the settings' limits, metres and radians.

    After a gap the wheels' pose may be an old one: all that the settings allow is searched.
    """
    sigma = np.sqrt(np.diag(motion.P)[:3])
    widest = s.reach_m, math.radians(s.turn_deg)
    if motion.after_gap:
        return np.array(widest)
    shift = min(max(3.0 * float(sigma[:2].max()), 0.3), widest[0])
    return np.array([shift, min(max(3.0 * float(sigma[2]), math.radians(20.0)), widest[1])])

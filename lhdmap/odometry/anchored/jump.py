"""Where a scan fits elsewhere than predicted: what is found all around the prediction, and the odds for it against the wheels."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.odometry.anchored.state import NO_OFFSET
from lhdmap.odometry.motion import PlanarMotion
from lhdmap.odometry.settings import SearchSettings
from lhdmap.odometry.wheels.model import WheelModel
from lhdmap.scan_matching.matching import Hits, Match, Prior
from lhdmap.scan_matching.submap import Submap

# A jump must bring that much more support, and more where wheels speak against it: the log-odds over the nats that support is
# worth. Measured: crowds win by chance with more, slip stays with less.
_GAIN, _NATS_PER_SUPPORT = 0.02, 22.0
_REACH_SIGMAS = 3.0  # of the prediction: how far to search
# ... but so far at least: a prediction that has just failed is worse than it says.
_LEAST_REACH_M, _LEAST_TURN_RAD = 0.3, math.radians(20.0)


def jump(
    submap: Submap,
    hits: Hits,
    near: Match,
    prior: Prior,
    motion: PlanarMotion,
    wheels: WheelModel,
    s: SearchSettings,
    offset: FloatArray = NO_OFFSET,
) -> Match | None:
    """Return the best match from all around the prediction, None where none is better enough than the one near it.

    Args:
        submap: the map that is matched against.
        hits: the scan.
        near: the match that was found from the prediction.
        prior: the prediction.
        motion: tells how far to search.
        wheels: tell how much they speak against a pose.
        s: limits of the search.
        offset: by how much jumps a moment ago left the motion (3,): wheels speak against staying there, and for going back.
    """
    best = near
    for found in submap.candidates(hits, prior, _reach(motion, s)):
        log_odds = _log_odds_against(found, prior, wheels, offset) - _log_odds_against(best, prior, wheels, offset)
        if found.support > best.support + _GAIN + log_odds / _NATS_PER_SUPPORT:
            best = found
    return None if best is near else best


def offset_of(result: Match, prior: Prior) -> FloatArray:
    """Return by how much a match is off the motion, shape (3,)."""
    error: FloatArray = result.pose - prior.pose
    error[2] = se2.wrap(error[2])
    return error


def _log_odds_against(result: Match, prior: Prior, wheels: WheelModel, offset: FloatArray) -> float:
    """Return how much (nats) the wheels speak against a pose."""
    return wheels.log_odds_against(offset_of(result, prior) + offset, prior.information)


def _reach(motion: PlanarMotion, s: SearchSettings) -> FloatArray:
    """Return how far to search: three sigmas of the prediction within the settings' limits, metres and radians.

    After a gap the wheels' pose may be an old one: all that the settings allow is searched.
    """
    sigma = np.sqrt(np.diag(motion.P)[:3])
    widest = s.reach_m, math.radians(s.turn_deg)
    if motion.after_gap:
        return np.array(widest)
    shift = min(max(_REACH_SIGMAS * float(sigma[:2].max()), _LEAST_REACH_M), widest[0])
    return np.array([shift, min(max(_REACH_SIGMAS * float(sigma[2]), _LEAST_TURN_RAD), widest[1])])

"""Scan to map: Gauss-Newton on the distances of scan points to the walls' lines, with the motion's prediction as a prior."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.scan_matching.equations import normal_equations, solve3
from lhdmap.scan_matching.surface_map import LINE
from lhdmap.scan_matching.wall_lines import lines_at

# Finest cells that a pose may move before lines are fitted anew. Where the walls hold: measured, no loss, half the time. Where
# they hardly do, one step corrects only a part of an error along them, and what pulls towards standing still adds up. There lines
# are wide, too: the direction of a short one is mostly noise, and noise that the map keeps holds the pose where it is.
_LINES_HOLD, _WEAK_LINES_HOLD = 0.3, 0.03
_WEAK_M = 0.003  # deviation of a match in its worse direction from which walls hardly hold
_SMOOTH_RATIO = 8.0  # of both deviations: rough walls give 2, moderate ones 4, smooth ones 10, a coarse scanner 1
NO_SLANTS = np.zeros((0, 2))


class MatchModel(NamedTuple):
    """How far a hit may be from the wall's line: see `AnchorSettings` and `OdometrySettings` for the units."""

    noise_m: float
    cutoff_sigmas: float
    min_cells: float
    coarse_noise: float
    rounds: int
    lean: float = 0.0
    lean_patch_m: float = 2.0


class Hits(NamedTuple):
    """Points (N, 3) in the level base frame, heights absolute; `front`: how many come from the front scanner, which are first.

    `layered`: the scanner tilts, heights matter; `slants` (N, 2) of `lhdmap.scan_matching.slant`, or none. Other scanners'
    hits help to place the scan; how well it fits is judged by the front one's alone.
    """

    points: FloatArray
    front: int
    layered: bool
    slants: FloatArray = NO_SLANTS


class Prior(NamedTuple):
    """What is known before the match: mean pose (3,) and information (3, 3)."""

    pose: FloatArray
    information: FloatArray


class Match(NamedTuple):
    """Result: `pose` (3,), `information` (3, 3) of the scan alone in map axes, share of hits with a line, share that agrees.

    `lines` (N, LINE): the wall at each hit, columns as in `surface_map`.
    `smooth`: the walls hardly hold one direction, so lines were wide.
    """

    pose: FloatArray
    information: FloatArray
    covered: float
    support: float
    residual_sigmas: float
    lines: FloatArray
    smooth: bool


@nb.njit(cache=True, nogil=True, inline="always")
def _held(H):  # type: ignore[no-untyped-def]
    """Return the information (1/m²) of H (3, 3) along its worse and its better direction of the plane."""
    half, difference = 0.5 * (H[0, 0] + H[1, 1]), 0.5 * (H[0, 0] - H[1, 1])
    root = math.sqrt(difference * difference + H[0, 1] * H[0, 1])
    return half - root, half + root


@nb.njit(cache=True, nogil=True)
def match(map_, hits, prior, start, model):  # type: ignore[no-untyped-def]
    """Return the `Match` of `hits` with the map: maximum a posteriori from `start` (3,) under the `Prior`.

    Lines are fitted anew when the pose has moved.
    """
    pose = start.copy()
    lines = np.zeros((hits.points.shape[0], LINE))
    H, b = np.zeros((3, 3)), np.zeros(3)
    fine_m = map_.fine.cell_m
    found, wide = 0, False
    for _ in range(model.rounds):
        found = lines_at(map_, pose, hits, model, wide, lines)
        moved = 0.0
        for _ in range(3):
            normal_equations(pose, hits, lines, fine_m, model, H, b)
            step = solve3(H + prior.information, b + prior.information @ (prior.pose - pose))
            pose += step
            size = abs(step[0]) + abs(step[1]) + 5.0 * abs(step[2])
            moved += size
            if size < 2e-5:
                break
        worse, better = _held(H)
        weak = worse < 1.0 / _WEAK_M**2
        if weak and not wide and worse * _SMOOTH_RATIO**2 < better:
            wide = True
        elif moved < (_WEAK_LINES_HOLD if weak and (wide or not hits.layered) else _LINES_HOLD) * fine_m:
            break
    total, weights = normal_equations(pose, hits, lines, fine_m, model, H, b)
    n = max(hits.front, 1)
    return Match(pose, H, found / n, weights / n, math.sqrt(total / max(weights, 1e-9)), lines, wide)

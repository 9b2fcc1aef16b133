"""Boulders and attack point of a pile that was found in the plain cloud of a drift: the same relief as on a drive."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lhdmap.geometry.frame import UprightFrame
from lhdmap.messages import FloatArray
from lhdmap.pile.face import PileFace
from lhdmap.pile.limits import FaceLimits
from lhdmap.pile.measure import WORTH, attack_point
from lhdmap.pile.relief import boulders, relief
from lhdmap.pile.result import PileEstimate
from lhdmap.pile.surface import HIGH_M, LOW_M, PileScene

_ROUND_M = 9.0
_FACE_NEAR_M = 0.3


def with_rocks(pile: PileEstimate, points_m: FloatArray) -> PileEstimate:
    """Return the estimate of a drift's pile with what follows from its relief; all points of the cloud (N, 3), z up."""
    scene = _scene(pile, points_m)
    seen = relief(scene)
    attack = attack_point(scene, seen) if pile.probabilities.get("loadable", 0.0) > WORTH else None
    return replace(pile, boulders=boulders(scene, seen), attack=attack)


def _scene(pile: PileEstimate, points_m: FloatArray) -> PileScene:
    """Return the scene that `surface` would have made of a drive: its frame has its origin in the middle of the toe."""
    across = pile.left_limit_m - pile.right_limit_m
    frame = UprightFrame(
        0.5 * (pile.left_limit_m + pile.right_limit_m), math.atan2(-float(across[0]), float(across[1]))
    )
    near = np.abs(points_m[:, :2] - frame.origin_m[:2]).max(axis=1) < _ROUND_M
    local = np.column_stack([frame.local(points_m[near]), np.zeros(int(near.sum()))])
    slope = -1.0 / math.tan(math.radians(pile.inclination_deg))
    slant = math.hypot(1.0, slope)
    spread = 1.4826 * float(np.median(np.abs(pile.residuals_m))) * slant
    face = PileFace(0.0, 0.0, slope, 0.0, np.zeros((4, 4)), spread, len(pile.face_m))
    off = np.abs(face.x_at(local[:, 1], local[:, 2]) - local[:, 0]) / slant
    on = (off < _FACE_NEAR_M) & (local[:, 2] > LOW_M) & (local[:, 2] < HIGH_M)
    half, std = 0.5 * pile.width_m, pile.width_std_m / math.sqrt(2.0)
    limits = FaceLimits(half, -half, std, std, 0.0, 0.0, 0.0)
    return PileScene(frame, local, face, on, 0.0, True, limits)

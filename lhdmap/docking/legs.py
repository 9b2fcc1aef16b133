"""Legs: a way of states cut where the gear changes, each a curve for the tracker."""

from __future__ import annotations

import itertools

import numpy as np

from lhdmap.docking.kernel import driven
from lhdmap.messages import FloatArray
from lhdmap.tracking.equations import Lengths2
from lhdmap.tracking.path import STEP_M
from lhdmap.tracking.reference import Curve

_BEYOND_M = 2.0


def legs_of(states: FloatArray, lengths: Lengths2) -> tuple[Curve, ...]:
    """Return the legs of states (N + 1, 5): x, y, heading of the rear axle, joint angle, signed way."""
    step = np.diff(states[:, 4])
    moving = np.flatnonzero(step != 0.0)
    if len(moving) == 0:
        return ()
    cuts = moving[np.flatnonzero(np.diff(np.sign(step[moving])) != 0)] + 1
    bounds = [0, *cuts.tolist(), len(states) - 1]
    parts = [states[low : high + 1] for low, high in itertools.pairwise(bounds)]
    return tuple(_leg(part, lengths) for part in parts if abs(part[-1, 4] - part[0, 4]) > 0.5 * STEP_M)


def _leg(part: FloatArray, lengths: Lengths2) -> Curve:
    gear = 1 if part[-1, 4] > part[0, 4] else -1
    ordered = part[::gear]
    ordered = ordered[np.append(True, np.diff(ordered[:, 4]) > 1e-9)]
    low, high = ordered[0, 4], ordered[-1, 4]
    whole = np.concatenate([_on(ordered[0], -1, lengths)[:0:-1], ordered, _on(ordered[-1], 1, lengths)[1:]])
    s = np.arange(whole[0, 4], whole[-1, 4], STEP_M)
    x, y, heading, bend = (np.interp(s, whole[:, 4], whole[:, k]) for k in range(4))
    change = np.gradient(bend, STEP_M)
    curvature = (np.sin(bend) - lengths[0] * change) / (lengths[0] + lengths[1] * np.cos(bend))
    rows = np.ascontiguousarray(np.column_stack([x, y, heading, curvature, bend, change]))
    ends = (low - s[0], high - s[0])
    return Curve(rows, *(ends if gear > 0 else ends[::-1]))


def _on(state: FloatArray, gear: int, lengths: Lengths2) -> FloatArray:
    """Return states from one on with the joint held."""
    moves = np.array([[gear, state[3], _BEYOND_M]])
    on = driven(state[:4], moves, np.array([_BEYOND_M / STEP_M]), 1.0, lengths)
    on[:, 4] += state[4]
    found: FloatArray = on
    return found

"""From a configuration to a dock by a Dubins word whose turns the joint can make: it bends and straightens on the way."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.docking.dubins import Word, words
from lhdmap.docking.kernel import driven
from lhdmap.messages import FloatArray
from lhdmap.tracking.equations import Lengths2, equilibrium

STEP_M = 0.1
_ROUNDS, _STRIDE_M, _PROBE_M = 10, 4.0, 0.02
_NEAR_M = 1e-3


class Shape(NamedTuple):
    """How ways are laid: radius of turns (m), joint angle in them (rad), its change (rad/m), last straight (m), L0 and L1."""

    radius_m: float
    bend_rad: float
    change_pm: float
    straight_m: float
    lengths: Lengths2

    @property
    def rear_radius_m(self) -> float:
        """Radius on which the rear axle turns."""
        front_m, rear_m = self.lengths
        return (front_m + rear_m * math.cos(self.bend_rad)) / math.sin(self.bend_rad)


def shape_of(radius_m: float, change_pm: float, straight_m: float, lengths: Lengths2) -> Shape:
    """Return a shape: the joint angle is that of Eq. (10) for the radius."""
    return Shape(radius_m, float(equilibrium(1.0 / radius_m, lengths)[4]), change_pm, straight_m, lengths)


class Candidate(NamedTuple):
    """A word from the end of a prefix: moves before it (K, 3), where they end (4,), the word, the estimated length (m)."""

    before: FloatArray
    at: FloatArray
    word: Word
    length_m: float


def words_to(at: FloatArray, goal: FloatArray, gear: int, shape: Shape, before: FloatArray) -> list[Candidate]:
    """Return candidates from a configuration (4,) to a pose (3,) of the rear axle, driven in one gear."""
    turned = 0.0 if gear > 0 else math.pi
    short = shape.straight_m + 0.5 * shape.bend_rad / shape.change_pm
    aim = goal[:2] - gear * short * np.array([math.cos(goal[2]), math.sin(goal[2])])
    start = (float(at[0]), float(at[1]), float(at[2]) + turned)
    found = words(start, (float(aim[0]), float(aim[1]), float(goal[2]) + turned), shape.rear_radius_m)
    gone = float(before[:, 2].sum())
    return [Candidate(before, at, word, gone + word.length_m) for word in found]


def connected(candidate: Candidate, goal: FloatArray, gear: int, shape: Shape) -> FloatArray | None:
    """Return all moves (K, 3) of a candidate that ends at the goal, or None: Newton on the lengths of its three parts.

    The closed form is the first guess; the joint takes some metres for each change, by which the end would be off.
    """
    turns = np.array(candidate.word.turns)
    bends = gear * turns * shape.bend_rad
    last = shape.straight_m + abs(bends[2]) / shape.change_pm
    moves = np.zeros((4, 3))
    moves[:, 0], moves[:3, 1], moves[3, 2] = gear, bends, last
    length = np.array(candidate.word.lengths_m)
    steps = np.maximum(np.ceil(np.append(length, last) / STEP_M), 1.0)

    def missed(lengths_m: FloatArray) -> FloatArray:
        moves[:3, 2] = lengths_m
        end = driven(candidate.at, moves, steps, shape.change_pm, shape.lengths)[-1]
        turn = (end[2] - goal[2] + math.pi) % (2.0 * math.pi) - math.pi
        return np.array([end[0] - goal[0], end[1] - goal[1], turn * shape.radius_m, end[3] * shape.radius_m])

    for _ in range(_ROUNDS):
        off = missed(length)
        if np.abs(off).max() < _NEAR_M:
            break
        slope = np.stack([(missed(length + step) - off)[:3] / _PROBE_M for step in _PROBE_M * np.eye(3)], axis=1)
        if abs(np.linalg.det(slope)) < 1e-4:
            return None
        stride = np.linalg.solve(slope, -off[:3])
        length = length + stride * min(1.0, _STRIDE_M / max(float(np.abs(stride).max()), 1e-9))
        if length.min() < -_STRIDE_M:
            return None
    if np.abs(missed(length)).max() > _NEAR_M or length.min() < 0.0:
        return None
    return np.concatenate([candidate.before, moves])


def states_of(start: FloatArray, moves: FloatArray, shape: Shape) -> FloatArray:
    """Return states (N + 1, 5) along moves, each 0.1 m or less."""
    steps = np.maximum(np.ceil(moves[:, 2] / STEP_M), 1.0)
    found: FloatArray = driven(start, moves, steps, shape.change_pm, shape.lengths)
    return found

"""One solution of the realignment: the poses of a window of scans from what they saw at the same height, and the joint."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.smoothing.height_pairs import Indices, Joint, Pairs, add_pairs, add_steps, placed, same_height

_ROUNDS = 2  # the next window begins where this one ended
_APART_M = 3.0  # scans nearer to each other share the error that is to be found
_NOISE_M = 0.015
_JOINT_STD_RAD = math.radians(0.3)


class Node(NamedTuple):
    """A scan that is aligned, `serial` counts all: `lines` of its front hits, and `hits`, the rear ones first, in its own frame.

    `pairs` (P, 3): row of `hits`, serial of the node that saw the same wall at the same height, row of that node's `lines`.
    """

    serial: int
    time_ns: int
    travelled_m: float
    pose: FloatArray
    step_sigmas: FloatArray
    front: FloatArray
    lines: FloatArray
    hits: FloatArray
    behind: int
    pairs: list[Indices]


class Window(NamedTuple):
    """Nodes in a row with their poses (K, 3) and the joint; those before `first` are final, those from `unpaired` on are new."""

    nodes: Sequence[Node]
    poses: FloatArray
    joint: Joint
    first: int
    unpaired: int


def solved(window: Window) -> Window:
    """Return the window with its poses moved: Gauss-Newton over those that are not final."""
    _pair(window)
    nodes, poses, joint, first = window.nodes, window.poses.copy(), window.joint, window.first
    lines, owners = _stacked([node.lines for node in nodes])
    pairs = _pairs_of(nodes, first, np.searchsorted(owners, np.arange(len(nodes))))
    steps = np.array([se2.between(a.pose, b.pose) for a, b in pairwise(nodes)])
    sigmas = np.array([node.step_sigmas for node in nodes[1:]])
    size = 3 * len(nodes) + 1
    for _ in range(_ROUNDS):
        H, g = np.zeros((size, size)), np.zeros(size)
        add_pairs(lines, owners, pairs, poses, joint, _NOISE_M, H, g)
        add_steps(poses, steps, sigmas, H, g)
        H[-1, -1] += 1.0 / _JOINT_STD_RAD**2
        g[-1] -= joint.offset_rad / _JOINT_STD_RAD**2
        change = solve(H[3 * first :, 3 * first :], g[3 * first :], assume_a="pos")
        poses[first:] += change[:-1].reshape(-1, 3)
        joint = joint._replace(offset_rad=joint.offset_rad + float(change[-1]))
    return window._replace(poses=poses, joint=joint, unpaired=len(nodes))


def _pair(window: Window) -> None:
    """Find what the new nodes saw again, where the odometry's steps put them: they are centimetres off by then."""
    nodes, new = window.nodes, window.nodes[window.unpaired :]
    walls, wall_owner = _stacked([node.front for node in nodes])
    hits, owner = _stacked([node.hits for node in new])
    found = same_height(
        placed(walls, wall_owner, window.poses),
        wall_owner,
        np.concatenate([node.lines for node in nodes]),
        placed(hits, owner + window.unpaired, window.poses),
        owner + window.unpaired,
        np.array([node.travelled_m for node in nodes]),
        _APART_M,
    )
    wall_starts = np.searchsorted(wall_owner, np.arange(len(nodes)))
    starts = np.searchsorted(owner, np.arange(len(new) + 1))
    for node, start, end in zip(new, starts[:-1], starts[1:], strict=True):
        mine = np.flatnonzero(found[start:end] >= 0)
        wall = found[start + mine]
        partner = wall_owner[wall]
        node.pairs.append(np.column_stack([mine, nodes[0].serial + partner, wall - wall_starts[partner]]))


def _pairs_of(nodes: Sequence[Node], first: int, wall_starts: Indices) -> Pairs:
    """Return the pairs of the nodes from `first` on whose partner is still there."""
    hits, owners, lines, swings = (
        [np.zeros((0, 3))],
        [np.zeros(0, np.int64)],
        [np.zeros(0, np.int64)],
        [np.zeros(0, bool)],
    )
    for row, node in enumerate(nodes[first:], first):
        for pairs in node.pairs:
            partner = pairs[:, 1] - nodes[0].serial
            kept = partner >= 0
            hits.append(node.hits[pairs[kept, 0]])
            owners.append(np.full(int(kept.sum()), row))
            lines.append(wall_starts[partner[kept]] + pairs[kept, 2])
            swings.append(pairs[kept, 0] < node.behind)
    return Pairs(*(np.concatenate(parts) for parts in (hits, owners, lines, swings)))


def _stacked(parts: list[FloatArray]) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return all points (N, 3) and the part that each belongs to (N,)."""
    if not parts:
        return np.zeros((0, 3)), np.zeros(0, np.int64)
    return np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])

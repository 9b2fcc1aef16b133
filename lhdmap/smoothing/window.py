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
from lhdmap.smoothing.height_pairs import Indices, Joint, Pairs, add_pairs, add_steps, same_height

_ROUNDS = 2  # the next window begins where this one ended
_APART_M = 1.5  # scans nearer to each other share the error that is to be found
_NOISE_M = 0.015
_JOINT_STD_RAD = math.radians(0.3)
_FEWEST_STD_RAD, _MOST_WINDOWS = math.radians(0.01), 40.0


class Seen(NamedTuple):
    """What a node saw again: its hits (P, 3), rear or not, serial of the node that saw the wall, row of that node's `lines`."""

    hits: FloatArray
    swings: npt.NDArray[np.bool_]
    partner: Indices
    line: Indices


class WindowNode(NamedTuple):
    """A scan that is aligned, `serial` counts all; `lines` of its front hits and `hits`, rear ones first, are in its own frame."""

    serial: int
    time_ns: int
    travelled_m: float
    pose: FloatArray
    step_sigmas: FloatArray
    lines: FloatArray
    hits: FloatArray
    behind: int
    seen: list[Seen]


class Offset(NamedTuple):
    """What the windows so far say of the joint's encoder: mean of their offsets (rad), and how many windows it is of.

    In one window an offset looks like a bend: it is off by 0.03 degrees, and turns the heading with it. Over many it is known.
    """

    mean_rad: float = 0.0
    windows: float = 0.0

    @property
    def std_rad(self) -> float:
        """How far the offset of a window may be from the mean."""
        return max(_JOINT_STD_RAD / (1.0 + self.windows), _FEWEST_STD_RAD)

    def and_another(self, offset_rad: float, variance: float) -> Offset:
        """Return it with what a window says, from its solution under this prior and its variance (rad²)."""
        prior = 1.0 / self.std_rad**2
        told = max(1.0 / variance - prior, 1e-6 * prior)
        alone_rad = (offset_rad / variance - prior * self.mean_rad) / told
        windows = min(self.windows + 1.0, _MOST_WINDOWS)
        return Offset(self.mean_rad + (alone_rad - self.mean_rad) / windows, windows)


class Window(NamedTuple):
    """Nodes in a row with their poses (K, 3) and the joint; those before `first` are final, those from `unpaired` on are new.

    `offset`: what is known of the joint's encoder.
    """

    nodes: Sequence[WindowNode]
    poses: FloatArray
    joint: Joint
    first: int
    unpaired: int
    offset: Offset = Offset()


def solved(window: Window) -> Window:
    """Return the window with its poses moved: Gauss-Newton over those that are not final."""
    nodes, poses, joint, first = window.nodes, window.poses.copy(), window.joint, window.first
    lines, owners = _stacked([node.lines for node in nodes])
    starts = np.searchsorted(owners, np.arange(len(nodes)))
    _pair(window, lines, owners, starts)
    pairs = _pairs_of(nodes, first, starts)
    steps = np.array([se2.between(a.pose, b.pose) for a, b in pairwise(nodes)])
    sigmas = np.array([node.step_sigmas for node in nodes[1:]])
    size, known = 3 * len(nodes) + 1, window.offset
    for _ in range(_ROUNDS):
        H, g = np.zeros((size, size)), np.zeros(size)
        add_pairs(lines, owners, pairs, poses, joint, _NOISE_M, H, g)
        add_steps(poses, steps, sigmas, H, g)
        H[-1, -1] += 1.0 / known.std_rad**2
        g[-1] -= (joint.offset_rad - known.mean_rad) / known.std_rad**2
        last = np.zeros(size - 3 * first)
        last[-1] = 1.0
        both = solve(H[3 * first :, 3 * first :], np.column_stack([g[3 * first :], last]), assume_a="pos")
        change = both[:, 0]
        poses[first:] += change[:-1].reshape(-1, 3)
        joint = joint._replace(offset_rad=joint.offset_rad + float(change[-1]))
    offset = known.and_another(joint.offset_rad, float(both[-1, 1]))
    return window._replace(poses=poses, joint=joint, unpaired=len(nodes), offset=offset)


def _pair(window: Window, lines: FloatArray, owners: Indices, starts: Indices) -> None:
    """Find what the new nodes saw again, where the odometry's steps put them: they are centimetres off by then."""
    nodes, new = window.nodes, window.nodes[window.unpaired :]
    hits, hit_owner = _stacked([node.hits for node in new])
    travelled = np.array([node.travelled_m for node in nodes])
    found = same_height(lines, owners, hits, hit_owner + window.unpaired, window.poses, travelled, _APART_M)
    ends = np.searchsorted(hit_owner, np.arange(len(new) + 1))
    for node, start, end in zip(new, ends[:-1], ends[1:], strict=True):
        mine = np.flatnonzero(found[start:end] >= 0)
        wall = found[start + mine]
        partner = owners[wall]
        node.seen.append(Seen(node.hits[mine], mine < node.behind, nodes[0].serial + partner, wall - starts[partner]))


def _pairs_of(nodes: Sequence[WindowNode], first: int, starts: Indices) -> Pairs:
    """Return the pairs of the nodes from `first` on whose partner is still there; `starts` (K,): of each node's lines."""
    seen = [(row, one) for row, node in enumerate(nodes[first:], first) for one in node.seen]
    hits = np.concatenate([np.zeros((0, 3)), *(one.hits for _, one in seen)])
    swings = np.concatenate([np.zeros(0, bool), *(one.swings for _, one in seen)])
    partner, line = (
        np.concatenate([np.zeros(0, np.int64), *(getattr(one, name) for _, one in seen)])
        for name in ("partner", "line")
    )
    owner = np.repeat(np.array([row for row, _ in seen], np.int64), [len(one.line) for _, one in seen])
    there = partner >= nodes[0].serial
    wall = starts[partner[there] - nodes[0].serial] + line[there]
    return Pairs(hits[there], owner[there], wall, swings[there])


def _stacked(parts: list[FloatArray]) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return all points (N, 3) and the part that each belongs to (N,)."""
    if not parts:
        return np.zeros((0, 3)), np.zeros(0, np.int64)
    return np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])

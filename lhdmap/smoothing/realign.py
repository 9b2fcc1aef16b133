"""Realignment: a fixed-lag smoother over tilted front scans and the rear scanner's hits of the same walls at the same heights.

Driving forward, a tilted scanner sees a wall at rising heights. A wall that leans looks like a wrong speed or heading, alike
for many scans, so the error of the odometry does not average out: it grows. Metres later the rear scanner sees the same walls at
the same heights once more, and so does the front scanner where the floor makes it pitch. Each such pair of hits ties two poses
together over metres, whatever the wall's lean. Here the poses of the last metres are solved for jointly from all pairs and the
odometry's steps; each pose becomes final after `lag_m` of travel (or `lag_s`).
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.smoothing.height_pairs import Indices, Joint, Pairs, add_pairs, add_steps, placed, same_height, wall_lines
from lhdmap.smoothing.settings import SmoothingSettings

_ROUNDS = 3
_SOLVE_SHARE = 0.3  # of the lag between two solutions
_REST_SHARE = 0.2  # of the lag in time between nodes at rest
_ANCHOR_M = 18.0  # of final poses that the others are tied to: as far as the rear scanner looks back
_APART_M = 3.0  # scans nearer to each other share the error that is to be found
_NOISE_M = 0.015
_MOST_HITS = 400  # of a scan
_FIXED = 1e12
# Random walk of the odometry of tilted scanners (m, m, deg per root metre), measured on simulated drives; where a direction
# was weak or the scan lost, so many times as much.
_WALK, _WEAK = np.array([0.02, 0.01, math.radians(0.03)]), 5.0
_SHORTEST_M = 0.003
_JOINT_STD_RAD = math.radians(0.3)


class AlignedScan(NamedTuple):
    """A scan on its way: time, pose (3,) in `odom`, front and rear hits (N, 3) in the level base frame with absolute heights."""

    time_ns: int
    pose: FloatArray
    front: FloatArray
    rear: FloatArray
    weak: bool


class _Node(NamedTuple):
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


class Realigner:
    """`update` with each processed scan; `moves` holds time and `T_map_odom` (3,) of the nodes that are final.

    `joint_x_m`: of the joint that rear hits swing about, in `base_link`; what its encoder is off is one of the unknowns.
    """

    def __init__(self, settings: SmoothingSettings, joint_x_m: float = 0.0) -> None:
        self._settings = settings
        self._joint = Joint(joint_x_m, 0.0)
        self._nodes: deque[_Node] = deque()  # final ones that others are tied to, then those that are still moved
        self._poses: deque[FloatArray] = deque()
        self._final = 0
        self._paired = -1
        self._weak = False
        self._travelled_m = self._solved_m = 0.0
        self._last: FloatArray | None = None
        self.moves: list[tuple[int, FloatArray]] = []

    def update(self, scan: AlignedScan) -> None:
        """Take a processed scan, in time order."""
        if self._last is not None:
            self._travelled_m += float(np.hypot(*(scan.pose[:2] - self._last[:2])))
        self._last = scan.pose
        self._weak |= scan.weak
        if self._due(scan.time_ns):
            self._append(scan)
        if self._travelled_m - self._solved_m >= _SOLVE_SHARE * self._settings.lag_m:
            self._solve()
        self._settle(scan.time_ns)

    def finish(self) -> None:
        """Make all poses final: the log has ended."""
        if self._final < len(self._nodes):
            self._solve()
        while self._final < len(self._nodes):
            self._make_final()

    def _due(self, time_ns: int) -> bool:
        """Return whether a node is due: by travel, and at rest now and then, so that the path does not stop."""
        if not self._nodes:
            return True
        last, settings = self._nodes[-1], self._settings
        far = self._travelled_m - last.travelled_m >= settings.node_m
        return far or time_ns - last.time_ns >= _REST_SHARE * settings.lag_s * 1e9

    def _append(self, scan: AlignedScan) -> None:
        """Add a node, placed by the odometry's step from the one before."""
        travelled_m = self._travelled_m
        if self._nodes:
            before = self._nodes[-1]
            pose = se2.compose(self._poses[-1], se2.between(before.pose, scan.pose))
            length_m = max(travelled_m - before.travelled_m, _SHORTEST_M)
        else:
            pose, length_m = scan.pose, _SHORTEST_M
        sigmas = _WALK * math.sqrt(length_m) * (_WEAK if self._weak else 1.0)
        front, rear = _thinned(scan.front), _thinned(scan.rear)
        hits = np.concatenate([rear, front[::2]])
        serial = self._nodes[-1].serial + 1 if self._nodes else 0
        lines, pose_odom = wall_lines(front), scan.pose.copy()
        self._nodes.append(
            _Node(serial, scan.time_ns, travelled_m, pose_odom, sigmas, front, lines, hits, len(rear), [])
        )
        self._poses.append(pose)
        self._weak = False

    def _settle(self, now_ns: int) -> None:
        """Make final what lies behind by the lag, in travel or in time."""
        settings = self._settings
        while self._final < len(self._nodes):
            node = self._nodes[self._final]
            far = self._travelled_m - node.travelled_m > settings.lag_m
            if not far and now_ns - node.time_ns <= settings.lag_s * 1e9:
                return
            if self._solved_m < node.travelled_m:  # too slow a drive for the lag: solve with what there is
                self._solve()
            self._make_final()

    def _make_final(self) -> None:
        node = self._nodes[self._final]
        T_map_odom = se2.compose(self._poses[self._final], se2.inverse(node.pose))
        self.moves.append((node.time_ns, T_map_odom))
        self._final += 1
        while self._final > 1 and node.travelled_m - self._nodes[0].travelled_m > _ANCHOR_M:
            self._nodes.popleft()
            self._poses.popleft()
            self._final -= 1

    def _solve(self) -> None:
        """Gauss-Newton over the poses that are not final."""
        self._solved_m = self._travelled_m
        self._pair()
        nodes, poses = list(self._nodes), np.array(self._poses)
        first = max(self._final, 1)  # the first pose of all stays
        if first >= len(nodes):
            return
        lines, owners = _stacked([node.lines for node in nodes])
        pairs = _pairs_of(nodes, first, np.searchsorted(owners, np.arange(len(nodes))))
        steps = np.array([se2.between(a.pose, b.pose) for a, b in pairwise(nodes)])
        sigmas = np.array([node.step_sigmas for node in nodes[1:]])
        joint, size = self._joint, 3 * len(nodes) + 1
        for _ in range(_ROUNDS):
            H, g = np.zeros((size, size)), np.zeros(size)
            add_pairs(lines, owners, pairs, poses, joint, _NOISE_M, H, g)
            add_steps(poses, steps, sigmas, H, g)
            H[-1, -1] += 1.0 / _JOINT_STD_RAD**2
            g[-1] -= joint.offset_rad / _JOINT_STD_RAD**2
            change = solve(H[3 * first :, 3 * first :], g[3 * first :], assume_a="pos")
            poses[first:] += change[:-1].reshape(-1, 3)
            joint = joint._replace(offset_rad=joint.offset_rad + float(change[-1]))
        self._joint = joint
        self._poses = deque(poses)

    def _pair(self) -> None:
        """Find what the new nodes saw again, where the odometry's steps put them: they are centimetres off by then."""
        nodes, poses = self._nodes, np.array(self._poses)
        new = [row for row, node in enumerate(nodes) if node.serial > self._paired]
        if not new:
            return
        self._paired = nodes[-1].serial
        walls, wall_owner = _stacked([node.front for node in nodes])
        hits, owner = _stacked([nodes[row].hits for row in new])
        owner += new[0]
        found = same_height(
            placed(walls, wall_owner, poses),
            wall_owner,
            np.concatenate([node.lines for node in nodes]),
            placed(hits, owner, poses),
            owner,
            np.array([node.travelled_m for node in nodes]),
            _APART_M,
        )
        wall_starts, starts = np.searchsorted(wall_owner, np.arange(len(nodes))), np.searchsorted(owner, new)
        for row, start, end in zip(new, starts, [*starts[1:], len(hits)], strict=True):
            mine = start + np.flatnonzero(found[start:end] >= 0)
            partner = wall_owner[found[mine]]
            nodes[row].pairs.append(
                np.column_stack([mine - start, nodes[0].serial + partner, found[mine] - wall_starts[partner]])
            )


def _pairs_of(nodes: list[_Node], first: int, wall_starts: Indices) -> Pairs:
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


def _thinned(points: FloatArray) -> FloatArray:
    return np.ascontiguousarray(points[:: int(-(-len(points) // _MOST_HITS) or 1)])


def _stacked(parts: list[FloatArray]) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return all points (N, 3) and the part that each belongs to (N,)."""
    if not parts:
        return np.zeros((0, 3)), np.zeros(0, np.int64)
    return np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])

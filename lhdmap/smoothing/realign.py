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
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.smoothing.height_pairs import add_pairs, add_steps, placed, same_height, wall_lines
from lhdmap.smoothing.settings import SmoothingSettings

_ROUNDS = 3
_SOLVE_SHARE = 0.3  # of the lag between two solutions
_ANCHOR_M = 18.0  # of final poses that the others are tied to: as far as the rear scanner looks back
_APART_M = 3.0  # scans nearer to each other share the error that is to be found
_NOISE_M = 0.015
_MOST_HITS = 200  # of a scan
_FIXED = 1e12
# Random walk of the odometry of tilted scanners (m, m, deg per root metre), measured on simulated drives; where a direction
# was weak or the scan lost, so many times as much.
_WALK, _WEAK = np.array([0.02, 0.01, math.radians(0.03)]), 5.0
_SHORTEST_M = 0.003


class AlignedScan(NamedTuple):
    """A scan on its way: time, pose (3,) in `odom`, front and rear hits (N, 3) in the level base frame with absolute heights."""

    time_ns: int
    pose: FloatArray
    front: FloatArray
    rear: FloatArray
    weak: bool


class _Node(NamedTuple):
    time_ns: int
    travelled_m: float
    pose: FloatArray
    step_sigmas: FloatArray
    front: FloatArray
    lines: FloatArray
    hits: FloatArray


class Realigner:
    """`update` with each processed scan; `times_ns` and `poses_odom`, `poses_map` hold the nodes that are final."""

    def __init__(self, settings: SmoothingSettings) -> None:
        self._settings = settings
        self._nodes: deque[_Node] = deque()  # final ones that others are tied to, then those that are still moved
        self._poses: deque[FloatArray] = deque()
        self._final = 0
        self._weak = False
        self._travelled_m = self._solved_m = 0.0
        self._last: FloatArray | None = None
        self.times_ns: list[int] = []
        self.poses_odom: list[FloatArray] = []
        self.poses_map: list[FloatArray] = []

    def update(self, scan: AlignedScan) -> None:
        """Take a processed scan, in time order."""
        if self._last is not None:
            self._travelled_m += float(np.hypot(*(scan.pose[:2] - self._last[:2])))
        self._last = scan.pose
        self._weak |= scan.weak
        if not self._nodes or self._travelled_m - self._nodes[-1].travelled_m >= self._settings.node_m:
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
        self._nodes.append(
            _Node(scan.time_ns, travelled_m, scan.pose.copy(), sigmas, front, wall_lines(front), hits)
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
        self.times_ns.append(node.time_ns)
        self.poses_odom.append(node.pose)
        self.poses_map.append(self._poses[self._final].copy())
        self._final += 1
        while self._final > 1 and node.travelled_m - self._nodes[0].travelled_m > _ANCHOR_M:
            self._nodes.popleft()
            self._poses.popleft()
            self._final -= 1

    def _solve(self) -> None:
        """Gauss-Newton over the poses that are not final; the pairs are found once, where the odometry's steps put the scans."""
        self._solved_m = self._travelled_m
        nodes, poses = list(self._nodes), np.array(self._poses)
        walls, wall_owner = _stacked([node.front for node in nodes])
        lines = np.concatenate([node.lines for node in nodes])
        first = max(self._final, 1)  # the first pose of all stays
        hits, hit_owner = _stacked([node.hits for node in nodes[first:]])
        hit_owner += first
        travelled = np.array([node.travelled_m for node in nodes])
        steps = np.array([se2.between(a.pose, b.pose) for a, b in zip(nodes[:-1], nodes[1:], strict=True)]).reshape(-1, 3)
        sigmas = np.array([node.step_sigmas for node in nodes[1:]]).reshape(-1, 3)
        pairs = None
        for _ in range(_ROUNDS):
            if pairs is None:
                pairs = same_height(
                    placed(walls, wall_owner, poses),
                    wall_owner,
                    lines,
                    placed(hits, hit_owner, poses),
                    hit_owner,
                    travelled,
                    _APART_M,
                )
            H, g = np.zeros((3 * len(nodes), 3 * len(nodes))), np.zeros(3 * len(nodes))
            add_pairs(lines, wall_owner, hits, hit_owner, pairs, poses, _NOISE_M, H, g)
            add_steps(poses, steps, sigmas, H, g)
            free = slice(3 * first, None)
            if first < len(nodes):
                poses[first:] += np.linalg.solve(H[free, free], g[free]).reshape(-1, 3)
        self._poses = deque(poses)


def _thinned(points: FloatArray) -> FloatArray:
    return np.ascontiguousarray(points[:: -(-len(points) // _MOST_HITS) or 1])


def _stacked(parts: list[FloatArray]) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return all points (N, 3) and the part that each belongs to (N,)."""
    if not parts:
        return np.zeros((0, 3)), np.zeros(0, np.int64)
    return np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])

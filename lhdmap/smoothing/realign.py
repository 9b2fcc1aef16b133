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
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.smoothing.height_pairs import Joint, wall_lines
from lhdmap.smoothing.moves import Moves
from lhdmap.smoothing.settings import SmoothingSettings
from lhdmap.smoothing.window import Offset, Window, WindowNode, solved

_SOLVE_SHARE = 0.3  # of the lag between two solutions
_LATE_SHARE = 0.1  # of the lag in time between two solutions of a slow machine
_REST_SHARE = 0.2  # of the lag in time between nodes at rest
_MOST_FINAL = 300  # of a machine that stands
_ANCHOR_M = 30.0  # of final poses that the others are tied to: farther than the rear scanner looks back
_MOST_HITS = 400  # of a scan
_FRONT_STEP = 2  # of the front hits so many are looked up once: the rear ones tell more
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


class _Way:
    """How far the odometry has gone; `weak`: whether a scan since the newest node was."""

    def __init__(self) -> None:
        self.travelled_m, self.weak = 0.0, False
        self._last: FloatArray | None = None

    def go_on(self, scan: AlignedScan) -> None:
        if self._last is not None:
            self.travelled_m += math.hypot(scan.pose[0] - self._last[0], scan.pose[1] - self._last[1])
        self._last = scan.pose
        self.weak |= scan.weak


class Realigner:
    """`update` with each processed scan; `moves` holds time and `pose_map_odom` (3,) of the nodes that are final.

    `joint_x_m`: of the joint that rear hits swing about, in `base_link`; what its encoder is off is one of the unknowns.
    """

    def __init__(self, settings: SmoothingSettings, joint_x_m: float = 0.0) -> None:
        self._settings = settings
        self._joint, self._offset = Joint(joint_x_m, 0.0), Offset()
        self._nodes: deque[WindowNode] = deque()  # final ones that others are tied to, then those that are still moved
        self._poses: deque[FloatArray] = deque()
        self._final = self._paired = 0  # so many of the nodes are final, have been compared with the others
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="realign")
        self._pending: Future[Window] | None = None
        self._way = _Way()
        self._solved_at = 0.0, 0  # travel (m) and time (ns) of the last solution
        self.moves = Moves()

    def update(self, scan: AlignedScan) -> None:
        """Take a processed scan, in time order."""
        self._way.go_on(scan)
        if self._due(scan.time_ns):
            self._append(scan)
        if (
            self._is_late(scan.time_ns)
            or self._way.travelled_m - self._solved_at[0] >= _SOLVE_SHARE * self._settings.lag_m
        ):
            # A solution is asked for when the next is due, never when it happens to be ready: the result must not depend on it.
            self._collect()
            self._settle(scan.time_ns)
            self._solve(scan.time_ns)

    def finish(self) -> None:
        """Make all poses final: the log has ended."""
        self._collect()
        self._solve(self._solved_at[1])
        self._collect()
        while self._final < len(self._nodes):
            self._make_final()
        self._worker.shutdown()

    def _is_late(self, now_ns: int) -> bool:
        """Return whether a node waits for too long, and the last solution was not just now.

        A machine that is slower than `lag_m` in `lag_s` would have one for each node otherwise.
        """
        lag_ns = self._settings.lag_s * 1e9
        oldest_ns = self._nodes[min(self._final, len(self._nodes) - 1)].time_ns
        return oldest_ns < now_ns - lag_ns and now_ns - self._solved_at[1] >= _LATE_SHARE * lag_ns

    def _due(self, time_ns: int) -> bool:
        """Return whether a node is due: by travel, and at rest now and then, so that the path does not stop."""
        if not self._nodes:
            return True
        last, settings = self._nodes[-1], self._settings
        far = self._way.travelled_m - last.travelled_m >= settings.node_m
        return far or time_ns - last.time_ns >= _REST_SHARE * settings.lag_s * 1e9

    def _append(self, scan: AlignedScan) -> None:
        """Add a node, placed by the odometry's step from the one before."""
        travelled_m = self._way.travelled_m
        if self._nodes:
            before = self._nodes[-1]
            pose = se2.compose(self._poses[-1], se2.between(before.pose, scan.pose))
            length_m = max(travelled_m - before.travelled_m, _SHORTEST_M)
        else:
            pose, length_m = scan.pose, _SHORTEST_M
        sigmas = _WALK * math.sqrt(length_m) * (_WEAK if self._way.weak else 1.0)
        front, rear = _thinned(scan.front), _thinned(scan.rear)
        hits = np.concatenate([rear, front[::_FRONT_STEP]])
        serial = self._nodes[-1].serial + 1 if self._nodes else 0
        lines, pose_odom = wall_lines(front), scan.pose.copy()
        self._nodes.append(WindowNode(serial, scan.time_ns, travelled_m, pose_odom, sigmas, lines, hits, len(rear), []))
        self._poses.append(pose)
        self._way.weak = False

    def _settle(self, now_ns: int) -> None:
        """Make final what lies behind by the lag, in travel or in time."""
        settings = self._settings
        while self._final < len(self._nodes):
            node = self._nodes[self._final]
            far = self._way.travelled_m - node.travelled_m > settings.lag_m
            if not far and now_ns - node.time_ns <= settings.lag_s * 1e9:
                return
            self._make_final()

    def _make_final(self) -> None:
        node = self._nodes[self._final]
        pose_map_odom = se2.compose(self._poses[self._final], se2.inverse(node.pose))
        self.moves.append(node.time_ns, pose_map_odom)
        self._final += 1
        while self._final > 1 and (
            node.travelled_m - self._nodes[0].travelled_m > _ANCHOR_M or self._final > _MOST_FINAL
        ):
            self._nodes.popleft()
            self._poses.popleft()
            self._final -= 1
            self._paired -= 1

    def _solve(self, now_ns: int) -> None:
        """Give the worker what there is: it solves while the drive goes on."""
        self._solved_at = self._way.travelled_m, now_ns
        first = max(self._final, 1)  # the first pose of all stays
        if first < len(self._nodes):
            window = Window(list(self._nodes), np.array(self._poses), self._joint, first, self._paired, self._offset)
            self._pending = self._worker.submit(solved, window)

    def _collect(self) -> None:
        """Take over the poses of the solution that was asked for, and put the nodes behind them after those."""
        if self._pending is None:
            return
        found, self._pending = self._pending.result(), None
        poses, nodes = deque(found.poses), list(self._nodes)
        for before, node in zip(nodes[len(poses) - 1 :], nodes[len(poses) :], strict=False):
            poses.append(se2.compose(poses[-1], se2.between(before.pose, node.pose)))
        self._poses, self._joint, self._paired, self._offset = poses, found.joint, found.unpaired, found.offset


def _thinned(points: FloatArray) -> FloatArray:
    return np.ascontiguousarray(points[:: int(-(-len(points) // _MOST_HITS) or 1)])

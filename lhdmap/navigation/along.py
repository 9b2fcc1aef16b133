"""Places along a leg: where the machine is on a path, the part of it that guidance gets, the heading at a goal."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.driving.motion import Motion
from lhdmap.geometry import se2
from lhdmap.guidance.directive import HEADING, WAY, Directive
from lhdmap.messages import FloatArray
from lhdmap.topology.model import DEAD_END, TopologicalMap, Tunnel, Waypoint

_BEHIND_M, _AHEAD_M = 12.0, 60.0
_AROUND_M = 15.0  # of the path: a place does not jump farther from one moment to the next
_OFF_M, _AS_NEAR_M = 3.0, 1.0


class Located(NamedTuple):
    """Where the machine is: `status` as in localization, the same place in both frames (3,), covariance (3, 3) in `map`."""

    stamp_ns: int
    status: str
    pose_map: FloatArray
    pose_odom: FloatArray
    covariance: FloatArray
    height_m: float

    @property
    def pose_odom_map(self) -> FloatArray:
        """The frame `map` in `odom` (3,)."""
        return se2.compose(self.pose_odom, se2.inverse(self.pose_map))

    @property
    def deviation_m(self) -> float:
        """Standard deviation of the place in the direction that is known worst."""
        return math.sqrt(max(float(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]), 0.0))


def on_map(motion: Motion, located: Located) -> Motion:
    """Return a motion with its place in `map`."""
    pose_map_odom = se2.compose(located.pose_map, se2.inverse(located.pose_odom))
    x, y, heading = se2.compose(pose_map_odom, np.array([motion.x_m, motion.y_m, motion.heading_rad])).tolist()
    return motion._replace(x_m=x, y_m=y, heading_rad=heading)


def along_m(path: FloatArray, x: float, y: float, before_m: float | None = None) -> float:
    """Return how far along a path (N, 6) a place is; `before_m`: where it was a moment ago, None: not known.

    A path may cross itself, and in a decline lie above itself: what is near where the machine was counts first, and at the begin
    the first of several places.
    """
    off_m = np.hypot(path[:, 0] - x, path[:, 1] - y)
    near = _first_near(off_m)
    if before_m is not None:
        around = np.flatnonzero(np.abs(path[:, WAY] - before_m) < _AROUND_M)
        if len(around) and float(off_m[around].min()) < max(_OFF_M, 2.0 * float(off_m[near])):
            near = int(around[off_m[around].argmin()])
    heading = path[near, HEADING]
    ahead = math.cos(heading) * (x - path[near, 0]) + math.sin(heading) * (y - path[near, 1])
    return float(path[near, WAY] + ahead)


def _first_near(off_m: FloatArray) -> int:
    """Return the first place along a path that is about as near as any, where it is nearest."""
    first = int(np.flatnonzero(off_m <= float(off_m.min()) + _AS_NEAR_M)[0])
    leaves = np.flatnonzero(off_m[first:] > float(off_m.min()) + _AS_NEAR_M)
    last = first + int(leaves[0]) if len(leaves) else len(off_m)
    return first + int(off_m[first:last].argmin())


def part_of(now_ns: int, gear: int, path: FloatArray, stop_m: float, at_m: float) -> Directive:
    """Return the directive with the part of a path around a place."""
    part = (path[:, 5] > at_m - _BEHIND_M) & (path[:, 5] < at_m + _AHEAD_M)
    return Directive(now_ns, gear, path[part], stop_m)


def facing(topology: TopologicalMap, goal: str, tail_m: float = 0.0) -> str | None:
    """Return the heading at a goal at a dead end; None: any will do.

    A draw point or a dump is faced with the bucket, and so is a place where less than `tail_m` is left to the end: the machine,
    which reaches so far behind `base_link`, stood there bucket first when it was taught, and cannot back up to it.
    """
    point = topology.called(goal)
    if not isinstance(point, Waypoint):
        return None
    node = topology.nodes[point.node]
    if not isinstance(node, Tunnel) or DEAD_END not in node.ends:
        return None
    last = node.ends[1] == DEAD_END
    left_m = float(np.linalg.norm(node.line_m[-1 if last else 0][:2] - point.pose[:2]))
    if point.purpose not in ("draw_point", "dump") and left_m >= tail_m:
        return None
    return "along" if last else "against"

"""Whether pose and scan agree: the scans' motion against that of wheels and joint, and the map's pose against the odometry's.

A pose that has gone wrong shows in the motion of the last half second: the scans say one way, the wheels another. A few percent of
slip are no disagreement, so a share of the way is taken off.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.proprioception.wheels import WheelMotion

_WINDOW_NS = 500_000_000
_SLIP, _TURN_RAD_PM = 0.1, math.radians(0.5)
_NONE = (0.0, 0.0)
Apart = tuple[float, float]


class Agreement:
    """Takes poses as they come; tells by how much (m, rad) they are apart from what else is known."""

    def __init__(self, motion_between: Callable[[int, int], WheelMotion | None]) -> None:
        self._motion_between = motion_between
        self._poses: deque[tuple[int, FloatArray]] = deque()
        self._on_map: tuple[FloatArray, FloatArray] | None = None

    def of_motion(self, time_ns: int, pose_odom: FloatArray) -> Apart:
        """Return by how much the motion of the last moments is apart from that of wheels and joint, if there are."""
        poses = self._poses
        poses.append((time_ns, pose_odom.copy()))
        while len(poses) > 2 and time_ns - poses[1][0] >= _WINDOW_NS:
            poses.popleft()
        since_ns, before = poses[0]
        driven = None if time_ns <= since_ns else self._motion_between(since_ns, time_ns)
        if driven is None:
            return _NONE
        moved = se2.between(before, pose_odom)
        if driven.source == "tachometer":  # the joint is not known
            off_m, turned = abs(math.hypot(*moved[:2]) - math.hypot(*driven.delta[:2])), 0.0
        else:
            off_m = math.dist(moved[:2], driven.delta[:2])
            turned = abs(math.remainder(float(moved[2] - driven.delta[2]), 2.0 * math.pi))
        way = math.hypot(*driven.delta[:2])
        return max(off_m - _SLIP * way, 0.0), max(turned - _TURN_RAD_PM * way, 0.0)

    def of_map(self, pose_map: FloatArray, pose_odom: FloatArray, *, known: bool) -> Apart:
        """Return by how much the pose on the map (3,) has jumped against the odometry since the last one, both known."""
        before, self._on_map = self._on_map, (pose_map.copy(), pose_odom.copy()) if known else None
        if before is None or not known:
            return _NONE
        expected = se2.compose(before[0], se2.between(before[1], pose_odom))
        off = se2.between(expected, pose_map)
        return math.hypot(off[0], off[1]), abs(math.remainder(float(off[2]), 2.0 * math.pi))

"""The floor about the machine as the map has it: a level scanner before the foot of a ramp sees its floor, as a wall across.

Hits lower than `min_height_m` over the machine's own floor are none of a wall; where the floor rises ahead, so are those that
are lower than that over the map's floor. Heights are compared with the floor under the machine alone: what the map's heights
have drifted over a mine is no matter.
"""

from __future__ import annotations

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.topology.model import TopologicalMap

NO_FLOOR: FloatArray = np.zeros((0, 3))
_REACH_M = 40.0
_STEP_M = 0.5
_STEEPEST, _SLACK_M = 0.3, 1.0  # a floor farther above or below is that of another level
_FLAT_M = 0.2  # a floor that varies by less hides no wall and shows none
_MOST_BESIDE_M = 6.0  # of the lines that are driven: farther off no floor is known


class FloorOnMap:
    """Points of all driven lines of a map; `about` a machine those that its scanners may see."""

    def __init__(self, topology: TopologicalMap) -> None:
        lines = [one.line_m for one in topology.tunnels]
        lines += [one.line_m for one in topology.connections if one.line_m.shape[1] == 3]
        parts = [_dense(line) for line in lines if len(line) > 1]
        self._points_m = np.unique(np.round(np.vstack(parts), 2), axis=0) if parts else NO_FLOOR

    def about(self, pose_map: FloatArray, height_m: float, pose_odom: FloatArray) -> FloatArray:
        """Return floor points (K, 3) about a machine: x, y in `odom`, heights of the map; none where the floor is flat.

        `pose_map`, `pose_odom` (3,): the same place in both frames; `height_m`: of the floor there, in the map.
        """
        off_m = self._points_m - [pose_map[0], pose_map[1], height_m]
        far_m = np.hypot(off_m[:, 0], off_m[:, 1])
        near = (far_m < _REACH_M) & (np.abs(off_m[:, 2]) < _SLACK_M + _STEEPEST * far_m)
        found: FloatArray = self._points_m[near]
        if len(found) == 0 or float(np.ptp(found[:, 2])) < _FLAT_M:
            return NO_FLOOR
        T_odom_map = se2.compose(pose_odom, se2.inverse(pose_map))
        return np.column_stack([se2.transform(T_odom_map, found[:, :2]), found[:, 2]])


def over_floor(
    points_m: FloatArray, pose_odom: FloatArray, floor_m: FloatArray, least_m: float
) -> npt.NDArray[np.bool_]:
    """Return which hits (N, 3) are at least so high over the floor, bool (N,).

    `points_m`: in `base_link`, levelled, heights over the floor under it; `pose_odom` (3,) of it; `floor_m` (K, 3) of `about`.
    Where no floor is known near, it is taken to be the machine's.
    """
    if len(floor_m) == 0 or len(points_m) == 0:
        return np.ones(len(points_m), dtype=np.bool_)
    at = np.column_stack([se2.transform(pose_odom, points_m[:, :2]), points_m[:, 2]])
    own_m = float(floor_m[int(np.hypot(*(floor_m[:, :2] - pose_odom[:2]).T).argmin()), 2])
    found: npt.NDArray[np.bool_] = _over(at, floor_m, own_m, least_m)
    return found


def _dense(line_m: FloatArray) -> FloatArray:
    """Return a line (N, 3) with points half a metre apart."""
    along = np.concatenate([[0.0], np.hypot(*np.diff(line_m[:, :2], axis=0).T).cumsum()])
    at = np.linspace(0.0, along[-1], max(round(along[-1] / _STEP_M), 1) + 1)
    return np.column_stack([np.interp(at, along, column) for column in line_m.T])


@nb.njit(cache=True)
def _over(points, floor, own, least):  # type: ignore[no-untyped-def]
    out = np.ones(points.shape[0], dtype=np.bool_)
    for i in range(points.shape[0]):
        best, at = _MOST_BESIDE_M**2, own
        for k in range(floor.shape[0]):
            dx, dy = points[i, 0] - floor[k, 0], points[i, 1] - floor[k, 1]
            d = dx * dx + dy * dy
            if d < best:
                best, at = d, floor[k, 2]
        out[i] = points[i, 2] + own - at >= least
    return out

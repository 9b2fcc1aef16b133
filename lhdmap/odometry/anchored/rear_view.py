"""The rear scanner as a help of the odometry: it sees again the walls that the front scanner mapped, at the same heights.

A tilted scanner that drives forward sees each wall at rising heights and never the same curve twice, so that a wall that leans
and a wrong speed look alike. Looking back, the same curve is seen once more, metres later: that ends the ambiguity. The rear
scanner sits behind the joint; an offset of its encoder is learned on the way.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.messages import FloatArray, LaserScan
from lhdmap.scan_matching.matching import Hits, Match, MatchModel
from lhdmap.scan_matching.scan_points import planar_points
from lhdmap.scan_matching.surface_map import CENTRE_X, CENTRE_Y, NORMAL_X, NORMAL_Y, SERVED
from lhdmap.scan_matching.wall_lines import line_weight, slanted

NO_POINTS = np.zeros((0, 3))  # hits of no scan
_FIRST_STD_RAD = math.radians(0.2)  # how far an encoder's zero is off: an installer's
_SPREAD_RAD = 0.01  # of one comparison of joint and map: the map's own bend, alike for many scans, not the scan's noise
_WANDER_RAD = 1e-4  # by scan: so that it follows a joint that wears
_OWN_ZERO = 0.1  # of the offset that the encoder's own zero takes back in each update
_FEWEST_INFORMATION = 1e4  # 1/rad², 0.6°: a scan that tells less tells only its noise


class RearView(NamedTuple):
    """The rear scan nearest in time.

    `T_level_sensor` (4, 4) in the level frame of `base_link` when it was taken, `late_s` after the front scan's middle; the
    joint is at (`joint_x_m`, 0) in `base_link`.
    """

    scan: LaserScan
    T_level_sensor: FloatArray
    late_s: float
    joint_x_m: float


class Behind(NamedTuple):
    """Hits of the rear scanner, points (N, 3), level base frame, absolute heights; x of the joint in that frame (m)."""

    points: FloatArray
    joint_x_m: float


NOTHING_BEHIND = Behind(NO_POINTS, 0.0)  # where no rear scanner helps


def behind(view: RearView, velocity: FloatArray, height_m: float, floor_m: float, most: int) -> Behind:
    """Return the rear hits, `most` at the most, where `base_link` is in the middle of the front scanner's sweep.

    `velocity` (3,): forward, lateral, turning speed; `height_m` of `base_link` in `odom`; hits below `floor_m` are left out.
    """
    every = -(-view.scan.ranges_m.size // most)
    points = planar_points(view.scan, view.T_level_sensor, velocity, floor_m, every=(0, every))
    turn = velocity[2] * view.late_s
    c, s = math.cos(turn), math.sin(turn)
    moved = np.empty_like(points)
    moved[:, 0] = c * points[:, 0] - s * points[:, 1] + velocity[0] * view.late_s
    moved[:, 1] = s * points[:, 0] + c * points[:, 1] + velocity[1] * view.late_s
    moved[:, 2] = points[:, 2] + height_m
    return Behind(moved, view.joint_x_m)


class JointOffset:
    """Learns by how much the joint's encoder is off, from what the map says of the rear hits."""

    def __init__(self) -> None:
        self.offset_rad = 0.0
        self._variance = _FIRST_STD_RAD**2

    def turned(self, seen: Behind) -> FloatArray:
        """Return the rear hits (N, 3) with the offset applied: turned about the joint."""
        c, s = math.cos(self.offset_rad), math.sin(self.offset_rad)
        x, y = seen.points[:, 0] - seen.joint_x_m, seen.points[:, 1]
        return np.column_stack([c * x - s * y + seen.joint_x_m, s * x + c * y, seen.points[:, 2]])

    def update(self, found: Match, hits: Hits, model: MatchModel, fine_m: float, joint_x_m: float) -> None:
        """Learn from one match."""
        slope, information = _joint_equation(found, hits, model, fine_m, joint_x_m)
        if information < _FEWEST_INFORMATION:
            return
        gain = self._variance / (self._variance + _SPREAD_RAD**2 + 1.0 / information)
        # The encoder's own zero counts, too: a map that bends by the odometry's drift looks like an offset.
        self.offset_rad += gain * (slope / information - _OWN_ZERO * self.offset_rad)
        self._variance = (1.0 - gain) * self._variance + _WANDER_RAD**2


@nb.njit(cache=True)
def _joint_equation(found, hits, model, fine_m, joint_x_m):  # type: ignore[no-untyped-def]
    """Return right side and information (1/rad²) of the least squares for a turn of the rear hits about the joint."""
    pose, points, lines = found.pose, hits.points, found.lines
    c, s = math.cos(pose[2]), math.sin(pose[2])
    slope = information = 0.0
    for i in range(hits.front, points.shape[0]):
        if lines[i, SERVED] == 0.0:
            continue
        rx, ry = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        nx, ny = lines[i, NORMAL_X], lines[i, NORMAL_Y]
        d = nx * (pose[0] + rx - lines[i, CENTRE_X]) + ny * (pose[1] + ry - lines[i, CENTRE_Y])
        d += slanted(hits, i, lines[i], c, s, nx, ny)
        incidence2 = (nx * rx + ny * ry) ** 2 / (rx * rx + ry * ry + 1e-12)
        w = line_weight(lines[i], d * d, incidence2, fine_m, model)[1]
        jt = -nx * (ry - s * joint_x_m) + ny * (rx - c * joint_x_m)
        slope -= w * jt * d
        information += w * jt * jt
    return slope, information

"""Distances of the bodies' sides to the walls on the left and on the right, from the hits of both scanners.

Scanners look ahead and behind, so that a wall is seen before or after it is beside the machine: hits are kept until the
machine has travelled past them, carried by wheels and joint (`path`). At each moment they are put into the frames of both
bodies, and the distance is taken across, from the sides of the boxes of the machine to the hits beside them. It holds at the
height of the scanners. The paper's least distances end at 0.10 m in most rows (a floor of its measure, it seems); these do not.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numba as nb
import numpy as np

from lhdmap.evaluation.navigation.drive import STANDING_MPS
from lhdmap.evaluation.navigation.path import Moment, WheelPath
from lhdmap.geometry.articulated import T_rear_base
from lhdmap.integration.self_filter import Rig, body_poses, in_boxes, rig_of
from lhdmap.machine import Machine
from lhdmap.messages import Float32Array, FloatArray, LaserScan, Mount
from lhdmap.scan_matching.scan_points import half_sweep_ns

_OWN_M = 0.10  # hits nearer to a box than this when they are seen are the machine itself
_REACH_M = 5.0  # across; a wall farther away is that of an opening
_SEEN_M = 12.0
_KEPT_EACH_M, _KEPT_MORE_M = 0.15, 6.0
_LOWEST_M, _OVER_M = 0.3, 0.3
_MOMENT_S = 0.1
_BIN_M, _BINS = 0.5, 64
_SUPPORT = 3  # hits: the third nearest counts, so that two lone ones do not
_COVERED = 0.5


class WallRow(NamedTuple):
    """A moment: distance to the left and to the right wall (NaN: none beside), share of each side that a wall was seen of."""

    time_s: float
    left_m: float
    right_m: float
    left_share: float
    right_share: float
    moving: bool


class _Block(NamedTuple):
    points_odom: FloatArray  # (N, 2)
    travelled_m: float


class _KeptHits:
    """Hits of both scanners that the machine, of a length, has not passed yet."""

    def __init__(self, length_m: float) -> None:
        self._length_m = length_m
        self._blocks: deque[_Block] = deque()
        self._kept_at_m: dict[str, float] = {}
        self._stretch = -1

    def add(self, frame: str, points: FloatArray, moment: Moment) -> None:
        """Keep hits of a scanner, where it has come far enough since the last ones."""
        if abs(moment.travelled_m - self._kept_at_m.get(frame, -np.inf)) >= _KEPT_EACH_M:
            self._kept_at_m[frame] = moment.travelled_m
            self._blocks.append(_Block(points, moment.travelled_m))

    def forget(self, moment: Moment) -> None:
        """Drop hits that are passed, and all of them after a gap."""
        if moment.stretch != self._stretch:
            self._stretch = moment.stretch
            self._blocks.clear()
            self._kept_at_m.clear()
        while self._blocks and moment.travelled_m - self._blocks[0].travelled_m > self._length_m + _KEPT_MORE_M:
            self._blocks.popleft()

    def points(self) -> list[FloatArray]:
        """Return the hits, (N, 2) each, in the frame of the path."""
        return [block.points_odom for block in self._blocks]


class _Sides(NamedTuple):
    """The machine in plan.

    `boxes_m` (N, 4): x and y from, x and y to; `on_rear` (N,): whether on the rear body; `begins_m` (2,): where the bins of
    each body begin; `bins`: how many both have together.
    """

    boxes_m: FloatArray
    on_rear: FloatArray
    begins_m: FloatArray
    bins: int


class WallGauge:
    """Takes scans in the order of the log; `rows` has the moments."""

    def __init__(self, path: WheelPath, machine: Machine, start_ns: int) -> None:
        self._path, self._machine, self._start_ns = path, machine, start_ns
        self._rigs: dict[str, Rig] = {}
        self._kept = _KeptHits(machine.dimensions.length_m)
        self._last_ranges: dict[str, Float32Array] = {}
        self.frozen = 0  # scans of a moving machine that said the same as the one before
        self._last_s = -np.inf
        self._sides = _sides_of(machine)
        self.rows: list[WallRow] = []

    def update(self, scan: LaserScan, mount: Mount) -> None:
        """Take one scan of either scanner."""
        time_s = (scan.stamp_ns + half_sweep_ns(scan) - self._start_ns) * 1e-9
        moment = self._path.at(time_s)
        if moment is None:
            return
        self._kept.forget(moment)
        if mount.child_frame not in self._rigs:
            self._rigs[mount.child_frame] = rig_of(mount, self._machine, _OWN_M)
        points = self._points(scan, self._rigs[mount.child_frame], moment)
        if self._is_frozen(scan, mount.child_frame, moment):
            points = points[:0]
        else:
            self._kept.add(mount.child_frame, points, moment)
        if time_s - self._last_s >= _MOMENT_S:
            self._last_s = time_s
            self.rows.append(self._row(time_s, moment, points))

    def _is_frozen(self, scan: LaserScan, frame: str, moment: Moment) -> bool:
        """Return whether a scanner repeats itself while the machine moves: its hits would be carried to wrong places."""
        last, self._last_ranges[frame] = self._last_ranges.get(frame), scan.ranges_m
        same = abs(moment.speed_mps) > STANDING_MPS and last is not None and np.array_equal(last, scan.ranges_m)
        self.frozen += int(same)
        return same

    def _points(self, scan: LaserScan, rig: Rig, moment: Moment) -> FloatArray:
        limits = np.array([scan.range_min_m, min(scan.range_max_m, _SEEN_M)])
        top_m = self._machine.dimensions.height_m + _OVER_M
        return _seen(
            np.asarray(scan.ranges_m), scan.angle_min_rad, scan.angle_increment_rad, limits, rig,
            moment.articulation_rad, moment.pose, top_m,
        )  # fmt: skip

    def _row(self, time_s: float, moment: Moment, points: FloatArray) -> WallRow:
        size, sides = self._machine.dimensions, self._sides
        every = np.concatenate([*self._kept.points(), points])
        joint = np.array([moment.articulation_rad, size.joint_to_front_axle_m, size.joint_to_rear_axle_m])
        left_m, right_m, left, right = _beside(every, moment.pose, joint, sides.boxes_m, sides.on_rear, sides.begins_m)
        shares = (float(left.sum()) / sides.bins, float(right.sum()) / sides.bins)
        return WallRow(time_s, left_m, right_m, *shares, abs(moment.speed_mps) > STANDING_MPS)


def wall_figures(rows: list[WallRow]) -> dict[str, float | None]:
    """Return ADLW, MDLW, ADRW, MDRW (m) of the moments in which the machine moves, and the share of them that the means hold.

    A mean takes the moments in which a wall was seen of at least half of the machine's side.
    """
    table = np.array([row[1:5] for row in rows if row.moving], dtype=float).reshape(-1, 4)
    found: dict[str, float | None] = {}
    for column, name in enumerate(("lw", "rw")):
        distance, share = table[:, column], table[:, column + 2]
        seen = distance[(share >= _COVERED) & np.isfinite(distance)]
        least = distance[np.isfinite(distance)]
        found[f"ad{name}_m"] = float(seen.mean()) if len(seen) else None
        found[f"md{name}_m"] = float(least.min()) if len(least) else None
        found[f"{name}_share"] = len(seen) / len(table) if len(table) else None
    return found


def _sides_of(machine: Machine) -> _Sides:
    both = [machine.boxes("base_link"), machine.boxes("rear_link")]
    boxes = np.concatenate(both)
    plan = np.column_stack([boxes[:, 0, :2], boxes[:, 1, :2]])
    on_rear = np.repeat([False, True], [len(one) for one in both])
    return _Sides(plan, on_rear, *_bins(plan, on_rear))


def _bins(boxes: FloatArray, on_rear: FloatArray) -> tuple[FloatArray, int]:
    """Return where the bins of each body begin (2,), m, and how many bins both have together."""
    begins, count = np.zeros(2), 0
    for body in (0, 1):
        own = boxes[on_rear == bool(body)]
        if len(own):
            begins[body] = own[:, 0].min()
            count += min(int(np.ceil((own[:, 2].max() - begins[body]) / _BIN_M)), _BINS)
    return begins, max(count, 1)


@nb.njit(cache=True, nogil=True)
def _seen(ranges_m, first_rad, step_rad, limits_m, rig, articulation_rad, pose, top_m):  # type: ignore[no-untyped-def]
    """Return hits, (N, 2), in the frame of the path: those at the machine's height that are not the machine itself."""
    T_base, T_rear = body_poses(rig, articulation_rad)
    c, s = np.cos(pose[2]), np.sin(pose[2])
    found = np.empty((len(ranges_m), 2))
    count = 0
    for i in range(len(ranges_m)):
        r = ranges_m[i]
        if not (limits_m[0] <= r <= limits_m[1]):
            continue
        angle = first_rad + i * step_rad
        x, y = r * np.cos(angle), r * np.sin(angle)
        z = T_base[2, 0] * x + T_base[2, 1] * y + T_base[2, 3]
        if not (_LOWEST_M <= z <= top_m):
            continue
        if in_boxes(T_base, rig.front_boxes, x, y, 0.0) or in_boxes(T_rear, rig.rear_boxes, x, y, 0.0):
            continue
        base_x = T_base[0, 0] * x + T_base[0, 1] * y + T_base[0, 3]
        base_y = T_base[1, 0] * x + T_base[1, 1] * y + T_base[1, 3]
        found[count, 0] = pose[0] + c * base_x - s * base_y
        found[count, 1] = pose[1] + s * base_x + c * base_y
        count += 1
    return found[:count].copy()


@nb.njit(cache=True, nogil=True)
def _beside(points, pose, joint, boxes, on_rear, begins):  # type: ignore[no-untyped-def]
    """Return the distance on the left and on the right, and which bins (2, `_BINS`) of each side have a hit beside them."""
    T = T_rear_base(joint[0], joint[1], joint[2])
    c, s = np.cos(pose[2]), np.sin(pose[2])
    nearest = np.full((2, _SUPPORT), np.inf)
    bins = np.zeros((2, 2, _BINS), dtype=np.bool_)
    for i in range(points.shape[0]):
        dx, dy = points[i, 0] - pose[0], points[i, 1] - pose[1]
        front_x, front_y = c * dx + s * dy, -s * dx + c * dy
        for b in range(boxes.shape[0]):
            x, y = front_x, front_y
            body = 0
            if on_rear[b]:
                x = T[0, 0] * front_x + T[0, 1] * front_y + T[0, 3]
                y = T[1, 0] * front_x + T[1, 1] * front_y + T[1, 3]
                body = 1
            if x < boxes[b, 0] or x > boxes[b, 2]:
                continue
            side, distance = (0, y - boxes[b, 3]) if y >= boxes[b, 3] else (1, boxes[b, 1] - y)
            if distance < 0.0 or distance > _REACH_M:
                continue
            row = int((x - begins[body]) / _BIN_M)
            if row < _BINS:
                bins[side, body, row] = True
            for k in range(_SUPPORT):
                if distance < nearest[side, k]:
                    nearest[side, k], distance = distance, nearest[side, k]
    last = _SUPPORT - 1
    left = nearest[0, last] if nearest[0, last] < np.inf else np.nan
    right = nearest[1, last] if nearest[1, last] < np.inf else np.nan
    return left, right, bins[0], bins[1]

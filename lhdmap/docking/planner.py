"""Ways to a dock: a word in the last gear, with sampled arcs before it; a search where that does not do."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lhdmap.docking.connect import Candidate, Shape, connected, shape_of, states_of, words_to
from lhdmap.docking.legs import legs_of
from lhdmap.docking.room import Room
from lhdmap.docking.search import CUSP_M, searched
from lhdmap.docking.settings import DockingSettings
from lhdmap.driving.model import DriveModel
from lhdmap.errors import InputError
from lhdmap.geometry.articulated import rear_axle
from lhdmap.messages import FloatArray
from lhdmap.tracking.equations import equilibrium
from lhdmap.tracking.reference import Curve

_ARCS_M = (2.5, 5.0, 7.5, 10.0, 13.0, 16.0, 20.0)
_TRIES = 150
_STAGES_M = (1.6, 0.6)  # of a search, and of the one after it, that gets out of corners
_RATE_SHARE = 0.8
_SAMPLED = 2
"""Changes of gear up to which ways are sampled; with more, and where these find none, they are searched."""


class DockPlan(NamedTuple):
    """Legs for `Tracker.follow_curve`, in order; none with a `reason`, before anything moves.

    `radius_m` of turns and last `straight_m` that were found room for; `length_m` of the whole way.
    """

    legs: tuple[Curve, ...]
    reason: str = ""
    radius_m: float = math.nan
    straight_m: float = math.nan
    length_m: float = math.nan

    @property
    def cusps(self) -> int:
        """Changes of gear."""
        return max(len(self.legs) - 1, 0)


def plan_dock(
    from_pose: FloatArray,
    dock_pose: FloatArray,
    room: Room,
    model: DriveModel,
    settings: DockingSettings,
    gear: int = -1,
) -> DockPlan:
    """Return a way from where the machine stands to a dock, the last leg in a gear: in reverse, if not said otherwise.

    `from_pose` (4,): x, y, heading of `base_link` and joint angle; `dock_pose` (3,) of `base_link`, the machine straight.

    Raises:
        InputError: a value is not finite.
    """
    if not (np.isfinite(from_pose).all() and np.isfinite(dock_pose).all()):
        raise InputError("poses of a dock's plan are finite")
    lengths = (model.front_m, model.rear_m)
    start = _rear(np.asarray(from_pose, dtype=np.float64), lengths)
    goal = _rear(np.append(np.asarray(dock_pose, dtype=np.float64)[:3], 0.0), lengths)
    shapes, reason = _shapes(start, goal, room, model, settings, gear)
    if reason:
        return DockPlan((), reason)
    for counts, shape in _order(shapes, min(settings.cusps, _SAMPLED)):
        moves = _sampled(start, goal, room, shape, gear, counts)
        if moves is not None:
            return _planned(start, moves, shape)
    told = ""
    for stage_m in _STAGES_M:
        limits = (settings.cusps, settings.nodes, stage_m)
        moves, told = searched(start, goal, room, shapes[-1], gear, limits)
        if moves is not None:
            return _planned(start, moves, shapes[-1])
    return DockPlan((), f"no way with {settings.cusps} changes of gear or less has room for both bodies: {told}")


def _planned(start: FloatArray, moves: FloatArray, shape: Shape) -> DockPlan:
    legs = legs_of(states_of(start, moves, shape), shape.lengths)
    return DockPlan(legs, "", shape.radius_m, shape.straight_m, float(moves[:, 2].sum()))


def _rear(pose: FloatArray, lengths: tuple[float, float]) -> FloatArray:
    """Return x, y, heading of the rear axle and joint angle (4,) of a pose of the front one."""
    x, y, heading, bend = pose.tolist()
    return np.array([*rear_axle(x, y, heading, bend, *lengths), bend])


def least_radius_m(model: DriveModel, share: float = 1.0) -> float:
    """Return the least radius (m) of the machine's turns, with a share of the joint's largest angle."""
    low, high = 0.2 * (model.front_m + model.rear_m), 100.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        bent = equilibrium(1.0 / middle, (model.front_m, model.rear_m))[4]
        low, high = (middle, high) if bent > share * model.max_articulation_rad else (low, middle)
    return high


def _shapes(
    start: FloatArray, goal: FloatArray, room: Room, model: DriveModel, settings: DockingSettings, gear: int
) -> tuple[list[Shape], str]:
    """Return the shapes that have room for their last straight, wide ones first, or why there is none."""
    if not room.free(start[None]):
        return [], "where the machine stands, its bodies do not fit on the apron"
    if not room.free(goal[None]):
        return [], "the dock has no room for both bodies on the apron"
    lengths = (model.front_m, model.rear_m)
    change = settings.joint_share * _RATE_SHARE * model.max_rate_rps / settings.speed_mps
    tightest = least_radius_m(model, settings.joint_share)
    radii = [
        max(share * least_radius_m(model), tightest) for share in (settings.radius_share, settings.least_radius_share)
    ]
    straights = [
        straight
        for straight in dict.fromkeys((settings.straight_m, min(settings.least_straight_m, settings.straight_m)))
        if room.free(_straight_to(goal, gear, straight))
    ]
    if not straights:
        return [], f"the last straight of {settings.least_straight_m:g} m before the dock has no room for both bodies"
    return [
        shape_of(radius, change, straight, lengths) for radius in dict.fromkeys(radii) for straight in straights
    ], ""


def _straight_to(goal: FloatArray, gear: int, straight_m: float) -> FloatArray:
    way = np.arange(0.0, straight_m + 0.3, 0.3)[:, None]
    place = goal[:2] - gear * way * np.array([math.cos(goal[2]), math.sin(goal[2])])
    return np.column_stack([place, np.full(len(way), goal[2]), np.zeros(len(way))])


def _order(shapes: list[Shape], cusps: int) -> Iterator[tuple[tuple[int, ...], Shape]]:
    """Yield what is tried in order: one change of gear at most with wide turns, then with tight ones, then two."""
    for counts in ((0, 1), (2,)):
        allowed = tuple(count for count in counts if count <= cusps)
        if allowed:
            yield from ((allowed, shape) for shape in shapes)


def _sampled(
    start: FloatArray, goal: FloatArray, room: Room, shape: Shape, gear: int, counts: tuple[int, ...]
) -> FloatArray | None:
    """Return the moves of the shortest way with these changes of gear, each worth some way, of those that are sampled."""
    candidates: list[tuple[float, Candidate]] = []
    for cusps in counts:
        for before in _prefixes(start, room, shape, gear, cusps):
            at = start if len(before) == 0 else states_of(start, before, shape)[-1][:4]
            found = words_to(at, goal, gear, shape, before)[:3]
            candidates += [(one.length_m + CUSP_M * cusps, one) for one in found]
    candidates.sort(key=lambda one: one[0])
    for _, candidate in candidates[:_TRIES]:
        moves = connected(candidate, goal, gear, shape)
        if moves is not None and room.free(states_of(start, moves, shape)):
            return moves
    return None


def _prefixes(
    start: FloatArray, room: Room, shape: Shape, gear: int, cusps: int, first: bool = True
) -> Iterator[FloatArray]:
    """Yield moves (K, 3) that lead to the last leg, as far as there is room.

    With one change of gear two arcs or straights before it, with more one in each gear.
    """
    if cusps == 0:
        yield np.zeros((0, 3))
        return
    for move, end in _arcs(start, room, shape, gear if cusps % 2 == 0 else -gear):
        for rest in _prefixes(end, room, shape, gear, cusps - 1, first=False):
            yield np.concatenate([move, rest])
        if cusps == 1 and first:
            for more, _ in _arcs(end, room, shape, -gear):
                if more[0, 1] != move[0, 1]:
                    yield np.concatenate([move, more])


def _arcs(start: FloatArray, room: Room, shape: Shape, gear: int) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield moves (1, 3) of one gear that have room, and where each ends (4,)."""
    for bend in (0.0, shape.bend_rad, -shape.bend_rad):
        way = states_of(start, np.array([[gear, bend, _ARCS_M[-1]]]), shape)
        missed = room.first_miss(way, 2)
        free_m = _ARCS_M[-1] if missed < 0 else abs(way[max(missed - 2, 0), 4])
        for length in _ARCS_M:
            if length > free_m:
                break
            yield np.array([[gear, bend, length]]), way[round(length / _ARCS_M[-1] * (len(way) - 1)), :4]

"""The arms of a junction: their axes, where they meet, and where along each the junction ends.

The axis of an arm is fitted to the middle between both walls beyond the junction's own room; the junction is where the axes meet
in the least-squares sense: the skeleton's branching point lies in the oblique branch, by up to 2.6 m. Along arm k it ends at

    s_k = max over the neighbours j of (h_j + h_k cos φ) / sin φ + cut_kj,

the corner of both walls (half widths h, angle φ), and where that corner is rounded off so that a machine can turn, the tangent of
the circle that rounds it: a gap g between the corner and the rock belongs to the radius ρ = g / (1 / sin(φ/2) - 1), and the
tangent begins ρ / tan(φ/2) beyond the corner.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.topology.corners import rounding_m
from lhdmap.topology.driven import arc_m
from lhdmap.topology.room import Room
from lhdmap.topology.skeleton import Line

_LOWEST_QUANTILE, _NARROW_QUANTILE, _BETWEEN = 0.05, 0.3, 1.12  # of widths; standard deviations between them
_SPREADS, _NARROW_M, _MOST_NARROW_M, _LEAST_STRAIGHT_M = 2.2, 0.35, 1.0, 4.0
FROM_RADII, FIT_M = 1.6, 15.0  # the axis is fitted from 1.6 R on, over so much,
_FIT_BENT_M, _BENT_M = 8.0, 0.35  # or, where the arm bends away by more than this, over less
_FEWEST_M = 2.0
_NEARLY_STRAIGHT_RAD = math.radians(9.0)  # neighbours that are one line have no corner between them
_FARTHEST_RADII = 1.3
_ROUNDS = 2
_PULL = 0.02  # weight of the skeleton's own place: where all axes are parallel


class Axis(NamedTuple):
    """An arm's straight beginning: unit vector `along` (2,) outward, a point (2,) on it, half width `half_m`; `fitted_m` long.

    `rough_m`: standard deviation of its walls.
    """

    along: FloatArray
    point_m: FloatArray
    half_m: float
    fitted_m: float
    rough_m: float = 0.12

    @property
    def heading_rad(self) -> float:
        """Direction outward."""
        return math.atan2(self.along[1], self.along[0])


def axis_of(line: Line, centre_m: FloatArray, radius_m: float, room: Room, far_radius_m: float = 0.0) -> Axis:
    """Return the axis of an arm whose `line` leaves a junction at `centre_m` (2,) with free radius `radius_m`.

    `far_radius_m`: that of the junction at its other end, 0 at a dead end. Where both leave no wall between them that is the arm's
    own, the axis goes to the other end, `fitted_m` is 0, and the half width is the least room.
    """
    away, along = np.linalg.norm(line.points_m - centre_m, axis=1), arc_m(line.points_m)
    outside = away > FROM_RADII * radius_m
    begin = float(along[int(np.argmax(outside))]) if outside.any() else float(along[-1])
    last = float(along[-1]) - FROM_RADII * far_radius_m
    if min(begin + FIT_M, last) - begin < _FEWEST_M or ((along >= begin) & (along <= last)).sum() < 3:
        return _chord(line, along, centre_m, room)
    for fit_m in (FIT_M, _FIT_BENT_M):
        axis, sag_m = _axis(_straight(line.points_m, along, (begin, last, fit_m), room), centre_m, room)
        if sag_m < _BENT_M:
            break
    return axis


def _chord(line: Line, along: FloatArray, centre_m: FloatArray, room: Room) -> Axis:
    """Return an arm without a wall of its own as the way to its end, with its least room."""
    direction = unit(line.points_m[-1] - centre_m)
    middle = line.points_m[len(along) // 4 : max(3 * len(along) // 4, len(along) // 4 + 1)]
    left, right = sides(middle, direction, room)
    return Axis(direction, centre_m, 0.5 * float((left + right).min()), 0.0)


def _axis(points: FloatArray, centre_m: FloatArray, room: Room) -> tuple[Axis, float]:
    """Return the axis through the middles between both walls at points (N, 2), and by how much they bend away from it (m)."""
    outward = points[-1] - centre_m
    for _ in range(_ROUNDS):
        direction, point = fitted(points, outward)
        left, right = sides(points, direction, room)
        points = points + 0.5 * (left - right)[:, None] * normal(direction)
    direction, point = fitted(points, outward)
    at, off = (points - point) @ direction, (points - point) @ normal(direction)
    length = float(np.ptp(at))
    sag = abs(float(np.polyfit(at, off, 2)[0])) * (0.5 * length) ** 2 if len(at) > 3 else 0.0
    return Axis(direction, point, 0.5 * float(np.median(left + right)), length, roughness_m(left, right)), sag


def _straight(points_m: FloatArray, along: FloatArray, span_m: tuple[float, float, float], room: Room) -> FloatArray:
    """Return points that lie between straight walls, the first ones: corners at the beginning, and mouths, are wider.

    `span_m`: where along the line one may begin, where it ends, and how long it is to be.
    """
    begin, last, fit_m = span_m
    looked = (along >= begin) & (along <= min(begin + 2.0 * fit_m, last))
    points, at = points_m[looked], along[looked]
    direction, _ = fitted(points, points[-1] - points[0])
    width = np.add(*sides(points, direction, room))
    narrow = is_narrow(width)
    chosen = narrow & (at <= at[narrow][0] + fit_m)
    if float(np.ptp(at[chosen])) < min(_LEAST_STRAIGHT_M, at[-1] - begin) or chosen.sum() < 3:
        chosen = at <= begin + fit_m
    return points[chosen]


def through(axis: Axis, middle_m: FloatArray, far_m: FloatArray) -> Axis:
    """Return an arm without walls of its own as the straight way from one junction's middle (2,) to the next (2,)."""
    return axis._replace(along=unit(far_m - middle_m), point_m=middle_m)


def meeting_m(axes: list[Axis], centre_m: FloatArray, radius_m: float) -> FloatArray:
    """Return where axes meet (2,), by least squares; `centre_m` (2,) is where they do by the skeleton, with this free radius.

    What lies far from there is no meeting: in a room arms have no axes.
    """
    normals = np.array([normal(axis.along) for axis in axes])
    weighted = np.array([min(axis.fitted_m / FIT_M, 1.0) ** 3 for axis in axes])[:, None] * normals
    offsets = (normals * np.array([axis.point_m for axis in axes])).sum(axis=1)
    A, b = _PULL * np.eye(2) + weighted.T @ normals, _PULL * centre_m + weighted.T @ offsets
    found: FloatArray = np.linalg.solve(A, b)
    return found if float(np.linalg.norm(found - centre_m)) <= _FARTHEST_RADII * radius_m + 0.5 else centre_m


def corner_m(own: Axis, other: Axis) -> float | None:
    """Return where along `own`, from the junction's middle, its wall meets that of `other`; None where both are one line."""
    angle = _between(own, other)
    if not _NEARLY_STRAIGHT_RAD < angle < math.pi - _NEARLY_STRAIGHT_RAD:
        return None
    return (other.half_m + own.half_m * math.cos(angle)) / math.sin(angle)


def reach_m(own: Axis, others: list[Axis], middle_m: FloatArray, room: Room | None = None) -> float:
    """Return where along `own` the junction ends; with `room`, rounded corners count as well."""
    found = []
    for other in neighbours(own, others):
        corner = corner_m(own, other)
        if corner is not None:
            found.append(corner + (0.0 if room is None else _cut_m(own, other, corner, middle_m, room)))
    return max(found, default=0.0)


def _cut_m(own: Axis, other: Axis, own_corner: float, middle_m: FloatArray, room: Room) -> float:
    """Return how far beyond the corner of two walls the rounding of that corner begins."""
    side = 1.0 if own.along[0] * other.along[1] - own.along[1] * other.along[0] > 0.0 else -1.0
    corner = middle_m + own_corner * own.along + side * own.half_m * normal(own.along)
    return rounding_m(corner, own.along, other.along, 0.5 * (own.rough_m + other.rough_m), room)


def neighbours(own: Axis, others: list[Axis]) -> list[Axis]:
    """Return the next arm on either side."""
    turns = [(other.heading_rad - own.heading_rad) % (2.0 * math.pi) for other in others]
    if not turns:
        return []
    return [others[int(np.argmin(turns))], others[int(np.argmax(turns))]]


def _between(a: Axis, b: Axis) -> float:
    return float(np.arccos(np.clip(a.along @ b.along, -1.0, 1.0)))


def fitted(points: FloatArray, outward: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return direction (2,) and middle (2,) of points (N, 2): total least squares, the farthest fifth left out once."""
    keep = np.ones(len(points), bool)
    for _ in range(2):
        middle: FloatArray = points[keep].mean(axis=0)
        direction: FloatArray = np.linalg.svd(points[keep] - middle, full_matrices=False)[2][0]
        off = np.abs((points - middle) @ normal(direction))
        keep = off <= max(float(np.quantile(off, 0.8)), 1e-9)
    if direction @ outward < 0.0:
        direction = -direction
    return direction, middle


def sides(points: FloatArray, direction: FloatArray, room: Room) -> tuple[FloatArray, FloatArray]:
    """Return the room (N,) to the left and to the right of points (N, 2)."""
    normals = np.broadcast_to(normal(direction), points.shape)
    return room.to_wall_m(points, normals), room.to_wall_m(points, -normals)


def is_narrow(width_m: FloatArray) -> npt.NDArray[np.bool_]:
    """Return where of widths (N,) a drift is as wide as it is, give or take its roughness, and not a mouth or a corner."""
    low, usual = np.quantile(width_m, [_LOWEST_QUANTILE, _NARROW_QUANTILE])
    spread = (usual - low) / _BETWEEN
    return np.asarray(width_m <= usual + float(np.clip(_SPREADS * spread, _NARROW_M, _MOST_NARROW_M)))


def roughness_m(left: FloatArray, right: FloatArray) -> float:
    """Return the standard deviation of walls from the room (N,) to both sides, whatever stands out alone."""
    return float(np.mean([1.4826 * np.median(np.abs(side - np.median(side))) for side in (left, right)]))


def normal(direction: FloatArray) -> FloatArray:
    """Return the unit vector (2,) to the left of a direction (2,)."""
    return np.array([-direction[1], direction[0]])


def unit(vector: FloatArray) -> FloatArray:
    """Return a vector (2,) scaled to length 1."""
    scaled: FloatArray = vector / max(float(np.linalg.norm(vector)), 1e-9)
    return scaled

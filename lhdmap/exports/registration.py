"""Where the map lies in the mine's grid: a rotation about the vertical and a shift, from control points known in both.

The map is levelled by gravity and its lengths are measured, so neither tilt nor scale is estimated: a scale that were fitted would
hide drift of the map. Frames: `map`, and `mine_grid` with x east, y north, z up (m).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from lhdmap.errors import InputError
from lhdmap.messages import FloatArray

GRID = "mine_grid"
STD_M = 0.03
"""Of a control point without one of its own. Assumed: a survey mark is known to 1-2 cm and found in the map to 2-3 cm."""
TOLERANCE_M = 0.10
"""Of residuals and leave-one-out errors. Assumed: three standard deviations of STD_M."""
FEWEST = 3
LARGEST_HEADING_STD_DEG = 0.5
"""Assumed: 0.9 m at the far end of 100 m of drift; a map turned worse than that is of no use in a mine's drawing."""
ACROSS_OVER_TOLERANCE = 5.0
"""How far from one line points must lie, in tolerances. Assumed: a mirrored map then misses them by several tolerances."""


class ControlPoint(NamedTuple):
    """One mark: `map_m` and `grid_m` (3,), x y z and easting, northing, elevation (m); `std_m` of their difference, per axis."""

    name: str
    map_m: FloatArray
    grid_m: FloatArray
    std_m: float = STD_M


class Transform(NamedTuple):
    """`p_grid = R(rotation) (p_map)` + `translation_m` (3,); the rotation is about the vertical, to the left (rad)."""

    rotation_rad: float
    translation_m: FloatArray

    def points(self, points_m: FloatArray) -> FloatArray:
        """Return points (…, 3) of the map in the grid, or (…, 2) of its plan."""
        turned = self.directions(points_m)
        turned += self.translation_m[: turned.shape[-1]]
        return turned

    def directions(self, vectors: FloatArray) -> FloatArray:
        """Return vectors (…, 3) or (…, 2), turned as the map is."""
        c, s = math.cos(self.rotation_rad), math.sin(self.rotation_rad)
        turned = np.array(vectors, dtype=np.float64)
        x, y = turned[..., 0].copy(), turned[..., 1].copy()
        turned[..., 0], turned[..., 1] = c * x - s * y, s * x + c * y
        return turned

    def pose(self, pose: FloatArray) -> FloatArray:
        """Return a pose (4,), x y z yaw, in the grid."""
        yaw = math.remainder(float(pose[3]) + self.rotation_rad, 2.0 * math.pi)
        return np.array([*self.points(pose[:3]), yaw])

    def inverse(self) -> Transform:
        """Return the way back, from the grid to the map."""
        back = Transform(-self.rotation_rad, np.zeros(3))
        return back._replace(translation_m=-back.directions(self.translation_m))


@dataclass(frozen=True, slots=True)
class Registration:
    """A map's place in the grid, the points that it rests on (N), and how well they fit.

    `residuals_m` (N, 3): what is left, east, north, up. `left_out_m` (N,): by how much each point is missed when the others alone
    fix the map. `scale`: what would have fitted best, if lengths could change. `heading_std_deg`: of the rotation.
    """

    T_grid_map: Transform
    points: tuple[ControlPoint, ...]
    residuals_m: FloatArray
    left_out_m: FloatArray
    scale: float
    scale_std: float
    heading_std_deg: float
    tolerance_m: float = TOLERANCE_M

    @property
    def misses_m(self) -> FloatArray:
        """Lengths (N,) of the residuals."""
        lengths: FloatArray = np.linalg.norm(self.residuals_m, axis=1)
        return lengths

    @property
    def rms_m(self) -> float:
        """Root mean square of the residuals' lengths."""
        return float(np.sqrt(np.mean(self.misses_m**2)))

    def to_json(self) -> dict[str, Any]:
        """Return what `lhdmap.registration` of a GeoJSON file holds."""
        rows = zip(self.points, self.residuals_m, self.misses_m, self.left_out_m, strict=True)
        return {
            "frame": GRID,
            "axes": ["east", "north", "up"],
            "rotation_deg": math.degrees(self.T_grid_map.rotation_rad),
            "translation_m": np.round(self.T_grid_map.translation_m, 6).tolist(),
            "rms_m": round(self.rms_m, 5),
            "max_residual_m": round(float(self.misses_m.max()), 5),
            "max_leave_one_out_m": round(float(self.left_out_m.max()), 5),
            "heading_std_deg": round(self.heading_std_deg, 5),
            "scale": 1.0,
            "scale_if_free": round(self.scale, 7),
            "tolerance_m": self.tolerance_m,
            "control_points": [
                {
                    "name": point.name,
                    "map_m": point.map_m.tolist(),
                    "grid_m": point.grid_m.tolist(),
                    "std_m": point.std_m,
                    "residual_m": np.round(residual, 5).tolist(),
                    "miss_m": round(float(miss), 5),
                    "leave_one_out_m": round(float(left_out), 5),
                }
                for point, residual, miss, left_out in rows
            ],
        }


def read_transform(member: Mapping[str, Any], where: str) -> Transform:
    """Return the transform of a map's member `registration`; `where` it stands is for the error.

    Raises:
        InputError: it is damaged.
    """
    try:
        rotation_rad, shift = math.radians(member["rotation_deg"]), np.array(member["translation_m"], dtype=float)
        marks = [one[key] for one in member.get("control_points", ()) for key in ("map_m", "grid_m") if one["name"]]
        numbers = np.array([shift, *marks], dtype=float)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{where}: its registration is damaged ({type(error).__name__}: {error})") from error
    if numbers.shape[1:] != (3,) or not np.isfinite([*numbers.ravel(), rotation_rad]).all():
        raise InputError(f"{where}: its registration is damaged (translations and points of three numbers were wanted)")
    return Transform(rotation_rad, shift)


def solve(map_m: FloatArray, grid_m: FloatArray, weights: FloatArray) -> Transform:
    """Return the weighted least-squares rotation about z and shift that take points (N, 3) of the map to the grid.

    Closed form: about the weighted centroids the best angle has the tangent sum w (p x q) / sum w (p . q) in plan; the shift takes
    centroid to centroid (Horn, "Closed-form solution of absolute orientation using unit quaternions", 1987; the axis is given).
    """
    p, q, middle, there = _centred(map_m, grid_m, weights)
    cross = weights @ (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])
    dot = weights @ (p[:, 0] * q[:, 0] + p[:, 1] * q[:, 1])
    turn = Transform(math.atan2(cross, dot), np.zeros(3))
    return turn._replace(translation_m=there - turn.directions(middle))


def register(points: Sequence[ControlPoint], tolerance_m: float = TOLERANCE_M) -> Registration:
    """Return the map's place in the grid and how well the points fit; whether that is good enough, `refuse_misfit` says.

    Raises:
        InputError: too few points, on one spot or line, or too near together for a heading.
    """
    _check(points, tolerance_m)
    map_m, grid_m = np.array([one.map_m for one in points]), np.array([one.grid_m for one in points])
    weights = np.array([one.std_m for one in points]) ** -2.0
    found = solve(map_m, grid_m, weights)
    p, q, _, _ = _centred(map_m, grid_m, weights)
    there = found.directions(p)
    in_plan, in_space = (
        float(weights @ (p[:, :n] ** 2).sum(axis=1)) for n in (2, 3)
    )  # information about heading and scale
    if math.degrees(in_plan**-0.5) > LARGEST_HEADING_STD_DEG:
        raise InputError(
            f"the control points are too near together: they fix the map's heading only to {math.degrees(in_plan**-0.5):.2f} deg "
            f"(standard deviation), at most {LARGEST_HEADING_STD_DEG:g} was wanted; take points farther apart"
        )
    scale = float(weights @ (there * q).sum(axis=1)) / in_space
    return Registration(
        found,
        tuple(points),
        there - q,
        _left_out(map_m, grid_m, weights),
        scale,
        _excess(scale * there - q, weights, 5) * in_space**-0.5,
        math.degrees(_excess(there - q, weights, 4) * in_plan**-0.5),
        tolerance_m,
    )


def _excess(residuals: FloatArray, weights: FloatArray, unknowns: int) -> float:
    """Return by how much residuals (N, 3) are larger than the points' standard deviations say, at least 1."""
    free = residuals.size - unknowns
    return math.sqrt(max(float(weights @ (residuals**2).sum(axis=1)) / free, 1.0))


def _centred(map_m: FloatArray, grid_m: FloatArray, weights: FloatArray) -> tuple[FloatArray, ...]:
    middle, there = weights @ map_m / weights.sum(), weights @ grid_m / weights.sum()
    return map_m - middle, grid_m - there, middle, there


def _left_out(map_m: FloatArray, grid_m: FloatArray, weights: FloatArray) -> FloatArray:
    """Return by how much each point (N,) is missed by what the others alone give (m)."""
    misses = np.zeros(len(map_m))
    for index in range(len(map_m)):
        rest = np.arange(len(map_m)) != index
        found = solve(map_m[rest], grid_m[rest], weights[rest])
        misses[index] = np.linalg.norm(found.points(map_m[index]) - grid_m[index])
    return misses


def _check(points: Sequence[ControlPoint], tolerance_m: float) -> None:
    """Refuse points that do not fix a map."""
    if len(points) < FEWEST:
        raise InputError(
            f"{len(points)} control points; {FEWEST} or more were wanted, two fit always and would check nothing"
        )
    for name in ("map_m", "grid_m"):
        spots = _spots(np.array([getattr(one, name)[:2] for one in points]), tolerance_m)
        if spots < FEWEST:
            raise InputError(
                f"the control points are at {spots} place{'s'[: spots - 1]} in plan ({name}); {FEWEST} or more were wanted"
            )
    across_m = min(_across_m(np.array([getattr(one, name)[:2] for one in points])) for name in ("map_m", "grid_m"))
    if across_m < ACROSS_OVER_TOLERANCE * tolerance_m:
        raise InputError(
            f"the control points lie on one line (within {across_m:.2f} m): a map that is mirrored, or has easting and northing "
            f"exchanged, would fit them as well; {ACROSS_OVER_TOLERANCE * tolerance_m:.2f} m beside it were wanted: add a point "
            "in another drift"
        )


def _spots(plan_m: FloatArray, apart_m: float) -> int:
    """Return at how many places points (N, 2) are; those nearer than `apart_m` to an earlier one count with it."""
    spots: list[FloatArray] = []
    for point in plan_m:
        if all(np.linalg.norm(point - other) > apart_m for other in spots):
            spots.append(point)
    return len(spots)


def _across_m(plan_m: FloatArray) -> float:
    """Return how far the farthest of points (N, 2) lies from the line that fits them best (m)."""
    centred = plan_m - plan_m.mean(axis=0)
    across = np.linalg.svd(centred, full_matrices=False)[2][1]
    return float(np.abs(centred @ across).max())

"""A drift as a plain cloud: does a slope close it from wall to wall, and where? No poses are needed, z must point up.

Slopes are stretches of the lowest surface whose normals agree. One of them is a pile where it rises from the floor, spans most
of the way between two walls that stand just before it, and nothing is seen behind it. All else (the foot of a rough wall, a
step, a ramp) is none.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.integration.normals import estimate_normals
from lhdmap.messages import FloatArray
from lhdmap.pile.bounds import BOUNDS
from lhdmap.pile.clouds.height_map import Mask
from lhdmap.pile.figure9.fit import face_plane, plane_inclination_deg, voxelised
from lhdmap.pile.result import PileEstimate
from lhdmap.pile.slope_status import status_probabilities

VOXEL_M = (0.2, 0.2, 0.1)
NORMAL_RADIUS_M = 0.75
_DRIFT_EXTENT_M, _SLENDER, _NETWORK_M = 8.0, 1.5, 16.0
_WALL_SHARE = 0.25
_LEAST_DENSE = 0.7
_STEEP_NZ, _SLOPE_NZ = 0.4, (0.2, 0.97)
_COLUMN_M, _LOWEST_M = 0.4, 1.0
_STEP_M = 0.45
_MOST_APART_DEG = 25.0
_FEWEST_POINTS = 40
_LEAST_HEIGHT_M, _LEAST_WIDTH_M, _WIDEST_M = 0.6, 1.5, 12.0
_BIN_M = 0.3
_LEAST_COVERED = 0.6
_STEEPEST_DEG = 66.0  # steeper, without a drive towards it, is the end of a drift like any other
_LEAST_WALL = 0.6
_BEFORE_M, _AROUND_M = 4.0, 15.0
_MODEL_STD_DEG = 2.0


class Shell(NamedTuple):
    """The cloud on the voxel grid: `points` (N, 3), `normals` (N, 3) with z upwards, `lowest` (N,): part of the lowest surface.

    `dense`: share of the voxels whose surroundings show a surface; only those are kept.
    """

    points: FloatArray
    normals: FloatArray
    lowest: Mask
    dense: float


class Slope(NamedTuple):
    """A slope in its own frame: `R` (3, 3) from the cloud's axes to x uphill, y to the left, z up; its points (K, 3) therein.

    `inclination_deg`: Table 6's sign; `floor_m`: z of the floor before it (of the lowest hits where it was not seen); `left_m`,
    `right_m`: y of the walls before it.
    """

    R: FloatArray
    points: FloatArray
    inclination_deg: float
    floor_m: float
    floor_seen: bool
    left_m: float
    right_m: float

    def x_at(self, z: FloatArray | float) -> FloatArray | float:
        """Return x of the face at height z."""
        center = np.median(self.points, axis=0)
        return center[0] + (z - center[2]) * self.run

    @property
    def run(self) -> float:
        """Horizontal length for each metre of height."""
        return -1.0 / math.tan(math.radians(self.inclination_deg))


def drift_shell(points_m: FloatArray) -> Shell | None:
    """Return the shell of points (N, 3), z up, where they are a drift: long, a quarter of the surface as steep as walls."""
    if not _is_long(points_m):
        return None
    shell = _shell(points_m)
    return shell if shell.dense > _LEAST_DENSE and _wall_share(shell) > _WALL_SHARE else None


def _is_long(points_m: FloatArray) -> bool:
    """Return whether points have the extent of a drift; what is as wide as long has to be a network of several."""
    along = points_m[:, :2] @ _principal(points_m[:, :2])
    length, width = sorted(np.ptp(along, axis=0).tolist(), reverse=True)
    return bool(length >= _DRIFT_EXTENT_M and (length >= _SLENDER * width or length >= _NETWORK_M))


def _principal(xy: FloatArray) -> FloatArray:
    """Return the principal axes of points (N, 2) as columns."""
    offset = xy - xy.mean(axis=0)
    axes: FloatArray = np.linalg.eigh(offset.T @ offset)[1]
    return axes


def measure_drift(shell: Shell) -> tuple[PileEstimate, dict[str, Any]]:
    """Return the pile that closes a drift, and further figures; status `none` with the reason where nothing does."""
    slopes = _slopes(shell)
    bounded = [slope for slope in (_bounded(shell, *one) for one in slopes) if slope is not None]
    closing = [slope for slope in bounded if slope.inclination_deg >= -_STEEPEST_DEG]
    share = _wall_share(shell)
    extra = {"kind": "drift", "wall_share": share, "slopes": len(slopes), "steep_ends": len(bounded) - len(closing)}
    if not closing:
        reason = (
            f"a drift ({100.0 * share:.0f} % of the surface is wall): {len(slopes)} slopes in it, none rises from the floor and "
            f"closes it from wall to wall at up to {_STEEPEST_DEG:.0f} deg"
        )
        return PileEstimate(warnings=(reason,)), extra | {"reason": reason}
    best = max(closing, key=lambda slope: len(slope.points))
    return _estimate(best), extra | {"reason": "", "closing_slopes": len(closing), "floor_m": best.floor_m}


def _shell(points_m: FloatArray) -> Shell:
    points = voxelised(points_m, VOXEL_M)
    normals = estimate_normals(points, NORMAL_RADIUS_M).normals.astype(np.float64)  # type: ignore[arg-type]
    known: Mask = np.asarray(normals.any(axis=1))
    dense = float(known.mean()) if len(known) else 0.0
    points, normals = points[known], normals[known]
    columns = np.floor(points[:, :2] / _COLUMN_M).astype(np.int64)
    _, place = np.unique(columns, axis=0, return_inverse=True)
    low = np.full(int(place.max(initial=-1)) + 1, np.inf)
    np.minimum.at(low, place, points[:, 2])
    return Shell(points, normals, points[:, 2] < low[place] + _LOWEST_M, dense)


def _wall_share(shell: Shell) -> float:
    return float(np.mean(np.abs(shell.normals[:, 2]) < _STEEP_NZ)) if len(shell.points) else 0.0


def _slopes(shell: Shell) -> list[tuple[FloatArray, FloatArray]]:
    """Return points (K, 3) and mean normal (3,) of each slope that is large enough to be a pile's face."""
    from scipy.sparse import coo_array
    from scipy.spatial import cKDTree

    nz = np.abs(shell.normals[:, 2])
    chosen = shell.lowest & (nz > _SLOPE_NZ[0]) & (nz < _SLOPE_NZ[1])
    points, normals = shell.points[chosen], shell.normals[chosen]
    if not len(points):
        return []
    pairs = cKDTree(points).query_pairs(_STEP_M, output_type="ndarray")
    both = np.concatenate([pairs, pairs[:, ::-1]])
    graph = coo_array((np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(len(points), len(points))).tocsr()
    regions = _regions(normals, graph.indptr, graph.indices)
    found = [(points[region], normals[region].mean(axis=0)) for region in regions]
    return [one for one in found if _is_large(*one)]


def _regions(
    normals: FloatArray, starts: npt.NDArray[np.int32], neighbours: npt.NDArray[np.int32]
) -> list[npt.NDArray[np.int64]]:
    """Return the points of each region: grown over neighbours whose normal is within 25 deg of the region's mean."""
    limit = math.cos(math.radians(_MOST_APART_DEG))
    free = np.ones(len(normals), dtype=bool)
    degree = np.diff(starts)
    regions = []
    for seed in np.argsort(-degree, kind="stable").tolist():
        if not free[seed]:
            continue
        free[seed] = False
        region, total = [seed], normals[seed].copy()
        for at in region:
            near = neighbours[starts[at] : starts[at + 1]]
            near = near[free[near]]
            near = near[normals[near] @ total >= limit * np.linalg.norm(total)]
            free[near] = False
            region.extend(near.tolist())
            total += normals[near].sum(axis=0)
        if len(region) >= _FEWEST_POINTS:
            regions.append(np.array(region))
    return regions


def _is_large(points: FloatArray, normal: FloatArray) -> bool:
    local = points @ _uphill(normal).T
    low, high = np.percentile(local, [3.0, 97.0], axis=0)
    return bool(high[2] - low[2] >= _LEAST_HEIGHT_M and high[1] - low[1] >= _LEAST_WIDTH_M)


def _uphill(normal: FloatArray) -> FloatArray:
    """Return R (3, 3) from the cloud's axes to x uphill, y left, z up."""
    heading = math.atan2(-normal[1], -normal[0])
    return _turn(heading)


def _turn(heading: float) -> FloatArray:
    c, s = math.cos(heading), math.sin(heading)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def _bounded(shell: Shell, points: FloatArray, normal: FloatArray) -> Slope | None:
    """Return the slope with floor and walls where it closes the drift, None where it does not."""
    R = _uphill(normal)
    askew = float(face_plane(points @ R.T)[1])
    R = _turn(-math.atan(askew)) @ R if math.isfinite(askew) else R
    face = points @ R.T
    inclination = plane_inclination_deg(face)
    if not -89.0 < inclination < -5.0:
        return None
    middle = np.median(face, axis=0)
    near = np.linalg.norm(shell.points[:, :2] - (R.T @ middle)[:2], axis=1) < _AROUND_M
    around = Shell(shell.points[near] @ R.T, shell.normals[near] @ R.T, shell.lowest[near], shell.dense)
    slope = Slope(R, face, inclination, math.nan, False, math.nan, math.nan)
    before = around.points[:, 0] - slope.x_at(around.points[:, 2])
    floor_m, seen = _floor(around, before, middle)
    slope = slope._replace(floor_m=floor_m, floor_seen=seen)
    left, right = (_wall(around, before, slope.floor_m, side * middle[1], side) for side in (1.0, -1.0))
    if left is None or right is None or left + right > _WIDEST_M:
        return None
    slope = slope._replace(left_m=middle[1] + left, right_m=middle[1] - right)
    return slope if _closes(slope, around, before) else None


def _floor(around: Shell, before: FloatArray, middle: FloatArray) -> tuple[float, bool]:
    """Return z of the floor before the face, and whether it was seen; a level or tilted 2D scanner may only see above it."""
    near = (before > -_BEFORE_M) & (np.abs(around.points[:, 1] - middle[1]) < 1.5)
    level = around.lowest & (np.abs(around.normals[:, 2]) > 0.94) & near & (before < -0.3)
    if np.count_nonzero(level) >= 20:
        return float(np.median(around.points[level, 2])), True
    return float(np.percentile(around.points[near & (before < 0.5), 2], 1.0)), False


def _wall(around: Shell, before: FloatArray, floor_m: float, middle: float, side: float) -> float | None:
    """Return the distance of the nearest wall on a side; None where it does not accompany the last metres before the face."""
    height = around.points[:, 2] - floor_m
    away = side * around.points[:, 1] - middle
    wall = (np.abs(around.normals[:, 1]) > 0.6) & (height > 0.3) & (height < 1.6) & (away > 0.5)
    at_face = away[wall & (before > -2.0) & (before < -0.1)]
    if len(at_face) < 8:
        return None
    nearest = float(np.percentile(at_face, 10.0))
    distance = float(np.median(at_face[at_face < nearest + 0.6]))
    along = before[wall & (np.abs(away - distance) < 0.8)]
    seen = np.histogram(along, np.arange(-_BEFORE_M, 0.0, 0.5))[0] >= 2
    return distance if seen.mean() >= _LEAST_WALL else None


def _closes(slope: Slope, around: Shell, before: FloatArray) -> bool:
    """Return whether the slope rises from the floor, ends at the walls, covers the width, and is open before and shut behind."""
    low, high = np.percentile(slope.points[:, 2], [3.0, 97.0]) - slope.floor_m
    y = slope.points[:, 1]
    between = float(np.mean((y > slope.right_m - 0.5) & (y < slope.left_m + 0.5)))
    edges = np.arange(slope.right_m + 0.3, slope.left_m - 0.3 + 1e-9, _BIN_M)
    if len(edges) < 4 or not -0.5 < low < 0.7 or high < _LEAST_HEIGHT_M or between < 0.9:
        return False
    covered = np.histogram(y, edges)[0] >= 2
    height = around.points[:, 2] - slope.floor_m
    behind = (before > 1.5) & (before < 6.0) & (height > 0.2) & (height < 1.2)
    ahead = (before < -0.8) & (before > -_BEFORE_M) & (height > 0.5) & (height < 1.5)
    past, blocked = (np.histogram(around.points[where, 1], edges)[0] >= 3 for where in (behind, ahead))
    return bool(covered.mean() >= _LEAST_COVERED and past.mean() <= 0.3 and blocked.mean() <= 0.3)


def _estimate(slope: Slope) -> PileEstimate:
    points, width = slope.points, slope.left_m - slope.right_m
    residuals = (slope.x_at(points[:, 2]) - points[:, 0]) * -math.sin(math.radians(slope.inclination_deg))
    share = status_probabilities(slope.inclination_deg, _MODEL_STD_DEG, BOUNDS)
    y = np.linspace(slope.left_m, slope.right_m, 15)
    toe = np.column_stack([np.full(15, slope.x_at(slope.floor_m)), y, np.full(15, slope.floor_m)]) @ slope.R
    top = float(np.percentile(points[:, 2], 97.0)) - slope.floor_m
    volume = 0.5 * slope.run * top * top * width
    return PileEstimate(
        status=max(share, key=lambda name: share[name]),
        probabilities=share,
        center_m=np.median(points, axis=0) @ slope.R,
        left_limit_m=toe[0],
        right_limit_m=toe[-1],
        width_m=width,
        width_std_m=0.15,
        inclination_deg=slope.inclination_deg,
        inclination_std_deg=_MODEL_STD_DEG,
        volume_m3=volume,
        volume_std_m3=0.25 * volume,
        toe_m=toe,
        face_m=points @ slope.R,
        residuals_m=residuals,
        warnings=() if slope.floor_seen else ("the floor before the pile was not seen: its toe is at the lowest hits",),
    )

"""The paper's pile identification (autonomous loading, Fig. 9) on an integrated cloud, to the letter or repaired.

As printed it does not find piles in clean data, and that is kept: "curvature" is the surface variation, at most 1/3, and 0.05
of it needs a roughness of 12 cm over 0.75 m. `RepairedConstants` hold what works. Bounds: as printed `max_y` and `min_y` of a
point set, which one stray point moves (erratum to section 3.2); `bound_share` is the robust form.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.integration.normals import estimate_normals
from lhdmap.messages import FloatArray
from lhdmap.pile.figure9.fit import largest_cluster, plane_inclination_deg, voxelised
from lhdmap.pile.figure9.settings import Figure9Constants
from lhdmap.pile.result import PileEstimate
from lhdmap.pile.slope_status import status_of

Mask = npt.NDArray[np.bool_]
_TOE_BIN_M = 0.3
_END_M = 15.0
"""The drift's heading is that of its walls over the last metres that are seen."""


class Segmentation(NamedTuple):
    """What the filters leave.

    `points_map` (N, 3): the voxel grid; `normals` (N, 3): towards the machine, zero where unknown; `curvature` (N,);
    `neighbours` (N,): count by which points were judged, 0 for those removed before; `pile` (N,): which remain;
    `heading_rad`: of the axis that n_y is across (0: the map's own).
    """

    points_map: FloatArray
    normals: FloatArray
    curvature: FloatArray
    neighbours: npt.NDArray[np.int64]
    pile: Mask
    heading_rad: float


def figure9(points_m: FloatArray, T_map_base: FloatArray, constants: Figure9Constants | None = None) -> PileEstimate:
    """Return the pile in an integrated cloud by Fig. 9; status `none` where fewer than `points_min` points remain.

    Args:
        points_m: shape (N, 3), metres, in `map`, without hits on the machine itself; with or without voxel grid.
        T_map_base: shape (4, 4), where the machine is now; normals are turned towards it.
        constants: as printed by default; `RepairedConstants()` for those that work.
    """
    chosen = constants or Figure9Constants()
    found = segment(points_m, T_map_base, chosen)
    if np.count_nonzero(found.pile) < chosen.points_min:
        return PileEstimate(face_m=found.points_map[found.pile])
    return _estimate(found, T_map_base, chosen)


def segment(points_m: FloatArray, T_map_base: FloatArray, constants: Figure9Constants) -> Segmentation:
    """Return what the filters of Fig. 9 leave of a cloud; arguments as in `figure9`."""
    points = voxelised(np.asarray(points_m, dtype=np.float64).reshape(-1, 3), constants.voxel_size_m)
    normals, curvature, counts = _described(points, constants.normal_radius_m, _viewpoint(T_map_base, constants))
    heading = drift_heading_rad(points, normals, T_map_base) if constants.axes == "drift" else 0.0
    ny = normals @ np.array([-math.sin(heading), math.cos(heading), 0.0])
    # A point without a normal has too few neighbours to be anything; zero would pass as "faces the machine".
    left = normals.any(axis=1) & (np.abs(ny) <= constants.ny_max)
    if constants.roughness == "curvature":
        left &= (curvature >= constants.curvature_min) & (curvature <= constants.curvature_max)
    else:
        left &= np.abs(normals[:, 2]) < constants.nz_max
    neighbours = _counts(points, left, counts, constants)
    left &= neighbours >= constants.neighbours_min
    if constants.cluster_gap_m > 0.0:
        left[left] = largest_cluster(points[left], constants.cluster_gap_m)
    return Segmentation(points, normals, curvature, neighbours, left, heading)


def loop_ends(estimate: PileEstimate, T_map_base: FloatArray, constants: Figure9Constants) -> bool:
    """Return whether the loop of Fig. 9 ends here: enough points (as printed), or the centre is within the deadline.

    The gravity centre of what is left counts from the first point on, also while it is no pile yet.
    """
    if not len(estimate.face_m):
        return False
    if not constants.waits and len(estimate.face_m) >= constants.points_min:
        return True
    return distance_to_center_m(estimate, T_map_base) <= constants.deadline_m


def distance_to_center_m(estimate: PileEstimate, T_map_base: FloatArray) -> float:
    """Return the distance from the machine to the gravity centre (cx, cy, cz), metres; inf without any point."""
    if not len(estimate.face_m):
        return math.inf
    return float(np.linalg.norm(estimate.face_m.mean(axis=0) - T_map_base[:3, 3]))


def mean_normal_inclination_deg(points_m: FloatArray, radius_m: float, viewpoint_m: FloatArray) -> float:
    """Return atan2(n_x, n_z) of the average normal in degrees: floor 0, pile -50, wall -90 (Table 6's sign).

    Normals are those of the points (N, 3) among themselves, within `radius_m`, towards `viewpoint_m` (3,); x points into the
    pile. With the floor's and the walls' points among them the result would be 24 to 36 deg off.
    """
    normals, _, _ = _described(points_m, radius_m, viewpoint_m)
    mean = normals.sum(axis=0)
    return math.degrees(math.atan2(mean[0], mean[2])) if mean.any() else math.nan


def drift_heading_rad(points_m: FloatArray, normals: FloatArray, T_map_base: FloatArray) -> float:
    """Return the heading of the drift's last metres: the direction that its walls' normals have least of.

    Points (N, 3) with normals (N, 3) that are steep and no farther than 15 m from the end of what is seen ahead; the
    machine's own heading where there are none.
    """
    ahead = T_map_base[:2, 0] / max(float(np.linalg.norm(T_map_base[:2, 0])), 1e-9)
    own = math.atan2(ahead[1], ahead[0])
    along = (points_m[:, :2] - T_map_base[:2, 3]) @ ahead
    walls = (np.abs(normals[:, 2]) < 0.5) & normals.any(axis=1) & (along > 0.0)
    if not walls.any():
        return own
    walls &= along > np.quantile(along[walls], 0.98) - _END_M
    across = normals[walls, :2]
    _, vectors = np.linalg.eigh(across.T @ across)
    axis = vectors[:, 0] if vectors[:, 0] @ ahead >= 0.0 else -vectors[:, 0]
    return math.atan2(axis[1], axis[0]) if axis @ ahead > math.cos(math.radians(60.0)) else own


def _described(
    points: FloatArray, radius_m: float, viewpoint: FloatArray
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.int64]]:
    """Return normals (N, 3), surface variation (N,) and numbers of neighbours (N,) of points among themselves."""
    views = np.broadcast_to(viewpoint, points.shape)
    found = estimate_normals(points, radius_m, views)  # type: ignore[arg-type]  # taken as float64 there
    return found.normals.astype(np.float64), found.curvature.astype(np.float64), found.neighbours.astype(np.int64)


def _viewpoint(T_map_base: FloatArray, constants: Figure9Constants) -> FloatArray:
    view: FloatArray = T_map_base[:3, 3] + constants.view_height_m * T_map_base[:3, 2]
    return view


def _counts(
    points: FloatArray, left: Mask, counts: npt.NDArray[np.int64], constants: Figure9Constants
) -> npt.NDArray[np.int64]:
    """Return the neighbours (without the point itself) of the points that are left, 0 for all others."""
    if constants.neighbours_in == "cloud":
        return np.where(left, counts, 0)
    found = np.zeros(len(points), dtype=np.int64)
    if left.any():
        found[left] = _described(points[left], constants.normal_radius_m, points[left][0])[2]
    return found


def _estimate(found: Segmentation, T_map_base: FloatArray, constants: Figure9Constants) -> PileEstimate:
    """Return centre, bounds, slope and status of the pile's points."""
    R_map_axes = _rotation(found.heading_rad)
    face = found.points_map[found.pile]
    in_axes = face @ R_map_axes
    right, left = _bounds(in_axes, constants.bound_share)
    if constants.slope_from == "normals":
        viewpoint = _viewpoint(T_map_base, constants) @ R_map_axes
        inclination = mean_normal_inclination_deg(in_axes, constants.slope_radius_m, viewpoint)
    else:
        inclination = plane_inclination_deg(in_axes)
    status = status_of(inclination, constants.bounds)
    return PileEstimate(
        status=status,
        probabilities={status: 1.0},
        center_m=face.mean(axis=0),
        left_limit_m=R_map_axes @ left,
        right_limit_m=R_map_axes @ right,
        width_m=float(left[1] - right[1]),
        inclination_deg=inclination,
        toe_m=_toe(in_axes) @ R_map_axes.T,
        face_m=face,
        residuals_m=_residuals(in_axes, inclination),
    )


def _rotation(heading_rad: float) -> FloatArray:
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def _bounds(points: FloatArray, share: float) -> tuple[FloatArray, FloatArray]:
    """Return E_R and E_L, shape (3,) each: the points at which y is least and most, `share` of all left out at each end."""
    order = np.argsort(points[:, 1], kind="stable")
    skipped = int(share * len(points))
    return points[order[skipped]], points[order[len(points) - 1 - skipped]]


def _toe(points: FloatArray) -> FloatArray:
    """Return the lowest point of each strip across the pile, shape (K, 3), from left to right."""
    strips = np.floor(points[:, 1] / _TOE_BIN_M).astype(np.int64)
    order = np.lexsort((points[:, 2], -strips))
    first = np.concatenate([[True], np.diff(strips[order]) != 0])
    return points[order[first]]


def _residuals(points: FloatArray, inclination_deg: float) -> FloatArray:
    """Return how far points stand out of the plane through their centre with that inclination, shape (N,), metres."""
    angle = math.radians(inclination_deg)
    normal = np.array([math.sin(angle), 0.0, math.cos(angle)])
    out: FloatArray = (points - points.mean(axis=0)) @ normal
    return out

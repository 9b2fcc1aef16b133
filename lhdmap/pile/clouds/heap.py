"""A pile in a plain cloud (PLY, PCD, LAS, LAZ): no poses, no time; slopes of its faces, volume, and whether it is a pile at all.

A heap seen from above becomes a height map; a drift (walls on both sides) is searched for what closes it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lhdmap.errors import InputError
from lhdmap.integration.cloud_io import read_cloud
from lhdmap.messages import FloatArray
from lhdmap.pile.bounds import BOUNDS
from lhdmap.pile.clouds.axes import isolated, rotation_to_up, vertical_axis
from lhdmap.pile.clouds.cells import outline_m2, with_holes_filled
from lhdmap.pile.clouds.faces import HeapFace, find_faces
from lhdmap.pile.clouds.floor import HeapFloor, find_floor
from lhdmap.pile.clouds.height_map import HeightMap, Mask, height_map
from lhdmap.pile.result import AttackPoint, Boulder, PileEstimate
from lhdmap.pile.slope_status import status_probabilities

FEWEST_POINTS = 200
_LEAST_RISE = 0.02
_LIMIT_SHARE = 0.02
_LYING = ("too_shallow", "loadable")
_PLACES = ("center_m", "left_limit_m", "right_limit_m", "toe_m", "face_m")


class CloudPile(NamedTuple):
    """What was found in a plain cloud: the estimate in the cloud's own axes, and the further figures for people and JSON."""

    estimate: PileEstimate
    extra: dict[str, Any]


class MeasuredHeap(NamedTuple):
    """A heap with z up: its height map, the floor, the cells (I, J) that hold material, and its faces, the largest first."""

    surface: HeightMap
    floor: HeapFloor
    material: Mask
    faces: list[HeapFace]

    @property
    def above_m(self) -> FloatArray:
        """Height of each cell above the floor, shape (I, J), metres; NaN where nothing was seen."""
        above: FloatArray = self.surface.height_m - self.floor.at(self.surface.centers_m())
        return above


def run_cloud(path: Path, up: str = "auto", floor: Path | None = None) -> CloudPile:
    """Read a cloud file and measure its pile.

    Args:
        path: PLY, PCD, LAS or LAZ file.
        up: which of its axes points up: x, y, z, -x, -y, -z, or auto.
        floor: a cloud of the same place without the pile, in the same frame; volumes are then those above it.

    Raises:
        InputError: a file cannot be read or holds too few points.
        UsageError: the axis has no such name.
    """
    points_m, origin_m = _points(path)
    if floor is None:
        return _placed(measure_cloud(points_m, up), origin_m)
    floor_m, floor_origin_m = _points(floor)
    return _placed(measure_cloud(points_m, up, floor_m + (floor_origin_m - origin_m)), origin_m)


def measure_cloud(points_m: FloatArray, up: str = "auto", empty_m: FloatArray | None = None) -> CloudPile:
    """Return the pile in a cloud.

    Args:
        points_m: shape (N, 3), metres, in any frame whose `up` axis is roughly vertical.
        up: as in `run_cloud`.
        empty_m: shape (M, 3), the same place without the pile.

    Raises:
        InputError: fewer than 200 points.
        UsageError: the axis has no such name.
    """
    from lhdmap.pile.clouds.drift import drift_shell, measure_drift
    from lhdmap.pile.clouds.drift_rocks import with_rocks

    if len(points_m) < FEWEST_POINTS:
        raise InputError(f"the cloud has {len(points_m)} points; at least {FEWEST_POINTS} were wanted")
    axis = vertical_axis(points_m) if up == "auto" else up
    R_up_cloud = rotation_to_up(axis)
    points = np.asarray(points_m, dtype=np.float64) @ R_up_cloud.T
    shell = drift_shell(points)
    if shell is not None:
        estimate, figures = measure_drift(shell)
        estimate = with_rocks(estimate, points) if estimate.found else estimate
    else:
        lonely = isolated(points)
        floor = None if empty_m is None else _floor_of(np.asarray(empty_m, dtype=np.float64) @ R_up_cloud.T)
        estimate, figures = measure_heap(points[~lonely], floor)
        figures |= {"isolated_points": int(np.count_nonzero(lonely))}
    extra = {"up": axis, "up_was_given": up != "auto", "cloud_points": len(points)}
    return CloudPile(_turned(estimate, R_up_cloud.T), extra | figures)


def measure_heap(points_m: FloatArray, floor: HeapFloor | None = None) -> CloudPile:
    """Return slopes, volume and status of a heap from points (N, 3), z up; above `floor`, or above that which is found."""
    surface = height_map(points_m)
    ground = floor or find_floor(points_m, surface)
    heap = MeasuredHeap(surface, ground, np.zeros(surface.seen.shape, dtype=bool), [])
    rise = _least_rise_m(surface, ground)
    material = surface.seen & ~surface.walls & (np.nan_to_num(heap.above_m) > rise)
    heap = heap._replace(material=material, faces=find_faces(surface, material))
    if np.count_nonzero(material) < 0.05 * np.count_nonzero(surface.seen & ~surface.walls):
        reason = f"flat: nothing of note rises more than {rise:.3g} m above its floor"
        return CloudPile(_without_face(heap, points_m, reason), _extra(heap, points_m, "flat", reason))
    if not heap.faces:
        reason = "material, but no face: the surface is rough everywhere, and no drift is seen around it"
        volume, volume_std = volume_m3(heap, points_m)
        unknown = replace(PileEstimate.unknown(reason), volume_m3=volume, volume_std_m3=volume_std)
        return CloudPile(unknown, _extra(heap, points_m, "rough", reason))
    estimate = _estimate(heap, points_m)
    if estimate.status in _LYING:
        return CloudPile(estimate, _extra(heap, points_m, "heap", ""))
    reason = (
        f"the largest face stands at {heap.faces[0].slope_deg:.0f}°, steeper than what lies loose, and no drift is seen around "
        "it: whether that is a pile, a wall or something else cannot be said"
    )
    extra = _extra(heap, points_m, "steep", reason) | {"volume_m3": None, "volume_std_m3": None}
    return CloudPile(PileEstimate.unknown(reason), extra)


def volume_m3(heap: MeasuredHeap, points_m: FloatArray) -> tuple[float, float]:
    """Return the volume between floor and visible surface with its standard deviation, m³.

    Cells at the edge of the cloud are covered in part: the area is that of the convex outline where it is smaller. Holes are
    filled with the mean height about them (half of that counts as uncertain).
    """
    seen = heap.surface.seen & ~heap.surface.walls
    filled, holes = with_holes_filled(np.where(seen, np.clip(heap.above_m, 0.0, None), np.nan))
    cells = filled[np.isfinite(filled)]
    area = len(cells) * heap.surface.cell_m**2
    share = min(1.0, outline_m2(points_m) / area) if area else 0.0
    volume = float(cells.sum()) * heap.surface.cell_m**2 * share
    hidden = float(filled[holes].sum()) * heap.surface.cell_m**2
    rough = float(np.nanmedian(heap.surface.roughness_m)) if np.isfinite(heap.surface.roughness_m).any() else 0.0
    noise = rough * heap.surface.cell_m * math.sqrt(area)  # a cell's height errs by no more than its roughness
    return volume, math.sqrt((area * share * heap.floor.std_m) ** 2 + (0.5 * hidden) ** 2 + noise**2)


def _points(path: Path) -> tuple[FloatArray, FloatArray]:
    """Return the points of a file about an origin (3,) near them, and that origin: a national grid's numbers are large."""
    cloud = read_cloud(path)
    if len(cloud) < FEWEST_POINTS:
        raise InputError(f"{path}: {len(cloud)} points; at least {FEWEST_POINTS} were wanted for a pile")
    return cloud.points_m.astype(np.float64), np.array(cloud.origin_m)


def _placed(found: CloudPile, origin_m: FloatArray) -> CloudPile:
    """Return what was measured about an origin (3,) in the coordinates of the file."""
    if not origin_m.any():
        return found
    pile, extra = found.estimate, dict(found.extra)
    places = {name: getattr(pile, name) + origin_m for name in _PLACES}
    rocks = tuple(rock._replace(center_m=rock.center_m + origin_m) for rock in pile.boulders)
    attack = pile.attack._replace(point_m=pile.attack.point_m + origin_m) if pile.attack else None
    if "floor_m" in extra:
        extra["floor_m"] += float((rotation_to_up(extra["up"]) @ origin_m)[2])
    return CloudPile(replace(pile, boulders=rocks, attack=attack, **places), extra)


def _floor_of(points_m: FloatArray) -> HeapFloor:
    points = points_m[~isolated(points_m)]
    return find_floor(points, height_map(points))._replace(source="the cloud without the pile")


def _least_rise_m(surface: HeightMap, floor: HeapFloor) -> float:
    """Return the height above the floor from which on a cell holds material: three deviations, or 2 % of the extent."""
    rough = surface.roughness_m[np.isfinite(surface.roughness_m)]
    noise = float(np.percentile(rough, 20.0)) if len(rough) else 0.0
    return max(3.0 * noise, 3.0 * min(floor.std_m, noise), _LEAST_RISE * surface.cell_m * max(surface.seen.shape))


def _without_face(heap: MeasuredHeap, points_m: FloatArray, reason: str) -> PileEstimate:
    volume, volume_std = volume_m3(heap, points_m)
    return PileEstimate(volume_m3=volume, volume_std_m3=volume_std, warnings=(reason,))


def _estimate(heap: MeasuredHeap, points_m: FloatArray) -> PileEstimate:
    volume, volume_std = volume_m3(heap, points_m)
    face = heap.faces[0]
    share = status_probabilities(-face.slope_deg, face.slope_std_deg, BOUNDS)
    toe, left, right = _toe(heap, face)
    points = _cell_points(heap, face.cells)
    return PileEstimate(
        status=max(share, key=lambda name: share[name]),
        probabilities=share,
        center_m=_center(heap, face.cells),
        left_limit_m=left,
        right_limit_m=right,
        width_m=float(np.hypot(*(left - right)[:2])),
        width_std_m=2.0 * heap.surface.cell_m,
        inclination_deg=-face.slope_deg,
        inclination_std_deg=face.slope_std_deg,
        volume_m3=volume,
        volume_std_m3=volume_std,
        toe_m=toe,
        face_m=points,
        residuals_m=heap.surface.roughness_m[face.cells],
    )


def _cell_points(heap: MeasuredHeap, cells: Mask) -> FloatArray:
    points: FloatArray = np.column_stack([heap.surface.centers_m()[cells], heap.surface.height_m[cells]])
    return points


def _center(heap: MeasuredHeap, cells: Mask) -> FloatArray:
    center: FloatArray = _cell_points(heap, cells).mean(axis=0)
    return center


def _toe(heap: MeasuredHeap, face: HeapFace) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the face's lowest cells from left to right (K, 3), and the left and right ends (3,) of the face at the toe.

    Left and right are those of one who stands before the face and looks uphill.
    """
    points = _cell_points(heap, face.cells)
    down = np.array([math.cos(face.downhill_rad), math.sin(face.downhill_rad)])
    to_left = np.array([down[1], -down[0]])
    across, along = points[:, :2] @ to_left, points[:, :2] @ down
    strips = np.floor((across - across.min()) / (2.0 * heap.surface.cell_m)).astype(int)
    lowest = [np.flatnonzero(strips == k)[np.argmax(along[strips == k])] for k in np.unique(strips)[::-1]]
    toe = points[lowest]
    ends = np.quantile(across, [1.0 - _LIMIT_SHARE, _LIMIT_SHARE]) + np.array([0.5, -0.5]) * heap.surface.cell_m
    middle = toe[len(toe) // 2]
    left, right = (np.append(middle[:2] + (end - middle[:2] @ to_left) * to_left, middle[2]) for end in ends)
    return toe, left, right


def _extra(heap: MeasuredHeap, points_m: FloatArray, kind: str, reason: str) -> dict[str, Any]:
    slopes = heap.surface.slope_deg[heap.surface.seen & ~heap.surface.walls]
    slopes = slopes[np.isfinite(slopes)]
    quantiles = np.percentile(slopes, [50, 75, 90]) if len(slopes) else np.full(3, math.nan)
    above = heap.above_m[heap.surface.seen & ~heap.surface.walls]
    volume, volume_std = volume_m3(heap, points_m)
    return {
        "kind": kind,
        "reason": reason,
        "cell_m": heap.surface.cell_m,
        "slope_radius_m": heap.surface.radius_m,
        "slope_median_deg": float(quantiles[0]),
        "slope_p75_deg": float(quantiles[1]),
        "slope_p90_deg": float(quantiles[2]),
        "faces": [_face_json(face) for face in heap.faces[:8]],
        "floor_m": heap.floor.height_m,
        "floor_std_m": heap.floor.std_m,
        "floor_source": heap.floor.source,
        "height_m": float(np.percentile(above, 99.0)) if len(above) else math.nan,
        "area_m2": float(np.count_nonzero(heap.surface.seen) * heap.surface.cell_m**2),
        "volume_m3": volume,
        "volume_std_m3": volume_std,
    }


def _face_json(face: HeapFace) -> dict[str, float]:
    return {
        "slope_deg": face.slope_deg,
        "slope_std_deg": face.slope_std_deg,
        "downhill_deg": math.degrees(face.downhill_rad),
        "area_m2": face.area_m2,
    }


def _turned(estimate: PileEstimate, R: FloatArray) -> PileEstimate:
    """Return the estimate with its points in the cloud's own axes; a heading is one only where z points up."""
    turned = {name: getattr(estimate, name) @ R.T for name in _PLACES}
    rocks = tuple(Boulder(R @ rock.center_m, rock.size_m) for rock in estimate.boulders)
    attack = estimate.attack if np.allclose(R[:, 2], (0.0, 0.0, 1.0)) else None
    if attack is not None:
        attack = AttackPoint(R @ attack.point_m, attack.heading_rad + math.atan2(R[1, 0], R[0, 0]))
    return replace(estimate, boulders=rocks, attack=attack, **turned)

"""From a scene to an estimate: width, inclination, status, boulders, volume and where to attack."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.pile.face import PileFace
from lhdmap.pile.judge import StatusEvidence, probabilities
from lhdmap.pile.relief import Relief, boulders, grain_m, hits_on, patches, relief
from lhdmap.pile.result import AttackPoint, PileEstimate
from lhdmap.pile.surface import HIGH_M, LOW_M, PileScene

_CLEAR = 0.75  # probability of a pile above which a face that was seen badly counts as one
_UNSEEN, _SEEN_LEAST_M = 1.4, 0.3  # slope of the heights that were not seen, in roughnesses over the height that was
UNSURE_DEG = 8.0  # an inclination that is less sure than this is not said: it may be that of any status
_PILE_DEG, _PILE_STD_DEG = -42.0, 10.0  # how rock that can be loaded lies
_DEFINITION_DEG = 0.4  # rubble within the height that the inclination is defined over
_SUSPECT_M = 0.2  # a boulder draws the face to itself: it stands out by less than it will
_WIDTH_DEFINITION_M = 0.07
_BEYOND_M = 1.5
WORTH = 0.5  # probability of a pile below which nobody should drive into it
_MACHINE_HALF_M = 1.3


def measure(scene: PileScene) -> PileEstimate:
    """Return the estimate of a scene, in the map."""
    scene, seen = _beside_rocks(scene)
    face, limits = scene.face, scene.limits
    width, width_std = limits.width_m(face.b)
    on = scene.points[scene.on_face]
    std_deg = math.hypot(face.inclination_std_deg, _DEFINITION_DEG, _unseen_deg(face, scene.floor_m, on[:, 2]))
    covered, beyond = _closure(scene)
    share = probabilities(
        StatusEvidence(
            face.inclination_deg,
            std_deg,
            grain_m(seen, scene.floor_m + LOW_M, scene.floor_m + HIGH_M),
            covered,
            beyond,
            limits.gap_m,
            face.inclination_std_deg,
        )
    )
    status, inclination_deg = max(share, key=lambda name: share[name]), face.inclination_deg
    if status == "loadable" and (std_deg < UNSURE_DEG or share[status] > _CLEAR):
        inclination_deg, std_deg = _as_rock_lies(inclination_deg, std_deg)
    off = (face.x_at(on[:, 1], on[:, 2]) - on[:, 0]) / math.sqrt(1.0 + face.b**2 + face.c**2)
    toe = _toe(scene, np.linspace(limits.left_m, limits.right_m, 15))
    volume, volume_std = _volume(scene, seen)
    middle = np.array([0.0, 0.5 * (limits.left_m + limits.right_m), float(np.median(on[:, 2]))])
    middle[0] = float(face.x_at(middle[1:2], middle[2:3])[0])
    return PileEstimate(
        status=status if std_deg < UNSURE_DEG else "none",
        probabilities=share,
        center_m=scene.frame.map(middle),
        left_limit_m=scene.frame.map(toe[0]),
        right_limit_m=scene.frame.map(toe[-1]),
        width_m=width,
        width_std_m=math.hypot(width_std, _WIDTH_DEFINITION_M),
        inclination_deg=inclination_deg,
        inclination_std_deg=std_deg,
        heights_m=_heights(on[:, 2] - scene.floor_m),
        volume_m3=volume,
        volume_std_m3=volume_std,
        boulders=boulders(scene, seen),
        attack=attack_point(scene, seen) if share["loadable"] > WORTH else None,
        toe_m=scene.frame.map(toe),
        face_m=scene.frame.map(on[:, :3]),
        residuals_m=off,
    )


def _beside_rocks(scene: PileScene) -> tuple[PileScene, Relief]:
    """Return the scene with the face of the rubble alone: boulders stand out of it and are no part of its slope."""
    seen = relief(scene)
    rocks = patches(scene, seen, _SUSPECT_M)
    if not rocks:
        return scene, seen
    scene = scene.without(hits_on(scene, seen, rocks))
    return scene, relief(scene)


def _heights(above_m: FloatArray) -> tuple[float, float]:
    """Return from where to where hits (N,) over the floor reach, but for one in fifty at each end."""
    low, high = np.quantile(above_m, (0.02, 0.98))
    return float(low), float(high)


def _unseen_deg(face: PileFace, floor_m: float, z: FloatArray) -> float:
    """Return how much the slope of the defined heights may differ from that of those (N,) that were seen, from the roughness."""
    low, high = floor_m + LOW_M, floor_m + HIGH_M
    missing = max(1.0 - float(np.ptp(np.clip(z, low, high))) / (high - low), 0.0)
    # an error of rough_m along the normal over the height that was seen, at the two ends of a line as steep as the face
    height_m = max(float(np.ptp(z)), _SEEN_LEAST_M)
    return math.degrees(_UNSEEN * missing * face.rough_m / (height_m * math.sqrt(1.0 + face.c**2)))


def _as_rock_lies(inclination_deg: float, std_deg: float) -> tuple[float, float]:
    """Return the inclination of a pile, and its deviation, with what is known of loose rock: it counts where little was seen.

    The status is not drawn along: what was seen alone says whether this is a pile at all.
    """
    share = _PILE_STD_DEG**2 / (_PILE_STD_DEG**2 + std_deg**2)
    return _PILE_DEG + share * (inclination_deg - _PILE_DEG), std_deg * math.sqrt(share)


def _toe(scene: PileScene, y: FloatArray) -> FloatArray:
    """Return the toe at y (K,), where the face meets the floor, end frame, shape (K, 3)."""
    z = np.full_like(y, scene.floor_m)
    return np.column_stack([scene.face.x_at(y, z), y, z])


def _closure(scene: PileScene) -> tuple[float, float]:
    """Return the share of the width on which the face was seen, and the share on which hits lie well beyond it."""
    points, face, limits = scene.points, scene.face, scene.limits
    count = max(int((limits.right_m - limits.left_m) / -0.2), 1)
    edges = np.linspace(limits.right_m, limits.left_m, count + 1)
    on = np.histogram(points[scene.on_face, 1], edges)[0] >= 3
    height = points[:, 2] - scene.floor_m
    behind = points[:, 0] - face.x_at(points[:, 1], points[:, 2]) > _BEYOND_M * max(1.0, 0.5 * abs(face.c))
    behind &= (height > 0.3) & (height < 1.6)
    past = np.histogram(points[behind, 1], edges)[0] >= 3
    return float(on.mean()), float(past.mean())


def _volume(scene: PileScene, seen: Relief) -> tuple[float, float]:
    """Return the ore between floor and face as far up as it was seen (m³), with its standard deviation."""
    face, width = scene.face, scene.limits.left_m - scene.limits.right_m
    rows = np.isfinite(seen.proud_m).mean(axis=1) > 0.3
    if not rows.any() or face.c <= 0.05:
        return 0.0, 0.0
    top = float(seen.z_m[rows].max()) + 0.05 - scene.floor_m
    rock = float(np.nanmean(seen.proud_m[rows])) * math.sqrt(1.0 + face.c**2)
    volume = width * top * (0.5 * face.c * top + rock)
    slope_std = math.sqrt(max(face.covariance[2, 2], 0.0))
    relative = math.sqrt((slope_std / face.c) ** 2 + (0.1 / width) ** 2 + (2.0 * 0.05 / max(top, 0.1)) ** 2)
    return volume, volume * relative


def attack_point(scene: PileScene, seen: Relief) -> AttackPoint | None:
    """Return where the bucket meets rock on both sides: the middle, drawn to where the face stands out, clear of walls."""
    limits = scene.limits
    left, right = limits.left_m - _MACHINE_HALF_M - 0.2, limits.right_m + _MACHINE_HALF_M + 0.2
    middle = 0.5 * (limits.left_m + limits.right_m)
    seen_cells = np.isfinite(seen.proud_m)
    columns = np.where(seen_cells, seen.proud_m, 0.0).sum(axis=0) / np.maximum(seen_cells.sum(axis=0), 1)
    weight = np.clip(0.3 + columns, 0.05, 1.0)
    y = float(np.clip(np.average(seen.y_m, weights=weight), min(right, middle), max(left, middle)))
    point = _toe(scene, np.array([y]))[0]
    # at right angles to the face, as far as the drift's walls let the machine turn
    turn = float(np.clip(math.atan(-scene.face.b), -math.radians(10.0), math.radians(10.0)))
    return AttackPoint(scene.frame.map(point), scene.frame.heading_rad + turn)

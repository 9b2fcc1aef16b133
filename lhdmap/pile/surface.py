"""The default method: the drift's end from its walls, the face by a robust fit, everything else from these two.

1. the corridor's walls are followed ahead; 2. what closes it is found by RANSAC; 3. the last metres of wall give the end's
frame; 4. there the face is fitted with the odometry's drift as an unknown; 5. limits and width come from the walls just before
the face, boulders from what stands out of it, the status from the inclination and its deviation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.pile.corridor import Corridor, trace
from lhdmap.pile.end_frame import Frame2, end_of, floor_before
from lhdmap.pile.face import Face, Registration, find, fit
from lhdmap.pile.tilt import Tilt

Mask = npt.NDArray[np.bool_]
LOW_M, HIGH_M = 0.2, 1.6  # heights over the floor at the toe that the inclination is defined over
_WALL_GAP_M = 0.3
_CLEAR_M = 0.08
_WALL_CELL_M = 0.1
_MOUTH_M = 1.2
_WIDER_M = 0.22  # a wall at the face so much farther out is a stope's: the drift's mouth counts
_BLURRED_DEG = 5.0
_ROUND_M = 9.0  # what lies farther from the face says nothing of it
_WALL_SLACK_M = 0.45  # a wall at the face stands no farther from the line of the wall before
_FEWEST_HITS = 40
_FEWEST_BLOCKS = 6


class Limits(NamedTuple):
    """Left and right wall at the face, y in the end frame (m), with standard deviations.

    `opens`: no wall reaches the face on some side; `gap_m`: length before the face on which the worse side's wall was not seen.
    """

    left_m: float
    right_m: float
    left_std_m: float
    right_std_m: float
    opens: bool
    gap_m: float


class Scene(NamedTuple):
    """What was found: `frame` at the face's foot, all hits in it (N, 4), the face, those on it (mask), floor, limits."""

    frame: Frame2
    points: FloatArray
    face: Face
    on_face: Mask
    floor_m: float
    floor_seen: bool
    limits: Limits

    def face_in(self, base: Frame2) -> FloatArray:
        """Return a, b, c of the face in another frame."""
        y = np.array([-1.0, 1.0, 0.0])
        z = self.floor_m + np.array([0.5, 0.5, 1.5])
        corners = self.frame.map(np.column_stack([self.face.x_at(y, z), y, z]))
        local = base.local(np.column_stack([corners, np.zeros(3)]))
        A = np.column_stack([np.ones(3), local[:, 1], local[:, 2]])
        found: FloatArray = np.linalg.solve(A, local[:, 0]).astype(np.float64)
        return found


class View(NamedTuple):
    """From where one looks: the machine's frame, the grade of its path (m/m, rising ahead), how far poses may be wrong."""

    base: Frame2
    grade: float
    registration: Registration
    known: Scene | None = None
    travelled_m: float = 0.0
    tilt: Tilt = Tilt(0.0, 0.0)

    def ahead(self, hits: FloatArray) -> FloatArray:
        """Return the hits (N, 4) that lie ahead, heights put right by the tilt."""
        local = hits[hits[:, 0] > 1.0]
        local[:, 2] -= self.tilt.angle_rad * (local[:, 0] + self.travelled_m - local[:, 3])
        return local


def look(hits: FloatArray, view: View, reach_m: float, rng: np.random.Generator) -> Scene | None:
    """Return what closes the drift ahead, or None; hits rows x, y, z (machine's frame, m), travelled (m)."""
    base, local = view.base, view.ahead(hits)
    corridor = trace(local, reach_m)
    inside = np.abs(local[:, 1] - corridor.centre_at(local[:, 0])) < corridor.half_at(local[:, 0]) - _WALL_GAP_M
    known = view.known.face_in(base) if view.known is not None else None
    seed = find(local[inside], rng, known) if inside.sum() >= _FEWEST_HITS else None
    if seed is None:
        return None
    scene = _measured(view, local, corridor, seed)
    if known is not None and (scene is None or scene.face.inclination_std_deg > _BLURRED_DEG):
        again = _measured(view, local, corridor, known)  # chance picked something else than the face of before
        if again is not None and (scene is None or again.face.inclination_std_deg < scene.face.inclination_std_deg):
            return again
    return scene


def _measured(view: View, local: FloatArray, corridor: Corridor, seed: FloatArray) -> Scene | None:
    """Return the scene of a face x = a + b y + c z in the machine's frame, with the end's frame and its limits."""
    base = view.base
    face_x = _crossing(seed, corridor)
    end = end_of(corridor, face_x)
    if end is None:
        return None
    frame = base.turned(np.array([face_x, end.middle_m, 0.0]), end.turn_rad)
    model = _turned(seed, end.turn_rad)
    floor = _Floor(view.grade * face_x, view.grade)
    near = local[np.abs(local[:, 0] - face_x) < _ROUND_M]
    near[:, :3] = base.map(near[:, :3])
    return _refined(frame, frame.local(near), model, end.half_m, floor, view.registration)


def _crossing(seed: FloatArray, corridor: Corridor) -> float:
    """Return x where the corridor's middle meets the face, at the height of the machine's floor."""
    x = float(seed[0])
    for _ in range(3):
        x = float(seed[0] + seed[1] * corridor.centre_at(np.array([x]))[0])
    return x


def _turned(seed: FloatArray, turn_rad: float) -> FloatArray:
    """Return the face x = a + b y + c z in a frame turned left by an angle, with its origin on the face."""
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    across = max(c + float(seed[1]) * s, 0.3)
    return np.array([0.0, (float(seed[1]) * c - s) / across, float(seed[2]) / across])


class _Floor(NamedTuple):
    """The floor where it was not seen: the machine's path carried on; z at the frame's origin and grade."""

    z_m: float
    grade: float

    def at_toe(self, points: FloatArray, model: FloatArray, on: FloatArray, half_m: float) -> tuple[float, bool]:
        """Return z of the floor at the toe and whether it was seen; never above the lowest hits of the face."""
        toe_x = float(model[0] + model[2] * self.z_m)
        seen = floor_before(points, toe_x, half_m)
        lowest = float(np.percentile(on[:, 2], 1.0))
        floor = seen if seen is not None else self.z_m + self.grade * toe_x
        return min(floor, lowest), seen is not None


def _refined(
    frame: Frame2, points: FloatArray, model: FloatArray, half_m: float, path: _Floor, registration: Registration
) -> Scene | None:
    """Fit the face in the end frame, with the floor and the walls that the fit itself shows."""
    left, right = half_m, -half_m
    scene = None
    for _ in range(3):
        near = np.abs(points[:, 0] - (model[0] + model[1] * points[:, 1] + model[2] * points[:, 2]))
        band = (points[:, 1] < left - _CLEAR_M) & (points[:, 1] > right + _CLEAR_M)
        band &= near < 0.8 * max(1.0, abs(model[2]))
        on = points[band]
        if len(on) < _FEWEST_HITS:
            return None
        floor, seen = path.at_toe(points, model, on, 0.5 * (left - right))
        used = band & (points[:, 2] > floor + LOW_M) & (points[:, 2] < floor + HIGH_M)
        if used.sum() < _FEWEST_HITS:
            return None
        face = fit(points[used], model, registration)
        model = np.array([face.a, face.b, face.c])
        limits = _limits(points, face, floor, half_m)
        left, right = limits.left_m, limits.right_m
        scene = Scene(frame, points, face, used, floor, seen, limits)
    return scene if scene is not None and scene.face.blocks >= _FEWEST_BLOCKS else None


def _limits(points: FloatArray, face: Face, floor_m: float, half_m: float) -> Limits:
    """Return the walls in the last metre before the face; where the drift opens there, its mouth."""
    before = points[:, 0] - face.x_at(points[:, 1], points[:, 2])
    height = points[:, 2] - floor_m
    # rubble of a shallow face reaches far along the drift: off it by a distance along the normal
    off = max(0.15, 0.2 * math.sqrt(1.0 + face.c**2))
    at_face = (before > -0.75 - off) & (before < -off) & (height > 0.3) & (height < 1.5)
    sides = [_wall(points, at_face, side, half_m) for side in (1.0, -1.0)]
    opens = any(side is None or side[0] > half_m + _WIDER_M for side in sides)
    if opens:
        drift = (before > -8.0) & (before < -0.15 - off) & (height > 0.3) & (height < 1.5)
        sides = [_mouth(points, drift, side, half_m) for side in (1.0, -1.0)]
    (left, left_std), (right, right_std) = (one if one is not None else (half_m, 0.5) for one in sides)
    gap = max(_gap(points, before, side, half_m) for side in (1.0, -1.0))
    return Limits(left, -right, left_std, right_std, opens, gap)


def _gap(points: FloatArray, before: FloatArray, side: float, half_m: float) -> float:
    """Return the distance from the last hits of a wall to the face."""
    y = side * points[:, 1]
    wall = (y > half_m - 0.7) & (y < half_m + 0.6) & (before < -0.1)
    return float(-np.sort(before[wall])[-8]) if wall.sum() >= 8 else 99.0


def _wall(points: FloatArray, at_face: Mask, side: float, half_m: float) -> tuple[float, float] | None:
    """Return the distance of a wall from the middle and its standard deviation; None where none is near."""
    y = _cell_medians(points[at_face], side)
    y = y[(y > half_m - _WALL_SLACK_M) & (y < half_m + _WALL_SLACK_M)]
    if y.size < 5:
        return None
    return float(np.median(y)), _deviation(y)


def _cell_medians(points: FloatArray, side: float) -> FloatArray:
    """Return how far to a side the wall is in each (x, z) cell: near patches have many hits and must not outvote."""
    y = side * points[:, 1]
    points, y = points[y > 0.5], y[y > 0.5]
    cells = np.floor(points[:, [0, 2]] / _WALL_CELL_M).astype(np.int64) @ np.array([100_003, 1])
    order = np.lexsort((y, cells))
    _, first, count = np.unique(cells[order], return_index=True, return_counts=True)
    return y[order][first + count // 2]


def _mouth(points: FloatArray, drift: Mask, side: float, half_m: float) -> tuple[float, float] | None:
    """Return how far to a side one can look past the drift's last metre of wall: what stands out most at each height."""
    y = side * points[:, 1]
    wall = drift & (np.abs(y - half_m) < _WALL_SLACK_M)
    if wall.sum() < 16:
        return None
    last = np.sort(points[wall, 0])[-8]
    wall &= points[:, 0] > last - _MOUTH_M
    rows = np.floor(points[wall, 2] / _WALL_CELL_M).astype(np.int64)
    inner = [float(np.percentile(y[wall][rows == row], 5.0)) for row in np.unique(rows)]
    return float(np.median(inner)), _deviation(np.array(inner)) + 0.05


def _deviation(y: FloatArray) -> float:
    """Return the standard deviation of the middle of rough rock: few independent bumps in a metre."""
    spread = 1.4826 * float(np.median(np.abs(y - np.median(y))))
    return max(spread / math.sqrt(4.0), 0.03)

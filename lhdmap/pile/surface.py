"""The default method: the drift's end from its walls, the face by a robust fit, everything else from these two.

1. the corridor's walls are followed ahead; 2. what closes it is found by RANSAC; 3. the last metres of wall give the end's
frame; 4. there the face is fitted with the odometry's drift as an unknown; 5. limits and width come from the walls just before
the face, boulders from what stands out of it, the status from the inclination and its deviation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from lhdmap.geometry.frame import UprightFrame
from lhdmap.messages import FloatArray
from lhdmap.pile.corridor import DriftCorridor, trace
from lhdmap.pile.end_frame import end_of, floor_before, turned_near
from lhdmap.pile.face import STEEPEST, FaceRegistration, PileFace, find, fit
from lhdmap.pile.limits import FaceLimits, limits_of
from lhdmap.pile.order import quantile
from lhdmap.pile.tilt import Tilt

Mask = npt.NDArray[np.bool_]
LOW_M, HIGH_M = 0.2, 1.6  # heights over the floor at the toe that the inclination is defined over
_LEAST_SPAN_M = 0.9
_WALL_GAP_M = 0.3
_CLEAR_M = 0.08
_BLURRED_DEG = 5.0
_ROUND_M = 9.0  # what lies farther from the face says nothing of it
_FEWEST_HITS = 40
_FEWEST_BLOCKS = 6


class PileScene(NamedTuple):
    """What was found: `frame` at the face's foot, all hits in it (N, 4), the face, those on it (mask), floor, limits."""

    frame: UprightFrame
    points: FloatArray
    face: PileFace
    on_face: Mask
    floor_m: float
    floor_seen: bool
    limits: FaceLimits
    registration: FaceRegistration = FaceRegistration(0.0, 0.0)

    def without(self, rocks: Mask) -> PileScene:
        """Return the scene with the face fitted anew, without the hits (N,) on rocks that stand out of it."""
        left = self.on_face & ~rocks
        if left.sum() < _FEWEST_HITS:
            return self
        face = fit(self.points[left], np.array([self.face.a, self.face.b, self.face.c]), self.registration)
        return self._replace(face=face) if face.c > STEEPEST and face.blocks >= _FEWEST_BLOCKS else self

    def face_in(self, base: UprightFrame) -> FloatArray:
        """Return a, b, c of the face in another frame."""
        y = np.array([-1.0, 1.0, 0.0])
        z = self.floor_m + np.array([0.5, 0.5, 1.5])
        local = base.local(self.frame.map(np.column_stack([self.face.x_at(y, z), y, z])))
        A = np.column_stack([np.ones(3), local[:, 1], local[:, 2]])
        found: FloatArray = np.linalg.solve(A, local[:, 0]).astype(np.float64)
        return found


class PileView(NamedTuple):
    """From where one looks: the machine's frame, the grade of its path (m/m, rising ahead), how far poses may be wrong."""

    base: UprightFrame
    grade: float
    registration: FaceRegistration
    known: PileScene | None = None
    travelled_m: float = 0.0
    tilt: Tilt = Tilt(0.0, 0.0)

    def ahead(self, hits: FloatArray) -> FloatArray:
        """Return the hits (N, 4) that lie ahead, heights put right by the tilt."""
        return _ahead(hits, self.tilt.angle_rad, self.travelled_m)


def look(hits: FloatArray, view: PileView, reach_m: float, rng: np.random.Generator) -> PileScene | None:
    """Return what closes the drift ahead, or None; hits rows x, y, z (machine's frame, m), travelled (m)."""
    base, local = view.base, view.ahead(hits)
    corridor = trace(local, reach_m)
    inside = corridor.inside(local, _WALL_GAP_M)
    known = view.known.face_in(base) if view.known is not None else None
    seed = find(inside, rng, known) if len(inside) >= _FEWEST_HITS else None
    if seed is None:
        return None
    scene = _measured(view, local, corridor, seed)
    if known is not None and (scene is None or scene.face.inclination_std_deg > _BLURRED_DEG):
        again = _measured(view, local, corridor, known)  # chance picked something else than the face of before
        if again is not None and (scene is None or again.face.inclination_std_deg < scene.face.inclination_std_deg):
            return again
    return scene


def _measured(view: PileView, local: FloatArray, corridor: DriftCorridor, seed: FloatArray) -> PileScene | None:
    """Return the scene of a face x = a + b y + c z in the machine's frame, with the end's frame and its limits."""
    base = view.base
    face_x = _crossing(seed, corridor)
    end = end_of(corridor, face_x)
    if end is None:
        return None
    foot = np.array([face_x, end.middle_m, 0.0])
    model = _turned(seed, end.turn_rad)
    floor = _Floor(view.grade * face_x, view.grade)
    near = turned_near(local, foot, end.turn_rad, _ROUND_M)
    return _refined(base.turned(foot, end.turn_rad), near, model, end.half_m, floor, view.registration)


def _crossing(seed: FloatArray, corridor: DriftCorridor) -> float:
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


def _refined(
    frame: UprightFrame,
    points: FloatArray,
    model: FloatArray,
    half_m: float,
    path: _Floor,
    registration: FaceRegistration,
) -> PileScene | None:
    """Fit the face in the end frame, with the floor and the walls that the fit itself shows."""
    left, right = half_m, -half_m
    scene = None
    for _ in range(3):
        used = np.zeros(len(points), np.bool_)
        floor, seen, hits = _on_face(points, model, (left, right), path, used)
        if hits < _FEWEST_HITS:
            return None
        face = fit(points[used], model, registration)
        if face.c < STEEPEST:
            return None
        model = np.array([face.a, face.b, face.c])
        limits = limits_of(points, face, floor, half_m)
        left, right = limits.left_m, limits.right_m
        scene = PileScene(frame, points, face, used, floor, seen, limits, registration)
    return scene if scene is not None and scene.face.blocks >= _FEWEST_BLOCKS else None


@nb.njit(cache=True, nogil=True)
def _ahead(hits, tilt, travelled):  # type: ignore[no-untyped-def]
    """Return the hits (N, 4) that lie ahead, heights put right by a tilt."""
    out = np.empty_like(hits)
    count = 0
    for i in range(hits.shape[0]):
        x, seen_at = hits[i, 0], hits[i, 3]
        if x > 1.0:
            out[count, 0], out[count, 1], out[count, 3] = x, hits[i, 1], seen_at
            out[count, 2] = hits[i, 2] - tilt * (x + travelled - seen_at)
            count += 1
    return out[:count]


@nb.njit(cache=True, nogil=True)
def _on_face(points, model, sides, path, used):  # type: ignore[no-untyped-def]
    """Mark the hits on the face at the heights that the inclination is defined over, and above where hardly any of these was seen.

    Returns z of the floor at the toe, never above the lowest hits of the face, whether it was seen, and how many hits are marked.
    """
    reach = 0.8 * max(1.0, abs(model[2]))
    on, low = np.empty(points.shape[0], np.int64), np.empty(points.shape[0])
    count = 0
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        between = y < sides[0] - _CLEAR_M and y > sides[1] + _CLEAR_M
        if between and abs(x - (model[0] + model[1] * y + model[2] * z)) < reach:
            on[count], low[count] = i, z
            count += 1
    if count < _FEWEST_HITS:
        return math.nan, False, 0
    toe_x = model[0] + model[2] * path[0]
    path_z = path[0] + path[1] * toe_x
    floor = floor_before(points, toe_x, 0.5 * (sides[0] - sides[1]), path_z)
    seen = not math.isnan(floor)
    floor = min(floor if seen else path_z, quantile(low, count, 0.01))
    # downhill the scan meets the face high up: what lies above the defined heights then tells more than their upper edge alone
    top = max(floor + HIGH_M, quantile(low, count, 0.05) + _LEAST_SPAN_M)
    hits = 0
    for i in on[:count]:
        used[i] = points[i, 2] > floor + LOW_M and points[i, 2] < top
        hits += used[i]
    return floor, seen, hits

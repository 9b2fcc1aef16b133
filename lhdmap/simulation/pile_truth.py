"""The truth about a simulated pile, measured on the meshes by the written definition; never by an estimator.

*Inclination*: horizontal rays along the drift's end heading on a 4 cm (lateral, height) grid; their first hits on pile and
rubble, without boulders and without 8 cm at each wall, for heights of 0.2 to 1.6 m above the floor at the toe; robust
regression of x on (y, z); -atan2(1, dx/dz). *Width*: lateral rays in the plane of the fitted face, from five positions 0.15
to 0.9 m before it, at heights of 0.3 to 1.5 m, against the walls: median to the left plus median to the right; where the
face is wider than the drift (a stope, whose mouth lies before the toe), the aperture that is seen along the drift.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.pile import Pile, floor_height
from lhdmap.simulation.pile_facts import BoulderTruth, FacePlane, PileTruth, fit_face
from lhdmap.simulation.pile_rocks import extent
from lhdmap.simulation.raycast import Surface
from lhdmap.simulation.world import DriftWorld

CELL_M, VOLUME_CELL_M = 0.04, 0.02
OFF_WALL_CELLS = 2  # 8 cm
FACE_HEIGHTS_M = (0.2, 1.6)
WIDTH_HEIGHTS_M = (0.3, 1.5)
BEFORE_FACE_M = (0.15, 0.9)
VOLUME_HEIGHTS_M = (1.0, 1.4, 1.6, 2.0)
_BEFORE_M = 1.0  # rays along the drift start this far before the foremost point of the face, or before the mouth
_LYING = ("loadable", "too_shallow")  # what lies has a volume under its face
_ABOVE_ALL_M = 15.0
_TOE_OVER_FLOOR_M = 0.03
_FORWARD, _LEFT, _DOWN = np.eye(3)[0], np.eye(3)[1], -np.eye(3)[2]


class Bodies:
    """Drift and face as two surfaces in the frame of the foot: which of them a ray meets, and where."""

    def __init__(self, world: DriftWorld, pile: Pile) -> None:
        self.pile, self.drift = pile, world.drift
        spacing = world.scenario.drift.mesh_m
        first = int((pile.place_m - 12.0 - pile.settings.mouth_m) / spacing)
        drift = world.crossing.mesh(first, world.drift.ring_count() + 1)
        self._walls = Surface(Mesh(pile.frame.local(drift.vertices_m), drift.triangles))
        self._face = Surface(pile.face.mesh()) if pile.face is not None else None

    def to_walls(self, starts_m: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the range to the drift's own surface from each start, shape (..., 3), along one direction (3,)."""
        return _cast(self._walls, starts_m, direction)

    def to_face(self, starts_m: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the range to the face, as if nothing else were there; inf for none."""
        return np.full(starts_m.shape[:-1], np.inf) if self._face is None else _cast(self._face, starts_m, direction)

    def floor(self, along_m: FloatArray, lateral_m: FloatArray) -> FloatArray:
        """Return the floor's height, shape (N,), in the frame of the foot."""
        return floor_height(self.drift, self.pile.place_m, along_m, lateral_m)


def _cast(surface: Surface, starts_m: FloatArray, direction: FloatArray) -> FloatArray:
    starts = starts_m.reshape(-1, 3) - surface.origin_m
    unit = np.broadcast_to(direction / np.linalg.norm(direction), starts.shape)
    ranges = surface.cast(np.hstack([starts, unit]).astype(np.float32))
    return ranges.astype(np.float64).reshape(starts_m.shape[:-1])


def pile_truth(world: DriftWorld) -> PileTruth:
    """Measure the pile of a world; the world must have one (`scenario.pile`)."""
    pile = world.pile
    assert pile is not None, "the scenario has no pile"  # noqa: S101
    settings, frame = pile.settings, pile.frame
    bodies = Bodies(world, pile)
    toe = _toe(bodies)
    center = toe[len(toe) // 2] if len(toe) else np.array([0.0, settings.obstacle_lateral_m, 0.0])
    floor = float(bodies.floor(center[:1], np.zeros(1))[0])
    plane, left, right, volumes = None, math.nan, math.nan, {}
    if len(toe):
        plane = fit_face(*_face_hits(bodies, floor))
    if plane is not None:
        left, right = _aperture(bodies, floor) if settings.mouth_m > 0.0 else _width(bodies, plane, floor)
        sides = (left, right) if settings.mouth_m > 0.0 else (math.inf, math.inf)
        volumes = _volumes(bodies, plane, floor, sides) if settings.status in _LYING else {}
    return PileTruth(
        settings.variant,
        settings.status,
        left + right,
        plane.inclination_deg if plane is not None else math.nan,
        left,
        right,
        frame.map(center),
        frame.map(toe),
        plane,
        frame.heading_rad,
        floor + float(frame.origin_m[2]),
        tuple(_boulder_truth(pile, index) for index in range(len(pile.boulders))),
        volumes,
    )


def _toe(bodies: Bodies) -> FloatArray:
    """Return where the face meets the floor between the walls, from left to right, shape (K, 3), frame of the foot."""
    face = bodies.pile.face
    if face is None:
        return np.zeros((0, 3))
    lateral = face.lateral_m[::-1]
    reach = float(face.points_m[..., 0].min()) - 1.0
    x = np.zeros(len(lateral))
    for _ in range(3):  # the height of the floor depends on where the toe is
        height = bodies.floor(x, lateral) + _TOE_OVER_FLOOR_M
        starts = np.stack([np.full(len(lateral), reach), lateral, height], axis=1)
        x = np.clip(reach + bodies.to_face(starts, _FORWARD), -20.0, 60.0)
    points = np.stack([x, lateral, height - _TOE_OVER_FLOOR_M], axis=1)
    middle = np.stack([x, 0.0 * lateral, height + 0.6], axis=1)
    to_left, to_right = bodies.to_walls(middle, _LEFT), bodies.to_walls(middle, -_LEFT)
    inside = (lateral < to_left) & (lateral > -to_right) & (x < 59.0)
    return points[inside]


def _start_m(bodies: Bodies, front_m: float) -> float:
    """Return where rays along the drift start: before the foremost point of the face, in a stope before its mouth."""
    return min(front_m, -bodies.pile.settings.mouth_m) - _BEFORE_M


def _front_m(bodies: Bodies, floor_m: float) -> float:
    """Return the foremost x of the face over the floor, up to the scanner's height (it may overhang its toe)."""
    face = bodies.pile.face
    points = face.points_m.reshape(-1, 3) if face is not None else np.zeros((1, 3))
    seen = (points[:, 2] > floor_m - 0.1) & (points[:, 2] < floor_m + 2.0)
    return float(points[seen, 0].min()) if seen.any() else 0.0


def plane_over(world: DriftWorld, truth: PileTruth, heights_m: tuple[float, float]) -> FacePlane | None:
    """Return the face as the definition has it, but over other heights above the floor at the toe: those that were seen.

    What differs from the truth then is what a perfect observer of these heights would be off by. None where they hold no face.
    """
    assert world.pile is not None, "the scenario has no pile"  # noqa: S101
    floor_m = truth.floor_m - float(world.pile.frame.origin_m[2])
    return fit_face(*_face_hits(Bodies(world, world.pile), floor_m, heights_m))


def _face_hits(
    bodies: Bodies, floor_m: float, heights_m: tuple[float, float] = FACE_HEIGHTS_M
) -> tuple[FloatArray, FloatArray]:
    """Return first hits on the face along the drift: x (N,) and the grid's (y, z) (N, 2), frame of the foot."""
    half = 0.5 * CELL_M
    rows = np.arange(floor_m + heights_m[0] + half, floor_m + heights_m[1], CELL_M)
    reach = bodies.drift.settings.half_width_m + 2.0
    columns = np.arange(-reach, reach, CELL_M)
    z, y = np.meshgrid(rows, columns, indexing="ij")
    starts = np.stack([np.full(y.shape, _start_m(bodies, _front_m(bodies, floor_m))), y, z], axis=2)
    face, walls = bodies.to_face(starts, _FORWARD), bodies.to_walls(starts, _FORWARD)
    hit = off_walls(np.isfinite(face) & (face < walls) & _within(bodies, starts))
    return starts[..., 0][hit] + face[hit], np.stack([y[hit], z[hit]], axis=1)


def _within(bodies: Bodies, starts_m: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which starts lie between the walls."""
    middle = starts_m * [1.0, 0.0, 1.0]
    lateral = starts_m[..., 1]
    left, right = bodies.to_walls(middle, _LEFT), bodies.to_walls(middle, -_LEFT)
    inside: npt.NDArray[np.bool_] = (lateral < left) & (lateral > -right)
    return inside


def off_walls(hit: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Return the cells, (Z, Y), of each height that are hits and have none but hits up to 8 cm to either side."""
    padded = np.pad(hit, ((0, 0), (OFF_WALL_CELLS, OFF_WALL_CELLS)))
    shifts = [padded[:, k : k + hit.shape[1]] for k in range(2 * OFF_WALL_CELLS + 1)]
    kept: npt.NDArray[np.bool_] = np.logical_and.reduce(shifts)
    return kept


def _width(bodies: Bodies, plane: FacePlane, floor_m: float) -> tuple[float, float]:
    """Return the medians to the left and to the right (m) of lateral rays in the plane of the face, before it."""
    heights = floor_m + np.linspace(*WIDTH_HEIGHTS_M, 13)
    before, z = np.meshgrid(np.linspace(*BEFORE_FACE_M, 5), heights, indexing="ij")
    starts = np.stack([plane.x_m(np.zeros(z.shape), z) - before, 0.0 * z, z], axis=2)
    lateral = np.array([plane.by_y, 1.0, 0.0])
    return _median(bodies.to_walls(starts, lateral)), _median(bodies.to_walls(starts, -lateral))


def _aperture(bodies: Bodies, floor_m: float) -> tuple[float, float]:
    """Return the medians over the heights of how far the view along the drift reaches to the left and to the right (m)."""
    heights = floor_m + np.linspace(*WIDTH_HEIGHTS_M, 13)
    reach, fine = bodies.drift.settings.half_width_m + 2.0, 0.01
    z, y = np.meshgrid(heights, np.arange(-reach, reach, fine), indexing="ij")
    starts = np.stack([np.full(y.shape, _start_m(bodies, 0.0)), y, z], axis=2)
    beyond = bodies.pile.settings.mouth_m + _BEFORE_M - 0.1
    open_ = (bodies.to_walls(starts, _FORWARD) > beyond) & _within(bodies, starts)
    middle = y.shape[1] // 2
    halves = (open_[:, middle:], open_[:, :middle][:, ::-1])
    left, right = (_median(np.argmin(np.pad(half, ((0, 0), (0, 1))), axis=1) * fine) for half in halves)
    return left, right


def _median(ranges_m: FloatArray) -> float:
    finite = ranges_m[np.isfinite(ranges_m)]
    return float(np.median(finite)) if finite.size else math.nan


def _volumes(bodies: Bodies, plane: FacePlane, floor_m: float, sides_m: tuple[float, float]) -> dict[float, float]:
    """Return the volume (m³) between floor and face as far as the fitted face rises to each height.

    It is that between the walls, or within `sides_m` of the middle (the aperture) where that is less.
    """
    half, depth = bodies.drift.settings.half_width_m + 3.0, bodies.pile.settings.back_m
    x, y = (np.arange(a, b, VOLUME_CELL_M) for a, b in ((_front_m(bodies, floor_m) - 0.5, depth), (-half, half)))
    along, lateral = np.meshgrid(x, y, indexing="ij")
    top = np.stack([along, lateral, np.full(along.shape, _ABOVE_ALL_M)], axis=2)
    floor = bodies.floor(x, 0.0 * x)[:, None]
    over = _ABOVE_ALL_M - bodies.to_face(top, _DOWN) - floor
    side = np.stack([x, 0.0 * x, floor[:, 0] + 0.8], axis=1)
    left = np.minimum(bodies.to_walls(side, _LEFT), sides_m[0])[:, None]
    right = np.minimum(bodies.to_walls(side, -_LEFT), sides_m[1])[:, None]
    over = np.where(np.isfinite(over) & (lateral < left) & (lateral > -right), np.maximum(over, 0.0), 0.0)
    ends = {height: plane.x_m(lateral, np.full(lateral.shape, floor_m + height)) for height in VOLUME_HEIGHTS_M}
    return {height: float(over[along < end].sum()) * VOLUME_CELL_M**2 for height, end in ends.items()}


def _boulder_truth(pile: Pile, index: int) -> BoulderTruth:
    """Return the truth of a boulder: its body, and the part of it that stands out of the face."""
    boulder, face = pile.boulders[index], pile.face
    assert face is not None  # noqa: S101  # a boulder lies in one
    vertices = boulder.mesh.vertices_m
    ahead = Surface(face.mesh())
    depth = _cast(ahead, vertices - [3.0, 0.0, 0.0], _FORWARD) - 3.0  # how far the face is behind a vertex
    out = vertices[depth > 0.0]
    seen = out if len(out) >= 3 else vertices
    to_map = pile.frame.map
    return BoulderTruth(to_map(boulder.middle_m), to_map(seen.mean(axis=0)), boulder.size_m, extent(seen))

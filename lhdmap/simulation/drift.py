"""A drift as a surface: a profile swept along the centre line, with rough walls, a wavy floor, blast rounds and ends.

The surface is a function of (arc length s, position u on the profile) and is meshed in pieces, any length of it alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.messages import FloatArray
from lhdmap.mine.centre_line import CentreLine
from lhdmap.simulation.noise_field import Scales, noise_field
from lhdmap.simulation.sections import DriftSettings

_UNDULATION = Scales(3, 4.0, 0.6)  # waves of about 8, 4 and 2 m: what a machine of 3.4 m wheelbase rides up and down
_ROUGH_FLOOR = Scales(3, 0.4, 0.7)
_SAMPLED_M = 500.0  # of a longer drift this much tells how rough the drawn fields are


Triangles = npt.NDArray[np.uint32]
FloorHeight = Callable[[FloatArray], FloatArray]
"""Height of a floor (N,) under points (N, 3) of `map`."""


class Mesh(NamedTuple):
    """A triangle mesh: vertices (N, 3), metres, in `map`; triangles (M, 3), vertex indices."""

    vertices_m: FloatArray
    triangles: Triangles


class Profile(NamedTuple):
    """Walls and roof from the lower left to the lower right corner, all shapes (N,) or (N, 2).

    `points_m` and `normals` (outward) are (lateral, height), left positive; `u_m` is the position along it.
    """

    points_m: FloatArray
    normals: FloatArray
    u_m: FloatArray


def profile(settings: DriftSettings, *, planar: bool = False) -> Profile:
    """Return the nominal profile, sampled each `mesh_m` (in a planar world at its corners only)."""
    outline = _outline(settings)
    u = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(outline, axis=0), axis=1))])
    if planar:
        return Profile(
            outline[[0, 1, -2, -1]], np.array([[1.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [-1.0, 0.0]]), u[[0, 0, -1, -1]]
        )
    dense_u = np.linspace(0.0, u[-1], int(np.ceil(u[-1] / 0.01)) + 1)
    dense = np.stack([np.interp(dense_u, u, outline[:, k]) for k in range(2)], axis=1)
    tangents = np.gradient(_blurred(dense, 25), axis=0)
    normals = np.stack([tangents[:, 1], -tangents[:, 0]], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    sample = np.linspace(0.0, u[-1], int(np.ceil(u[-1] / settings.mesh_m)) + 1)
    picked = [np.interp(sample, dense_u, column) for column in (*dense.T, *normals.T)]
    return Profile(np.stack(picked[:2], axis=1), np.stack(picked[2:], axis=1), sample)


def _outline(settings: DriftSettings) -> FloatArray:
    """Return the corners of the walls and roof, shape (N, 2): box, or upright walls with half an ellipse on them."""
    half, height = settings.half_width_m, settings.height_m
    if settings.profile == "box":
        return np.array([[half, 0.0], [half, height], [-half, height], [-half, 0.0]])
    spring = max(height - half, 0.4 * height)
    angle = np.linspace(0.0, np.pi, 61)
    arch = np.stack([half * np.cos(angle), spring + (height - spring) * np.sin(angle)], axis=1)
    return np.concatenate([[[half, 0.0]], arch, [[-half, 0.0]]])


def _blurred(points: FloatArray, half: int) -> FloatArray:
    """Return a moving mean over 2·half + 1 points, the ends continued straight: rounds the normals at corners."""
    before = points[0] + np.arange(-half, 0)[:, None] * (points[1] - points[0])
    after = points[-1] + np.arange(1, half + 1)[:, None] * (points[-1] - points[-2])
    total = np.cumsum(np.concatenate([before[:1] * 0.0, before, points, after]), axis=0)
    return (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)


class Drift:
    """The surface of one drift along `line`; `rng` draws its roughness, the floor's too where none is given for all drifts."""

    def __init__(
        self,
        settings: DriftSettings,
        line: CentreLine,
        rng: np.random.Generator,
        *,
        planar: bool = False,
        floor: FloorHeight | None = None,
    ) -> None:
        self.settings, self.line, self.profile, self._floor = settings, line, profile(settings, planar=planar), floor
        span, width = (0.0, line.length_m), settings.half_width_m + 1.0 + _widest(settings)
        perimeter = (0.0, float(self.profile.u_m[-1]))
        wall_rng, floor_rng, end_rng, self._blast_rng = rng.spawn(4)
        scales = Scales(settings.roughness_octaves, settings.roughness_scale_m, settings.roughness_gain)
        self._walls = noise_field(wall_rng, scales, span, perimeter)
        if floor is None:
            self._waves = noise_field(floor_rng, _UNDULATION, span, (-width, width))
            self._stones = noise_field(floor_rng, _ROUGH_FLOOR, span, (-width, width))
        self._ends = noise_field(end_rng, scales, (-width, width), (-1.0, settings.height_m + 1.0))
        self._normalise(width)

    def _normalise(self, width: float) -> None:
        settings, s = self.settings, np.arange(0.0, min(self.line.length_m, _SAMPLED_M), 0.15)
        lateral = np.arange(-width + 1.0, width - 1.0 + 1e-9, 0.2)
        self._walls.normalise(
            s, np.unique(self.profile.u_m)[:: max(1, int(0.15 / settings.mesh_m))], settings.roughness_m
        )
        if self._floor is None:
            self._waves.normalise(s, lateral, settings.floor_undulation_m)
            self._stones.normalise(s, lateral, settings.floor_roughness_m)
        self._ends.normalise(lateral, np.arange(0.0, settings.height_m, 0.2), settings.roughness_m)

    def floor_offset(self, s_m: FloatArray, lateral_m: FloatArray) -> FloatArray:
        """Return the floor's height (m) over the centre line's at points of one shape."""
        if self._floor is not None:
            x, y, z, heading = np.moveaxis(self.line.at(s_m), -1, 0)
            points = np.stack([x - lateral_m * np.sin(heading), y + lateral_m * np.cos(heading), z], axis=-1)
            return self._floor(points.reshape(-1, 3)).reshape(s_m.shape) - z
        return self._waves.at(s_m, lateral_m) + self._stones.at(s_m, lateral_m)

    def wall_offset(self, s_m: FloatArray) -> FloatArray:
        """Return how far walls and roof lie outside their nominal profile (m), shape (len(s), len(profile))."""
        return self._walls.grid(s_m, self.profile.u_m) + self._flare(s_m)[:, None] - self._bolts(s_m)

    def _bolts(self, s_m: FloatArray) -> FloatArray | float:
        """Return how far the plates of rock bolts stand out (m), shape (len(s), len(profile)): short bumps on a square grid."""
        settings = self.settings
        if settings.bolts_m == 0.0:
            return 0.0
        along, around = (
            np.maximum(np.cos(2 * np.pi * way / settings.bolt_spacing_m), 0.0) ** 6 for way in (s_m, self.profile.u_m)
        )
        return settings.bolts_m * along[:, None] * around

    def _flare(self, s_m: FloatArray) -> FloatArray:
        """Return the flare of the blast rounds (m): each widens towards its end and steps back over 0.15 m."""
        settings = self.settings
        phase = (s_m / settings.blast_round_m) % 1.0
        back = 0.15 / settings.blast_round_m
        ramp = np.where(phase < 1.0 - back, phase / (1.0 - back), (1.0 - phase) / back)
        return settings.blast_flare_m * (ramp - 0.5)

    def reversed(self) -> Drift:
        """Return the same drift with its line the other way round; its nominal walls only, for what stands at its start."""
        line = self.line
        turned = CentreLine(
            line.length_m - line.s_m[::-1], line.x_m[::-1], line.y_m[::-1], line.z_m[::-1],
            line.heading_rad[::-1] + np.pi, -line.curvature_pm[::-1],
        )  # fmt: skip
        settings = replace(
            self.settings,
            widenings=tuple(
                (line.length_m - at, right, left, roof) for at, left, right, roof in self.settings.widenings[::-1]
            ),
        )
        return Drift(settings, turned, np.random.default_rng(0), floor=self._floor)

    def ring_count(self) -> int:
        """Return the number of rings of the whole mesh."""
        return int(self.line.length_m / self.settings.mesh_m) + 1

    def mesh(self, first: int, last: int, *, closed: tuple[bool, bool] = (False, False)) -> Mesh:
        """Mesh the rings `first` to `last` (exclusive), with end faces where `closed` says so (start, end)."""
        first, last = max(first, 0), min(last, self.ring_count())
        s = np.arange(first, last, dtype=float) * self.settings.mesh_m
        rings = self.rings(s)
        vertices = [self._to_map(s, rings).reshape(-1, 3)]
        triangles = [_tube(rings.shape[0], rings.shape[1])]
        for index, wanted in zip((0, -1), closed, strict=True):
            if wanted:
                face = self._end_face(float(s[index]), rings[index], outward=-1.0 if index == 0 else 1.0)
                triangles.append(face.triangles + np.uint32(sum(len(part) for part in vertices)))
                vertices.append(face.vertices_m)
        return Mesh(np.concatenate(vertices), np.concatenate(triangles))

    def rings(self, s_m: FloatArray) -> FloatArray:
        """Return closed rings (lateral, height over the centre line), shape (S, N, 2): walls and roof, then floor."""
        shape = self.profile
        walls = self._widened(s_m) + self.wall_offset(s_m)[:, :, None] * shape.normals
        floor_count = max(2, int(np.ceil(2 * self.settings.half_width_m / self.settings.mesh_m)))
        floor_count = 2 if len(shape.u_m) == 4 else floor_count
        share = np.linspace(0.0, 1.0, floor_count + 1)
        lateral = walls[:, -1:, 0] + share * (walls[:, :1, 0] - walls[:, -1:, 0])
        station = np.broadcast_to(s_m[:, None], lateral.shape)
        height = self.floor_offset(station, lateral)
        walls[:, [0, -1], 1] = height[:, [-1, 0]]  # the corners are shared
        return np.concatenate([walls, np.stack([lateral, height], axis=2)[:, 1:-1]], axis=1)

    def _widened(self, s_m: FloatArray) -> FloatArray:
        """Return the nominal profile at each station, stretched by the widenings; shape (len(s), N, 2) or (N, 2)."""
        settings, points = self.settings, self.profile.points_m
        if not settings.widenings:
            return points
        at, *changes = np.array(settings.widenings).T
        left, right, roof = (np.interp(s_m, at, change)[:, None] for change in changes)
        lateral = points[:, 0] * (1.0 + np.where(points[:, 0] > 0.0, left, right) / settings.half_width_m)
        return np.stack([lateral, points[:, 1] * (1.0 + roof / settings.height_m)], axis=2)

    def _to_map(self, s_m: FloatArray, rings: FloatArray) -> FloatArray:
        """Return map coordinates, shape (len(s), N, 3), of (lateral, height) at each station."""
        x, y, z, heading = (column[:, None] for column in self.line.at(s_m).T)
        lateral, height = rings[..., 0], rings[..., 1]
        return np.stack([x - lateral * np.sin(heading), y + lateral * np.cos(heading), z + height], axis=-1)

    def _end_face(self, s_m: float, ring: FloatArray, *, outward: float) -> Mesh:
        """Return a rough face over `ring`: rings that shrink to a point, pushed along the drift."""
        steps = max(3, int(self.settings.half_width_m / self.settings.mesh_m / 2))
        shares = np.linspace(1.0, 0.0, steps)[:, None, None]
        middle = np.array([0.0, 0.5 * self.settings.height_m])
        flat = middle + shares * (ring - middle)
        bulge = self._ends.at(flat[..., 0], flat[..., 1]) + 0.3 * (1.0 - shares[..., 0] ** 4)
        bulge *= 1.0 - shares[..., 0] ** 8
        vertices = self._to_map(np.full(steps, s_m), flat)
        heading = float(np.interp(s_m, self.line.s_m, self.line.heading_rad))
        vertices[..., :2] += outward * bulge[..., None] * np.array([np.cos(heading), np.sin(heading)])
        return Mesh(vertices.reshape(-1, 3), _tube(steps, ring.shape[0]))


def _widest(settings: DriftSettings) -> float:
    """Return the largest widening to one side, metres."""
    return max((max(left, right, 0.0) for _, left, right, _ in settings.widenings), default=0.0)


def _tube(rings: int, points: int) -> Triangles:
    """Return the triangles between successive closed rings, shape (2·(rings − 1)·points, 3)."""
    start = np.arange(rings - 1, dtype=np.uint32)[:, None] * np.uint32(points)
    here = np.arange(points, dtype=np.uint32)
    after = (here + np.uint32(1)) % np.uint32(points)
    step = np.uint32(points)
    a, b = (start + here).ravel(), (start + after).ravel()
    return np.concatenate([np.stack([a, b, a + step], axis=1), np.stack([b, b + step, a + step], axis=1)])

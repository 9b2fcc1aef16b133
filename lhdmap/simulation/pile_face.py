"""The face that a drift ends in: a slope with rubble on it, as a mesh in the frame of its foot.

The face is a curve (along the drift, height) swept across the drift, bent in plan, and displaced along its normal: by smooth
waves, and by rocks, each a dome of its own size. It goes on below the floor and into the walls, which hide what is in them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.simulation.drift import Mesh, Triangles
from lhdmap.simulation.noise_field import Scales, noise_field
from lhdmap.simulation.pile_sections import SimulatedPileSettings

_BELOW_M = 0.6  # how deep under the floor the face begins
_BEND_OVER_M = 0.25  # height over which the slope changes at the bend
_TOP_DEG = 7.0  # slope of the top of a pile, behind its crest
_COVER = 1.6  # area of all rocks over the face's
_SPREAD = 0.38  # of the logarithm of the rocks' sizes
_WAVES = Scales(5, 1.2, 0.75)


class Room(NamedTuple):
    """The space that a face must fill: half width to either side, height, and depth behind the foot, metres."""

    half_width_m: float
    height_m: float
    depth_m: float


class Face(NamedTuple):
    """A face: points (T, Y, 3) along the drift (m), lateral, height over the foot; curve and places that they come from.

    `curve_m` (T, 2) is the nominal profile (along, height), `lateral_m` (Y,).
    """

    points_m: FloatArray
    curve_m: FloatArray
    lateral_m: FloatArray

    def mesh(self) -> Mesh:
        """Return the face as triangles in the frame of its foot."""
        rows, columns = self.points_m.shape[:2]
        return Mesh(self.points_m.reshape(-1, 3), sheet(rows, columns))

    def at(self, lateral_m: float, height_m: float) -> tuple[FloatArray, FloatArray]:
        """Return the point (3,) of the face at a lateral place and a nominal height, and its outward normal (3,)."""
        row = int(np.argmin(np.abs(self.curve_m[:, 1] - height_m)))
        row = min(max(row, 1), len(self.curve_m) - 2)
        column = int(np.argmin(np.abs(self.lateral_m - lateral_m)))
        along, up = self.curve_m[row + 1] - self.curve_m[row - 1]
        length = math.hypot(along, up)
        return self.points_m[row, column], np.array([-up / length, 0.0, along / length])


def sheet(rows: int, columns: int) -> Triangles:
    """Return the triangles of a grid of vertices, shape (2·(rows − 1)·(columns − 1), 3)."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    a, b, c, d = corner, corner + 1, corner + columns, corner + columns + 1
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)]).astype(np.uint32)


def make_face(settings: SimulatedPileSettings, room: Room, rng: np.random.Generator) -> Face:
    """Return the face of a pile (or a bare end wall) in a drift's `room`."""
    curve = profile_curve(settings, room)
    count = math.ceil(2 * room.half_width_m / settings.mesh_m)
    lateral = np.linspace(-room.half_width_m, room.half_width_m, count + 1)
    out = _displacement(settings, (len(curve), len(lateral)), rng)
    tangent = np.gradient(curve, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    flatter = 1.0 + settings.slope_change * np.clip(lateral / room.half_width_m, -1.0, 1.0)
    along = curve[:, :1] * flatter + plan_offset(settings, lateral, room.half_width_m) - out * tangent[:, 1:]
    height = curve[:, 1:] + out * tangent[:, :1]
    return Face(np.stack([along, np.broadcast_to(lateral, along.shape), height], axis=2), curve, lateral)


def profile_curve(settings: SimulatedPileSettings, room: Room) -> FloatArray:
    """Return the nominal profile (along, height), shape (T, 2), a point each `mesh_m`; (0, 0) is the foot."""
    step, foot = settings.mesh_m, math.radians(settings.slope_deg)
    below = math.ceil(_BELOW_M / (step * math.sin(foot)))
    ways = np.arange(-below, 1)[:, None] * step
    points = list(ways * [math.cos(foot), math.sin(foot)])
    while points[-1][1] < room.height_m and points[-1][0] < room.depth_m and len(points) < 5000:
        angle = _slope_rad(settings, float(points[-1][1]))
        points.append(points[-1] + step * np.array([math.cos(angle), math.sin(angle)]))
    return np.array(points)


def _slope_rad(settings: SimulatedPileSettings, height_m: float) -> float:
    share = min(max((height_m - settings.bend_m) / _BEND_OVER_M + 0.5, 0.0), 1.0)
    slope = settings.slope_deg + share * (settings.upper_slope_deg - settings.slope_deg)
    return math.radians(slope if height_m < settings.crest_m else min(slope, _TOP_DEG))


def plan_offset(settings: SimulatedPileSettings, lateral_m: FloatArray, half_width_m: float) -> FloatArray:
    """Return how far behind the straight foot line the face stands (m) at lateral places: skew, bulge and lobe."""
    share = np.clip(lateral_m / half_width_m, -1.2, 1.2)
    skew = -math.tan(math.radians(settings.skew_deg)) * lateral_m
    lobe = np.exp(-(((lateral_m - settings.lobe_lateral_m) / (0.6 * half_width_m)) ** 2))
    return skew - settings.bulge_m * (2.0 / 3.0 - share**2) - settings.lobe_m * lobe


def _displacement(settings: SimulatedPileSettings, shape: tuple[int, int], rng: np.random.Generator) -> FloatArray:
    """Return how far each vertex stands out along the normal (m), shape (T, Y), of mean zero."""
    up, across = (np.arange(count, dtype=np.float64) * settings.mesh_m for count in shape)
    waves_rng, rocks_rng = rng.spawn(2)
    out = np.zeros(shape)
    if settings.roughness_m > 0.0:
        waves = noise_field(waves_rng, _WAVES, (0.0, float(up[-1])), (0.0, float(across[-1])))
        waves.normalise(up, across, settings.roughness_m)
        out += waves.grid(up, across)
    if settings.d50_m > 0.0:
        rocks = _rocks(settings, shape, rocks_rng)
        out += rocks - rocks.mean()
    return out


def _rocks(settings: SimulatedPileSettings, shape: tuple[int, int], rng: np.random.Generator) -> FloatArray:
    """Return the height of the rocks over what they lie on (m), shape (T, Y): the highest of the domes at each place."""
    area = shape[0] * shape[1] * settings.mesh_m**2
    mean_area = 0.25 * math.pi * settings.d50_m**2 * math.exp(2 * _SPREAD**2)
    count = math.ceil(_COVER * area / mean_area)
    sizes = np.clip(settings.d50_m * np.exp(_SPREAD * rng.standard_normal(count)), 0.06, min(2.0 * settings.d50_m, 0.8))
    draws = rng.random((count, 5))
    out = np.zeros(shape)
    for size, draw in zip(sizes.tolist(), draws.tolist(), strict=True):
        _dome(out, size / settings.mesh_m, draw, size)
    return out


def _dome(out: FloatArray, cells: float, draw: list[float], size_m: float) -> None:
    """Lay one rock of a size (in cells, and in m) into `out`: an elliptic dome at a random place, with a random height."""
    row, column = draw[0] * out.shape[0], draw[1] * out.shape[1]
    half = 0.5 * cells
    low = (max(math.ceil(row - half), 0), max(math.ceil(column - half), 0))
    rows = np.arange(low[0], min(math.floor(row + half) + 1, out.shape[0])) - row
    columns = np.arange(low[1], min(math.floor(column + half) + 1, out.shape[1])) - column
    if not rows.size or not columns.size:
        return
    c, s, flat = math.cos(math.pi * draw[2]), math.sin(math.pi * draw[2]), 0.6 + 0.4 * draw[3]
    u = (rows[:, None] * c + columns * s) / half
    v = (columns * c - rows[:, None] * s) / (half * flat)
    height = size_m * (0.2 + 0.35 * draw[4])
    dome = height * np.sqrt(np.maximum(1.0 - u * u - v * v, 0.0))
    window = out[low[0] : low[0] + rows.size, low[1] : low[1] + columns.size]
    np.maximum(window, dome, out=window)

"""A grizzly that is worked on: scanners look at it, a hammer breaks, rolls or only cracks its rocks, small pieces fall through.

Frame: the rockbreaker's base. How rock answers to a blow is assumed: no paper says it. A blow breaks a rock with a chance that
falls with its size; one beside the middle may roll it away instead; what is left is as hard to break as before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lhdmap.errors import UsageError
from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.collision import Obstacles
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.grizzly import bar_meshes, seen_points, wall_meshes
from lhdmap.simulation.pile_rocks import cylinder, rock

_SMALLEST_M, _LARGEST_M = 0.5, 1.1
_GAP_M = 0.06
_FEED_M = 0.3  # how far the breaker is fed down until it meets rock
_ARM_SHARE = 0.6  # of a link's radius for collisions: what of it a scanner sees
_EASY, _HARD_PER_M = 0.95, 0.6  # chance that a blow breaks a rock of half a metre, and how it falls with size
_LEAST_CHANCE = 0.3
_ROLLS_FROM, _ROLL_CHANCE = 0.3, 0.5  # share of its half width beside the middle from which on a blow may roll a rock
_ROLL_M = (0.15, 0.45)
_PIECES = (0.45, 0.75)  # sizes of the two largest pieces over the rock's
_SHAPES, _PLACES = 40, 40  # that are tried for a rock


@dataclass(frozen=True, slots=True, eq=False)
class LyingRock:
    """A rock on the bars: its mesh in place, middle of its outline and top (3,), extents along x, y, z (3,), metres."""

    mesh: Mesh
    top_m: FloatArray
    extents_m: FloatArray

    @property
    def middle_m(self) -> float:
        """Its middle dimension: the side of the smallest opening that it falls through."""
        return float(np.sort(self.extents_m)[1])

    @property
    def reach_m(self) -> float:
        """Radius of the circle around its outline."""
        return 0.5 * float(np.hypot(*self.extents_m[:2]))


@dataclass(frozen=True, slots=True)
class Blow:
    """What a blow did: `missed`, `cracked`, `rolled` or `broke`, where the rock was (3,), and how many pieces stay on the bars."""

    outcome: str
    top_m: FloatArray | None = None
    left: int = 0


class GrizzlyWorld:
    """The truth of a grizzly over time; everything by `seed` alone."""

    def __init__(self, machine: Rockbreaker, seed: int, count: int, sizes_m: Sequence[float] = ()) -> None:
        """Lay `count` rocks that do not fall through, and before them one of each size that does not.

        Raises:
            UsageError: there is no room for so many.
        """
        self.machine, self._seed, self._looks = machine, seed, 0
        place, self._chance = (np.random.default_rng([seed, part]) for part in (0, 1))
        self.bars_m = float(place.uniform(-2.4, -1.9))
        self._fixed = [*bar_meshes(machine, self.bars_m), *wall_meshes(machine, self.bars_m)]
        self.rocks: list[LyingRock] = []
        for size_m in sizes_m:
            self._lay(place, float(size_m), float(size_m))
        for _ in range(count):
            self._lay(place, _SMALLEST_M, _LARGEST_M)

    @property
    def oversize(self) -> list[LyingRock]:
        """The rocks that do not fall through."""
        return [one for one in self.rocks if one.middle_m > self.machine.grizzly.opening_m]

    def look(self, arm_m: FloatArray | None = None) -> FloatArray:
        """Return the points (N, 3) that the scanners see now, with noise; `arm_m` (4, 3): joints R2, R3, R4 and the tip."""
        self._looks += 1
        meshes = [*self._fixed, *(one.mesh for one in self.rocks), *self._arm(arm_m)]
        return seen_points(meshes, np.random.default_rng([self._seed, 2, self._looks]))

    def obstacles(self, struck_m: FloatArray | None = None) -> Obstacles:
        """Return the true bars, walls and rocks, without the rock at `struck_m` (3,), which the tip is to touch."""
        under = None if struck_m is None else self._under(struck_m)
        points = [one.mesh.vertices_m for one in self.rocks if one is not under]
        boxes = np.array([[mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)] for mesh in self._fixed])
        names = tuple("the bars" if k < len(boxes) - 4 else "the walls" for k in range(len(boxes)))
        return Obstacles(boxes, names, np.concatenate(points) if points else None)

    def strike(self, tip_m: FloatArray) -> Blow:
        """Feed the breaker down from `tip_m` (3,) and hammer once."""
        struck = self._under(tip_m)
        if struck is None:
            return Blow("missed")
        beside_m = tip_m[:2] - struck.top_m[:2]
        off = float(np.hypot(*beside_m)) / (0.5 * float(struck.extents_m[:2].min()))
        size_m = float(struck.extents_m.max())
        breaks = max(_EASY - _HARD_PER_M * (size_m - 0.5), _LEAST_CHANCE)
        luck, rolling = self._chance.uniform(size=2)
        if rolling < _ROLL_CHANCE * max(off - _ROLLS_FROM, 0.0) and self._roll(struck, -beside_m):
            return Blow("rolled", struck.top_m, 1)
        if luck > breaks:
            return Blow("cracked", struck.top_m, 1)
        return Blow("broke", struck.top_m, self._break(struck, size_m))

    def _under(self, tip_m: FloatArray) -> LyingRock | None:
        """Return the rock whose outline is under a tip, within what the breaker is fed down."""
        for one in self.rocks:
            inside = np.hypot(*((tip_m - one.top_m)[:2] / (0.5 * one.extents_m[:2]))) < 1.0
            if inside and abs(float(tip_m[2] - one.top_m[2])) < _FEED_M:
                return one
        return None

    def _roll(self, struck: LyingRock, away_m: FloatArray) -> bool:
        way_m = self._chance.uniform(*_ROLL_M) * away_m / max(float(np.hypot(*away_m)), 1e-9)
        self.rocks.remove(struck)
        turn = float(self._chance.uniform(0.0, np.pi))
        rolled = _lying(_turned(struck.mesh, turn), struck.top_m[:2] + way_m, self.bars_m)
        free = self._is_free(rolled)
        self.rocks.append(rolled if free else struck)
        return free

    def _break(self, struck: LyingRock, size_m: float) -> int:
        """Take a rock away and lay its two largest pieces, if they do not fall through; return how many stay."""
        self.rocks.remove(struck)
        left = 0
        for share in self._chance.uniform(*_PIECES, 2):
            mesh = rock(size_m * float(share), self._chance)
            beside_m = self._chance.normal(0.0, 0.25 * left, 2)
            piece = _lying(mesh, struck.top_m[:2] + beside_m, self.bars_m)
            if piece.middle_m > self.machine.grizzly.opening_m and self._is_free(piece):
                self.rocks.append(piece)
                left += 1
        return left

    def _is_free(self, one: LyingRock) -> bool:
        """Whether a rock lies on the grizzly and clear of the others."""
        low, high = np.array(self.machine.grizzly.min_m), np.array(self.machine.grizzly.max_m)
        half_m = 0.5 * one.extents_m[:2]
        if (one.top_m[:2] < low + half_m).any() or (one.top_m[:2] > high - half_m).any():
            return False
        return all(
            float(np.hypot(*(one.top_m - other.top_m)[:2])) > one.reach_m + other.reach_m + _GAP_M
            for other in self.rocks
        )

    def _lay(self, place: np.random.Generator, least_m: float, most_m: float) -> None:
        low, high = np.array(self.machine.grizzly.min_m), np.array(self.machine.grizzly.max_m)
        for k in range(_SHAPES):  # where it is crowded, smaller ones find room
            size_m = float(np.exp(place.uniform(np.log(least_m), np.log(most_m + (least_m - most_m) * k / _SHAPES))))
            mesh = rock(size_m, place)
            for _ in range(_PLACES):
                one = _lying(mesh, place.uniform(low, high), self.bars_m)
                if one.middle_m > self.machine.grizzly.opening_m and self._is_free(one):
                    self.rocks.append(one)
                    return
        raise UsageError(f"no room on the grizzly for a rock besides {len(self.rocks)} others: fewer were wanted")

    def _arm(self, joints_m: FloatArray | None) -> list[Mesh]:
        if joints_m is None:
            return []
        radii_m = _ARM_SHARE * self.machine.per_joint("radius_m")[1:]
        return [
            cylinder(0.5 * (start + end), end - start, float(radius))
            for start, end, radius in zip(joints_m[:-1], joints_m[1:], radii_m, strict=True)
        ]


def _lying(mesh: Mesh, place_m: FloatArray, bars_m: float) -> LyingRock:
    """Return a mesh as a rock on the bars with the middle of its outline at a place (2,)."""
    low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
    shift = np.array([*(place_m - 0.5 * (low + high)[:2]), bars_m - low[2]])
    top_m = np.array([*place_m, bars_m + high[2] - low[2]])
    return LyingRock(Mesh(mesh.vertices_m + shift, mesh.triangles), top_m, high - low)


def _turned(mesh: Mesh, angle: float) -> Mesh:
    """Return a mesh turned about the vertical, and upside down as one that rolls."""
    c, s = np.cos(angle), np.sin(angle)
    T = np.array([[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]])  # proper: two reflections
    return Mesh(mesh.vertices_m @ T.T, mesh.triangles)

"""The piles of a mine while machines dig in them: which one a bucket is before, its side view, and what scanners see of it.

Piles change: a machine's state can be stepped again, but it meets the piles as they are now.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.ground.draws import DUG_M3, Attempt, draw_attempt, draw_load, hardness_factor
from lhdmap.simulation.ground.face import BUCKET_LENGTH_M
from lhdmap.simulation.ground.field import ACROSS_M, ALONG_M
from lhdmap.simulation.ground.heap import Heap
from lhdmap.simulation.ground.kernel import World
from lhdmap.simulation.ground.records import Record
from lhdmap.simulation.ground.sections import Grounds
from lhdmap.simulation.ground.truth import toe_of

TURN_NS, SHOW_NS = 100_000_000, 500_000_000
_REACH_M = 7.0  # a pile so far ahead of a lowered lip is the one that it will dig
_LEFT_M = 9.0  # a lip so far before the toe has left it
_PILE_M = 0.15
_ASKEW_RAD = 0.15
_EMPTY_KG = 500.0  # with less a new load begins

Show = Callable[[str, Mesh], None]


@dataclass
class Cut:
    """One attempt in one pile: the side view along the machine's heading. Its x begins at the grid's first row."""

    name: str
    heap: Heap
    columns: tuple[int, int]
    rock: Record
    world: World
    chance: Attempt
    number: int
    begun_m3: float

    def place_m(self, x_m: float, y_m: float) -> float:
        """Return where a point of `map` is along the heading."""
        grid = self.heap.grid
        return (x_m - grid.x_m) * math.cos(grid.heading_rad) + (y_m - grid.y_m) * math.sin(grid.heading_rad)

    @property
    def toe_m(self) -> float:
        """Where the pile begins along the heading."""
        return toe_of(self.world.heights, 0.0)

    def turn(self, dt_s: float, lip_m: float, per_s: float) -> None:
        """Give the rock back to the field, let that slide around the bucket, and take the new slice."""
        first, last = self.columns
        lip = round(lip_m / ALONG_M)
        self.heap.give_back(first, last, self.world.heights)
        self.heap.slide(dt_s, per_s, (first, last, lip, lip - round(BUCKET_LENGTH_M / ALONG_M)))
        self.world.heights[:] = self.heap.slice_m(first, last)


@dataclass
class _Common:
    """What machines that dig in the same heaps share: when each heap slid, when and in which version it was shown."""

    slid_ns: dict[str, int] = field(default_factory=dict)
    shown_ns: int = -1
    shown: dict[str, int] = field(default_factory=dict)


@dataclass
class Piles:
    """Piles by name as one machine digs in them. `show` takes a pile's surface whenever it has changed: `MineWorld.dig`."""

    heaps: dict[str, Heap]
    ground: Grounds
    width_m: float = 2.4
    seed: int = 0
    show: Show | None = None
    cut: Cut | None = None
    attempts: int = 0
    _loads: int = 0
    _digs: int = 0
    _turned_ns: int = -1
    _common: _Common = field(default_factory=_Common)

    def for_another(self, seed: int) -> Piles:
        """Return the same piles for another machine: attempts and chance of its own, in the same heaps."""
        return Piles(self.heaps, self.ground, self.width_m, seed, self.show, _common=self._common)

    def follow(
        self, now_ns: int, lip_m: FloatArray, heading_rad: float, load_kg: float, *, lowered: bool
    ) -> Cut | None:
        """Return the attempt that a lip at x, y of `map` is in; `lowered`: whether the bucket is out of tramming posture."""
        cut = self.cut
        if cut is not None:
            along = cut.place_m(*lip_m.tolist())
            askew = abs(math.remainder(heading_rad - cut.heap.grid.heading_rad, 2 * math.pi))
            inside = along > cut.toe_m - 0.5
            if not (lowered or inside) or askew > _ASKEW_RAD or along < cut.toe_m - _LEFT_M:
                self._end()
            elif now_ns - self._turned_ns >= TURN_NS:
                cut.turn(TURN_NS * 1e-9, along, self.ground.face.slide_per_s)
                self._turned_ns = now_ns
        elif now_ns - self._turned_ns >= TURN_NS:
            self._turned_ns = now_ns
            for name, heap in self.heaps.items():
                if not heap.calm and now_ns - self._common.slid_ns.get(name, -TURN_NS) >= TURN_NS:  # by another machine
                    self._common.slid_ns[name] = now_ns
                    heap.slide(TURN_NS * 1e-9, self.ground.face.slide_per_s)
            if lowered:
                self._begin(lip_m, heading_rad, load_kg)
        self._exchange(now_ns)
        return self.cut

    def _begin(self, lip_m: FloatArray, heading_rad: float, load_kg: float) -> None:
        """Begin an attempt in the pile that lies ahead, if there is one."""
        ways = np.arange(0.0, _REACH_M, 0.2)[:, None]
        points = lip_m + ways * np.array([math.cos(heading_rad), math.sin(heading_rad)])
        for name, heap in self.heaps.items():
            if (heap.height_at(points) > _PILE_M).any():
                self.cut = self._cut(name, heap, lip_m, heading_rad, load_kg)
                return

    def _cut(self, name: str, heap: Heap, lip_m: FloatArray, heading_rad: float, load_kg: float) -> Cut:
        if load_kg < _EMPTY_KG and self._digs > 0:  # what was dug has been dumped: a new load
            self._loads, self._digs = self._loads + 1, 0
        self.attempts += 1
        heap.settle()
        left, half = heap.turn_to(lip_m, heading_rad), round(0.5 * self.width_m / ACROSS_M)
        seed = zlib.crc32(f"{self.seed} {name} {self._loads}".encode())
        load = draw_load(self.ground, seed)
        rock = load.rock.copy()
        rock["origin_m"], rock["step_m"], rock["slope"], rock["lateral_share"] = 0.0, ALONG_M, heap.slope, 0.0
        rock["hardness"] *= hardness_factor(self.ground, seed, self._digs + 1)
        columns = (left - half, left + half - 1)
        heights = heap.slice_m(*columns)
        toe, along = toe_of(heights, 0.0), float(heap.grid.places(lip_m)[0]) * ALONG_M
        chance = draw_attempt(self.ground, seed, self.attempts, along, max(toe - along, 0.0))
        world = World(heights, load.table, chance.noise, chance.strikes, chance.bumps)
        return Cut(name, heap, columns, rock, world, chance, self.attempts, heap.volume_m3 - heap.came_m3)

    def _end(self) -> None:
        if self.cut is not None:
            heap = self.cut.heap
            heap.give_back(*self.cut.columns, self.cut.world.heights)
            heap.calm = False
            self._digs += self.cut.begun_m3 - (heap.volume_m3 - heap.came_m3) > DUG_M3
        self.cut = None

    def _exchange(self, now_ns: int) -> None:
        """Show what has changed, not more often than scanners need it."""
        common = self._common
        if self.show is None or now_ns - common.shown_ns < SHOW_NS:
            return
        common.shown_ns = now_ns
        for name, heap in self.heaps.items():
            if common.shown.get(name, 0) != heap.version:
                common.shown[name] = heap.version
                self.show(name, heap.mesh())

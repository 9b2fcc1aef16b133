"""The piles of a simulated mine's draw points as fields of heights that are dug."""

from __future__ import annotations

import math
import zlib

import numpy as np
from scipy.spatial import KDTree

from lhdmap.messages import FloatArray
from lhdmap.mine.plan import PlacePlan
from lhdmap.mine.stands import place_end, toe_back_m
from lhdmap.simulation.ground.draws import generator
from lhdmap.simulation.ground.field import ACROSS_M, ALONG_M, Bools, Grid
from lhdmap.simulation.ground.heap import Heap
from lhdmap.simulation.ground.piles import Piles
from lhdmap.simulation.ground.sections import Grounds
from lhdmap.simulation.mine_world.world import MineWorld
from lhdmap.simulation.raycast import Surface

_BEFORE_M = 8.0  # of the grid before the toe
_STATION_M = 0.1
_BESIDE_M = 0.2  # how far ore reaches into a rough wall
_NOT_ORE = ("wall", "hang_up")  # nothing to dig at the floor
_OVER_M = 12.0  # from where the drawn pile is looked at
_SLOPE_DEG = (46.0, 53.0)  # autonomous_loading, Table 6


def mine_piles(world: MineWorld, ground: Grounds, *, seed: int = 0) -> Piles:
    """Return the piles of all draw points of `world`, which shows them from now on; of a surveyed mine there are none."""
    places = [place for place in world.network.plan.places if place.kind == "draw_point" and place.name in world.things]
    heaps = {place.name: heap_of(world, place, seed) for place in places if place.pile not in _NOT_ORE}
    return Piles(heaps, ground, world.machine.digging.bucket_width_m, seed, world.dig)


def heap_of(world: MineWorld, place: PlacePlan, seed: int) -> Heap:
    """Return the pile of a draw point as it is drawn, on the floor of its drift."""
    network = world.network
    index, end_m, direction = place_end(network, place)
    tube = network.tubes[index]
    start_m = end_m - direction * (toe_back_m(tube.length_m) + _BEFORE_M)
    x, y, z, heading = tube.pose(start_m, direction).tolist()
    half = tube.half_width_m(end_m) + 0.6
    shape = math.ceil(abs(end_m - start_m) / ALONG_M), 2 * math.ceil(half / ACROSS_M)
    side = 0.5 * (shape[1] - 1) * ACROSS_M
    grid = Grid(x + side * math.sin(heading), y - side * math.cos(heading), heading, shape)
    line = tube.line.at(np.arange(0.0, tube.length_m + _STATION_M, _STATION_M))
    halves = np.interp(np.arange(len(line)) * _STATION_M, *tube.widths_m.T) / 2.0
    tree = KDTree(line[:, :2])

    def inside(points_m: FloatArray) -> Bools:
        apart, station = tree.query(points_m)
        along = np.asarray(station) * _STATION_M * direction
        found: Bools = (
            (apart < halves[station] + _BESIDE_M) & (along < end_m * direction) & (along > start_m * direction - 3.0)
        )
        return found

    def floor(points_m: FloatArray) -> FloatArray:
        flat = points_m.reshape(-1, 2)
        height = world.floor_height(np.column_stack([flat, np.full(len(flat), z)]))
        return np.where(np.isfinite(height), height, z).reshape(points_m.shape[:-1])

    rng = generator(zlib.crc32(f"{seed} {place.name}".encode()), 10)
    heights = _drawn(world, place.name, grid, z) - floor(grid.points())
    return Heap(grid, heights, math.tan(math.radians(rng.uniform(*_SLOPE_DEG))), inside, floor)


def _drawn(world: MineWorld, name: str, grid: Grid, z_m: float) -> FloatArray:
    """Return the height of the drawn pile's surface in the cells, as seen from over it; far below where it is not."""
    surface = Surface(world.things[name].mesh)
    points = grid.points().reshape(-1, 2)
    rays = np.zeros((len(points), 6), dtype=np.float32)
    rays[:, :2] = points - surface.origin_m[:2]
    rays[:, 2], rays[:, 5] = z_m + _OVER_M - surface.origin_m[2], -1.0
    ranges = surface.cast(rays).astype(float)
    return np.where(np.isfinite(ranges), z_m + _OVER_M - ranges, z_m - _OVER_M).reshape(grid.shape)

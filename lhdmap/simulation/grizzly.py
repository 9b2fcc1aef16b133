"""A grizzly with rocks on it as a cloud, and what is true of it: what the rockbreaker's scanners would see.

Frame: the rockbreaker's base (x along the grizzly's middle, y left, z up). Two scanners look down from beside the machine.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.integration.cloud import GridCloud
from lhdmap.integration.cloud_io import write_cloud
from lhdmap.messages import FloatArray
from lhdmap.outputs import OutputFiles
from lhdmap.rockbreaker.machine import Rockbreaker
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.pile_rocks import box, rock

_BAR_M, _DEPTH_M = 0.1, 0.3
_SCANNERS_M = ((0.3, 2.6, 4.0), (0.3, -2.6, 4.0))
_STEP_DEG = 0.35
_NOISE_M = 0.012
_SMALLEST_M, _LARGEST_M = 0.25, 1.3
_GAP_M = 0.08


@dataclass(frozen=True, slots=True)
class PlacedRock:
    """A rock as it lies: middle of its outline and top (3,), dimensions along x, y, z (3,), and largest extent, metres."""

    top_m: FloatArray
    extents_m: FloatArray
    size_m: float


@dataclass(frozen=True, slots=True)
class GrizzlyScene:
    """The cloud (N, 3), the height of the bars, and the rocks, in the base's frame."""

    points_m: FloatArray
    bars_m: float
    rocks: tuple[PlacedRock, ...]


def simulate_grizzly(machine: Rockbreaker, seed: int, rocks: int | None = None) -> GrizzlyScene:
    """Return a scene with `rocks` rocks (default: 2 to 6) that do not touch each other."""
    rng = np.random.default_rng(seed)
    bars_m = float(rng.uniform(-2.4, -1.9))
    meshes = [*bar_meshes(machine, bars_m), *wall_meshes(machine, bars_m)]
    placed: list[PlacedRock] = []
    for _ in range(int(rng.integers(2, 7)) if rocks is None else rocks):
        found = _place(machine, bars_m, placed, rng)
        if found is not None:
            meshes.append(found[0])
            placed.append(found[1])
    return GrizzlyScene(seen_points(meshes, rng), bars_m, tuple(placed))


def bar_meshes(machine: Rockbreaker, top_m: float) -> list[Mesh]:
    """Return bars along x and y, their openings as wide as the machine's grizzly says."""
    low, high = np.array(machine.grizzly.min_m), np.array(machine.grizzly.max_m)
    pitch = machine.grizzly.opening_m + _BAR_M
    bottom_m = top_m - _DEPTH_M
    across = [
        box(np.array([x, low[1], bottom_m]), np.array([x + _BAR_M, high[1] + _BAR_M, top_m]))
        for x in np.arange(low[0], high[0] + 1e-6, pitch)
    ]
    along = [
        box(np.array([low[0], y, bottom_m]), np.array([high[0] + _BAR_M, y + _BAR_M, top_m]))
        for y in np.arange(low[1], high[1] + 1e-6, pitch)
    ]
    return across + along


def wall_meshes(machine: Rockbreaker, bars_m: float) -> list[Mesh]:
    """Return the walls of the chamber around the grizzly and the bottom of the ore pass."""
    low, high = np.array(machine.grizzly.min_m), np.array(machine.grizzly.max_m)
    top, bottom = bars_m + 6.0, bars_m - 5.0
    sides = [(low[1] - 1.6, low[1] - 1.3), (high[1] + 1.3, high[1] + 1.6)]
    walls = [box(np.array([0.8, y0, bottom]), np.array([high[0] + 2.5, y1, top])) for y0, y1 in sides]
    walls.append(box(np.array([high[0] + 2.2, low[1] - 1.6, bottom]), np.array([high[0] + 2.5, high[1] + 1.6, top])))
    walls.append(box(np.array([0.8, low[1] - 1.6, bottom - 0.3]), np.array([high[0] + 2.5, high[1] + 1.6, bottom])))
    return walls


def _place(
    machine: Rockbreaker, bars_m: float, others: list[PlacedRock], rng: np.random.Generator
) -> tuple[Mesh, PlacedRock] | None:
    """Return a rock on the bars that is clear of the others, or None where no place was found."""
    low, high = np.array(machine.grizzly.min_m), np.array(machine.grizzly.max_m)
    size = float(np.exp(rng.uniform(math.log(_SMALLEST_M), math.log(_LARGEST_M))))
    shape = rock(size, rng)
    extents = np.ptp(shape.vertices_m, axis=0)
    for _ in range(40):
        half = 0.5 * extents[:2]
        middle = rng.uniform(low + half, high - half)
        if all(np.hypot(*(middle - one.top_m[:2])) > 0.5 * (size + one.size_m) + _GAP_M for one in others):
            centre = 0.5 * (shape.vertices_m.min(axis=0) + shape.vertices_m.max(axis=0))
            shift = np.array([*middle, bars_m + 0.5 * extents[2]]) - centre
            placed = PlacedRock(np.array([*middle, bars_m + extents[2]]), extents, size)
            return Mesh(shape.vertices_m + shift, shape.triangles), placed
    return None


def seen_points(meshes: list[Mesh], rng: np.random.Generator) -> FloatArray:
    """Return the points (N, 3) that the scanners see, with noise."""
    from lhdmap.simulation.raycast import Surface

    offsets = np.cumsum([0, *(len(mesh.vertices_m) for mesh in meshes[:-1])])
    triangles = np.concatenate([mesh.triangles + at for mesh, at in zip(meshes, offsets, strict=True)])
    surface = Surface(Mesh(np.concatenate([mesh.vertices_m for mesh in meshes]), triangles.astype(np.uint32)))
    azimuth, elevation = np.radians(np.meshgrid(np.arange(-90, 90, _STEP_DEG), np.arange(-89, 20, _STEP_DEG)))
    directions = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1
    ).reshape(-1, 3)
    points = []
    for scanner in _SCANNERS_M:
        origins = np.tile(np.array(scanner) - surface.origin_m, (len(directions), 1))
        ranges = surface.cast(np.hstack([origins, directions]).astype(np.float32)).astype(np.float64)
        hit = np.isfinite(ranges)
        noisy = ranges[hit] + rng.normal(0.0, _NOISE_M, int(hit.sum()))
        points.append(np.array(scanner) + noisy[:, None] * directions[hit])
    return np.concatenate(points)


def truth_path(path: Path) -> Path:
    """Return where the truth of the cloud `path` goes."""
    return path.with_name(path.stem + ".grizzly.json")


def write_scene(path: Path, machine: Rockbreaker, scene: GrizzlyScene, *, force: bool = False) -> Path:
    """Write the cloud in the frame that the machine says it stands in, and the truth as JSON, whose path is returned.

    Raises:
        UsageError: one of the files is there already, without `force`.
    """
    T_cloud_base, truth = machine.T_cloud_base, truth_path(path)
    points_m = scene.points_m @ T_cloud_base[:3, :3].T + T_cloud_base[:3, 3]
    with OutputFiles(truth, path, force=force) as files:
        write_cloud(files.at(path), GridCloud(points_m.astype(np.float32)))
        text = json.dumps(scene_json(machine, scene), indent=1)
        files.at(truth).write_text(text + "\n", encoding="utf-8")
    return truth


def scene_json(machine: Rockbreaker, scene: GrizzlyScene) -> dict[str, Any]:
    """Return the truth: bars, rocks, and which of them do not fall through the openings."""
    opening_m = machine.grizzly.opening_m
    rocks = [
        {
            "top_m": np.round(one.top_m, 4).tolist(),
            "extents_m": np.round(one.extents_m, 4).tolist(),
            "size_m": round(one.size_m, 4),
            "oversize": bool(np.sort(one.extents_m)[1] > opening_m),
        }
        for one in scene.rocks
    ]
    return {"frame": "base", "bars_m": scene.bars_m, "opening_m": opening_m, "rocks": rocks}

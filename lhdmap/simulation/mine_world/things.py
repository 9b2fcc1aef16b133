"""What stands in a mine: piles in draw points, the pit and grizzly of a dump, equipment, people."""

from __future__ import annotations

import functools
import math
import zlib
from dataclasses import replace

import numpy as np

from lhdmap.errors import ConfigError
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.mine.network import Network
from lhdmap.mine.plan import EquipmentPlan, PlacePlan
from lhdmap.mine.stands import PIT_M, place_end, toe_back_m
from lhdmap.simulation.crossing import joined
from lhdmap.simulation.drift import Drift, FloorHeight, Mesh
from lhdmap.simulation.pile import make_pile
from lhdmap.simulation.pile_rocks import box, cylinder, standing_machine
from lhdmap.simulation.pile_scenes import scene

_STOP_M = (0.4, 0.45)  # stop log before it: length, height
_DEEP_M = 6.0
_BAR_M, _OPENING_M = 0.12, 0.45
_PERSON_M = (0.25, 1.75)  # radius, height


def pile_of(network: Network, place: PlacePlan, drift: Drift, machine: Machine, taken_m: float = 0.0) -> Mesh:
    """Return the pile of a draw point; its face has moved back by `taken_m`."""
    index, end_m, direction = place_end(network, place)
    seed = zlib.crc32(f"{network.plan.seed} {place.name}".encode())
    settings = scene(place.pile, seed % 10_000).pile
    if settings is None:
        raise ConfigError(f"'{place.name}': a scene without a pile")
    back_m = max(toe_back_m(network.tubes[index].length_m) - taken_m, 0.5)
    if direction < 0:
        drift = drift.reversed()
        end_m = drift.line.length_m
    settings = replace(settings, toe_m=max(end_m - back_m, 0.0), back_m=back_m)
    pile = make_pile(settings, drift, end_m - back_m, machine, np.random.default_rng([seed, 7]))
    return functools.reduce(joined, pile.meshes())


def dump_of(network: Network, place: PlacePlan, floor: FloorHeight) -> Mesh:
    """Return the open end of a dump: a stop log, the walls of the pit, and a grizzly over it."""
    index, end_m, direction = place_end(network, place)
    tube = network.tubes[index]
    start_m = end_m - direction * PIT_M
    pose = tube.pose(start_m, direction)
    half = tube.half_width_m(start_m) + 0.5
    z = float(floor(pose[None, :3])[0])
    parts = [box(np.array([-_STOP_M[0], -half, -0.3]), np.array([0.0, half, _STOP_M[1]]))]
    corners = np.array([[0.0, -half], [0.0, half], [PIT_M + 1.0, half], [PIT_M + 1.0, -half]])
    upright = np.array([[x, y, h] for h in (0.05, -_DEEP_M) for x, y in corners])
    sides = [[k, (k + 1) % 4, 4 + k] for k in range(4)] + [[(k + 1) % 4, 4 + (k + 1) % 4, 4 + k] for k in range(4)]
    parts.append(Mesh(upright, np.array([*sides, [4, 5, 6], [4, 6, 7]], dtype=np.uint32)))
    bars = np.arange(-half, half, _OPENING_M + _BAR_M)
    parts += [box(np.array([0.0, y, -0.15]), np.array([PIT_M, y + _BAR_M, 0.0])) for y in bars]
    mesh = functools.reduce(joined, parts)
    return placed(mesh, np.array([pose[0], pose[1], z, pose[3]]))


def equipment_of(network: Network, thing: EquipmentPlan, machine: Machine, floor: FloorHeight) -> Mesh:
    """Return something that stands in a drift."""
    tube = network.tubes[network.tube(thing.drift)]
    pose = tube.pose(min(thing.at_m, tube.length_m))
    pose[:2] += thing.lateral_m * np.array([-math.sin(pose[3]), math.cos(pose[3])])
    pose[2] = float(floor(pose[None, :3])[0])
    pose[3] += math.radians(thing.turn_deg)
    return placed(shape_of(thing.kind, thing.size_m, machine), pose)


def shape_of(kind: str, size_m: tuple[float, float, float], machine: Machine) -> Mesh:
    """Return a thing of a kind around its own origin on the floor."""
    if kind == "person":
        return cylinder(np.array([0.0, 0.0, 0.5 * _PERSON_M[1]]), np.array([0.0, 0.0, _PERSON_M[1]]), _PERSON_M[0])
    if kind == "post":
        return cylinder(np.array([0.0, 0.0, 2.0]), np.array([0.0, 0.0, 5.0]), 0.2)
    if kind == "machine":
        parts = standing_machine(machine)
        mesh = functools.reduce(joined, parts)
        return Mesh(mesh.vertices_m + np.array([0.5 * machine.dimensions.wheelbase_m, 0.0, 0.0]), mesh.triangles)
    half = 0.5 * np.array([size_m[0], size_m[1], 0.0])
    return box(-half - np.array([0.0, 0.0, 0.1]), half + np.array([0.0, 0.0, size_m[2]]))


def placed(mesh: Mesh, pose: FloatArray) -> Mesh:
    """Return a mesh at x, y, z, heading, shape (4,)."""
    c, s = math.cos(pose[3]), math.sin(pose[3])
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Mesh(mesh.vertices_m @ R.T + pose[:3], mesh.triangles)

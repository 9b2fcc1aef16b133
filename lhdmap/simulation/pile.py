"""What stands at the end of a simulated drift: the face of the pile, boulders in it, rocks before it, obstacles."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.geometry.frame import UprightFrame
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.crossing import joined
from lhdmap.simulation.drift import Drift, Mesh
from lhdmap.simulation.pile_face import Face, Room, make_face
from lhdmap.simulation.pile_rocks import cylinder, extent, rock, standing_machine
from lhdmap.simulation.pile_sections import SimulatedPileSettings

_MARGIN_M = 0.6  # how far the face goes into walls, roof and end


class Oversize(NamedTuple):
    """A boulder: its mesh and middle (3,) in the frame of the foot, and its largest extent (m)."""

    mesh: Mesh
    middle_m: FloatArray
    size_m: float


class Pile(NamedTuple):
    """All that stands at the end of a drift, in the frame of the foot: x along its end heading, at arc length `place_m`."""

    settings: SimulatedPileSettings
    frame: UprightFrame
    place_m: float
    face: Face | None
    boulders: tuple[Oversize, ...]
    others: tuple[Mesh, ...]

    def meshes(self) -> list[Mesh]:
        """Return all parts in `map`."""
        parts = [self.face.mesh()] if self.face is not None else []
        parts += [boulder.mesh for boulder in self.boulders]
        return [Mesh(self.frame.map(part.vertices_m), part.triangles) for part in [*parts, *self.others]]

    def joined_to(self, mesh: Mesh) -> Mesh:
        """Return a mesh of the drift with all parts."""
        for part in self.meshes():
            mesh = joined(mesh, part)
        return mesh


def make_pile(
    settings: SimulatedPileSettings, drift: Drift, place_m: float, machine: Machine, rng: np.random.Generator
) -> Pile:
    """Return the pile whose foot lies at arc length `place_m` of the drift."""
    x, y, z, heading = drift.line.at(np.array([place_m]))[0].tolist()
    frame = UprightFrame(np.array([x, y, z]), heading)
    face_rng, rock_rng = rng.spawn(2)
    room = _room(drift, place_m)
    face = make_face(settings, room, face_rng) if settings.face else None
    boulders = [_boulder(face, place, rock_rng) for place in settings.boulders] if face is not None else []
    others = _spill(settings, drift, place_m, rock_rng) + _obstacle(settings, drift, place_m, machine)
    return Pile(settings, frame, place_m, face, tuple(boulders), tuple(others))


def _room(drift: Drift, place_m: float) -> Room:
    """Return the room around and behind the foot, with a margin."""
    rings = drift.rings(np.arange(place_m - 2.0, drift.line.length_m, 0.25))
    depth = drift.line.length_m - place_m
    rise = float(
        np.abs(
            drift.line.z_m[drift.line.s_m > place_m - 2.0] - np.interp(place_m, drift.line.s_m, drift.line.z_m)
        ).max()
    )
    return Room(
        float(np.abs(rings[..., 0]).max()) + _MARGIN_M, float(rings[..., 1].max()) + rise + _MARGIN_M, depth + 2.0
    )


def _boulder(face: Face, place: tuple[float, float, float, float], rng: np.random.Generator) -> Oversize:
    lateral, height, size, share_out = place
    point, normal = face.at(lateral, height)
    mesh = rock(size, rng)
    reach = float((mesh.vertices_m @ normal).max() - (mesh.vertices_m @ normal).min())
    middle = point + normal * (share_out - 0.5) * reach
    return Oversize(Mesh(mesh.vertices_m + middle, mesh.triangles), middle, extent(mesh.vertices_m))


def _spill(settings: SimulatedPileSettings, drift: Drift, place_m: float, rng: np.random.Generator) -> list[Mesh]:
    """Return rocks on the floor before the foot, most of them near it."""
    parts = []
    for _ in range(settings.spill):
        size = settings.spill_size_m * math.exp(0.35 * rng.standard_normal())
        along = -settings.spill_reach_m * float(rng.random()) ** 1.5 - 0.2
        lateral = float(rng.uniform(-1.0, 1.0)) * (drift.settings.half_width_m - 0.3)
        mesh = rock(size, rng)
        floor = float(floor_height(drift, place_m, np.array([along]), np.array([lateral]))[0])
        lift = floor - float(mesh.vertices_m[:, 2].min()) - 0.1 * size
        parts.append(Mesh(mesh.vertices_m + np.array([along, lateral, lift]), mesh.triangles))
    return parts


def floor_height(drift: Drift, place_m: float, along_m: FloatArray, lateral_m: FloatArray) -> FloatArray:
    """Return the floor's height over the foot's origin at points (N,), (N,) of the frame of the foot, shape (N,)."""
    s, line = place_m + along_m, drift.line
    rise: FloatArray = np.interp(s, line.s_m, line.z_m) - np.interp(place_m, line.s_m, line.z_m)
    return rise + drift.floor_offset(s, lateral_m)


def _obstacle(settings: SimulatedPileSettings, drift: Drift, place_m: float, machine: Machine) -> list[Mesh]:
    """Return what stands at the foot: a machine whose nearest point is there, or a post from floor to roof."""
    lateral = settings.obstacle_lateral_m
    floor = float(floor_height(drift, place_m, np.zeros(1), np.array([lateral]))[0])
    if settings.obstacle == "post":
        height = drift.settings.height_m + 2.0
        return [cylinder(np.array([0.0, lateral, floor + 0.5 * height - 0.5]), np.array([0.0, 0.0, height]), 0.2)]
    if settings.obstacle != "machine":
        return []
    turn = math.radians(settings.obstacle_turn_deg)
    c, s = math.cos(turn), math.sin(turn)
    parts = standing_machine(machine)
    turned = [part.vertices_m @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) for part in parts]
    nearest = min(float(vertices[:, 0].min()) for vertices in turned)
    middle = 0.5 * (min(float(v[:, 1].min()) for v in turned) + max(float(v[:, 1].max()) for v in turned))
    shift = np.array([-nearest, lateral - middle, floor])
    return [Mesh(vertices + shift, part.triangles) for vertices, part in zip(turned, parts, strict=True)]

"""A mine to drive in: what rays meet, what wheels stand on and what bodies touch, near wherever a machine is."""

from __future__ import annotations

import functools
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from lhdmap.errors import ConfigError
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.mine.network import Network
from lhdmap.mine.plan import DustPlan, PlacePlan, WetPlan
from lhdmap.mine.stands import PIT_M, place_end
from lhdmap.simulation.drift import FloorHeight, Mesh
from lhdmap.simulation.mine_world.hollow import Skin
from lhdmap.simulation.mine_world.pieces import Pieces
from lhdmap.simulation.mine_world.survey import SurveyedSkins
from lhdmap.simulation.mine_world.things import dump_of, equipment_of, pile_of
from lhdmap.simulation.raycast import Layered, Surface
from lhdmap.simulation.surroundings import Rays

Zone = TypeVar("Zone", WetPlan, DustPlan)
TILE_M = 100.0
_WHOLE_PIECES = 120  # of a mine that is one scene: some 1.8 km, 3 million triangles, 400 MiB
_PIECES = 512  # that are kept: the surface of some 6 km
_STATION_M = 0.5
_SCENES = 2  # that are kept: a machine may go to and fro between two


class Thing(NamedTuple):
    """Something that stands in the mine: its mesh, the box around it (2, 3), which of its kind it is, whether bodies touch it."""

    mesh: Mesh
    box_m: FloatArray
    version: int = 0
    touched: bool = True


class Skins(Protocol):
    """A surface in pieces."""

    @property
    def boxes_m(self) -> FloatArray:
        """Boxes around the pieces, shape (N, 2, 3)."""
        ...

    def skin(self, index: int) -> Skin:
        """Return the surface of a piece."""
        ...

    def floor_height(self, points_m: FloatArray) -> FloatArray:
        """Return the floor's height (N,) under points (N, 3)."""
        ...


class MineWorld:
    """The world of a plan; all in it follows from the plan and its seed. `view_m` is how far scanners see."""

    def __init__(self, network: Network, machine: Machine, *, view_m: float = 85.0) -> None:
        self.network, self.machine, self.view_m = network, machine, view_m
        self._pieces = None if network.plan.surface.file else Pieces(network)
        self._skins: Skins = SurveyedSkins(network) if self._pieces is None else self._pieces
        self._boxes = self._skins.boxes_m
        self._line = functools.lru_cache(maxsize=None)(self._make_line)
        self.piece = functools.lru_cache(maxsize=_PIECES)(self._make_piece)
        self._scenes: OrderedDict[frozenset[int], Surface] = OrderedDict()
        self._here: tuple[tuple[float, ...], Surface] | None = None
        self._things: dict[str, Thing] = {}
        self._passing: dict[str, tuple[Thing, Surface]] = {}
        self._version = 0
        self._taken_m: dict[str, float] = {}
        self._pits = _pits(network)
        self._furnish()

    # What machines and sensors ask.

    def near(self, position_m: FloatArray) -> Rays:
        """Return what rays from a point (3,) of `map` meet."""
        tile = tuple(((np.floor(position_m / TILE_M) + 0.5) * TILE_M).tolist())
        if self._here is None or self._here[0] != tile:
            self._here = (tile, self._scene(np.array(tile)))
        scene = self._here[1]
        return scene if not self._passing else Layered(scene, [surface for _, surface in self._passing.values()])

    def floor_height(self, points_m: FloatArray) -> FloatArray:
        """Return the floor's height (N,) under points (N, 3); their z says which level."""
        return self._skins.floor_height(points_m)

    @property
    def floor(self) -> FloorHeight:
        """The function behind `floor_height`."""
        return self._skins.floor_height

    def friction(self, position_m: FloatArray) -> float:
        """Return the friction of tyres on the floor at a point (3,)."""
        plan = self.network.plan
        return min((zone.friction for zone in self._zones_at(plan.wet, position_m)), default=plan.floor.friction)

    def dust(self, position_m: FloatArray) -> float:
        """Return the share of beams that dust returns to a scanner at a point (3,)."""
        return max((one.share for one in self._zones_at(self.network.plan.dust, position_m)), default=0.0)

    def keys_in(self, box_m: FloatArray) -> list[int | str]:
        """Return keys of the pieces and things that overlap a box (2, 3); what has a key stays as it is."""
        things = {**self._things, **{name: thing for name, (thing, _) in self._passing.items()}}
        pieces: list[int | str] = list(np.flatnonzero(_overlap(self._boxes, box_m)).tolist())
        return pieces + [
            f"{name}#{thing.version}"
            for name, thing in things.items()
            if thing.touched and _overlap(thing.box_m[None], box_m)[0]
        ]

    def solid(self, key: int | str) -> tuple[Mesh, npt.NDArray[np.bool_] | None]:
        """Return the mesh behind a key, and which of its triangles are floor (None: none)."""
        if isinstance(key, int):
            skin = self.piece(key)
            return skin.mesh, skin.floor
        name = key.rpartition("#")[0]
        thing = self._passing[name][0] if name in self._passing else self._things[name]
        return thing.mesh, None

    @property
    def surveyed(self) -> bool:
        """Whether the surface is that of a survey."""
        return self._pieces is None

    @property
    def version(self) -> int:
        """Goes up whenever something appears, goes or changes."""
        return self._version

    # What changes.

    def load(self, draw_point: str, depth_m: float) -> None:
        """Take rock from a draw point's pile: its face moves back by a depth."""
        place = next(one for one in self.network.plan.places if one.name == draw_point)
        self._taken_m[draw_point] = self._taken_m.get(draw_point, 0.0) + depth_m
        self.stand(draw_point, self._pile(place, self._taken_m[draw_point]))

    def stand(self, name: str, mesh: Mesh) -> None:
        """Put something into the mine that stays for long (scenes are made anew)."""
        self._version += 1
        self._things[name] = _thing(mesh, self._version)
        self._scenes.clear()
        self._here = None

    def appear(self, name: str, mesh: Mesh) -> None:
        """Put something into the mine that comes and goes: a person, an obstacle."""
        self._version += 1
        self._passing[name] = (_thing(mesh, self._version), Surface(mesh))

    def dig(self, name: str, mesh: Mesh) -> None:
        """Put the pile `name` as it is now in place of the one that stood there; buckets go into it, so it is no contact."""
        self._version += 1
        if self._things.pop(name, None) is not None:
            self._scenes.clear()
            self._here = None
        self._passing[name] = (_thing(mesh, self._version)._replace(touched=False), Surface(mesh))

    @property
    def things(self) -> Mapping[str, Thing]:
        """What stands in the mine for long, by name."""
        return self._things

    def vanish(self, name: str) -> None:
        """Take away what has appeared."""
        self._passing.pop(name, None)
        self._version += 1

    def meshes(self) -> Iterator[Mesh]:
        """Yield the whole surface, piece by piece, and all things."""
        for index in range(len(self._boxes)):
            yield self.piece(index).mesh
        dug = [thing for _, (thing, _) in sorted(self._passing.items()) if not thing.touched]
        for thing in [*self._things.values(), *dug]:
            yield thing.mesh

    # How it is made.

    def _make_piece(self, index: int) -> Skin:
        skin = self._skins.skin(index)
        pit = None if self._pieces is None else self._pits.get(self._pieces.all[index].tube)
        return skin if pit is None else _opened(skin, *pit)

    def _scene(self, tile_m: FloatArray) -> Surface:
        """Return what can be seen from a tile; of a small mine all, which need not be made anew."""
        half = 0.5 * TILE_M + (0.0 if self._pieces is not None else self.view_m)
        half = half if len(self._boxes) > _WHOLE_PIECES else np.inf
        box = np.stack([tile_m - half, tile_m + half])
        here = np.flatnonzero(_overlap(self._boxes, box)).tolist()
        inside = frozenset(here if self._pieces is None else self._pieces.within(here, self.view_m))
        found = self._scenes.get(inside)
        if found is None:
            while len(self._scenes) >= _SCENES:
                self._scenes.popitem(last=False)  # the old one goes before the new one takes its memory
            parts = [self.piece(index).mesh for index in sorted(inside)]
            around = box + np.array([[-self.view_m], [self.view_m]])
            parts += [thing.mesh for thing in self._things.values() if _overlap(thing.box_m[None], around)[0]]
            found = self._scenes[inside] = Surface(_together(parts))
        self._scenes.move_to_end(inside)
        return found

    def _furnish(self) -> None:
        network = self.network
        for place in () if self._pieces is None else network.plan.places:
            if place.kind == "draw_point":
                self._things[place.name] = _thing(self._pile(place, 0.0))
            elif place.kind == "dump":
                self._things[place.name] = _thing(dump_of(network, place, self.floor))
        for number, thing in enumerate(network.plan.equipment, start=1):
            self._things[f"{thing.kind} {number}"] = _thing(equipment_of(network, thing, self.machine, self.floor))

    def _pile(self, place: PlacePlan, taken_m: float) -> Mesh:
        if self._pieces is None:
            raise ConfigError(f"'{place.name}': a surveyed mine has no piles of its own")
        index, _, _ = place_end(self.network, place)
        return pile_of(self.network, place, self._pieces.drift(index), self.machine, taken_m)

    def _zones_at(self, zones: Sequence[Zone], position_m: FloatArray) -> list[Zone]:
        """Return the zones that a point is in."""
        found = []
        for zone in zones:
            tube = self.network.tubes[self.network.tube(zone.drift)]
            apart, station = self._line(zone.drift).query(position_m)
            s = float(station) * _STATION_M
            if zone.from_m <= s <= zone.to_m and apart < tube.half_width_m(s) + 3.0:
                found.append(zone)
        return found

    def _make_line(self, drift: str) -> KDTree:
        """Return a tree of points each `_STATION_M` on the centre line of a drift."""
        tube = self.network.tubes[self.network.tube(drift)]
        return KDTree(tube.line.at(np.arange(0.0, tube.length_m, _STATION_M))[:, :3])


def _thing(mesh: Mesh, version: int = 0) -> Thing:
    return Thing(mesh, np.stack([mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)]), version)


def _overlap(boxes_m: FloatArray, box_m: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which of boxes (N, 2, 3) overlap a box (2, 3)."""
    overlap: npt.NDArray[np.bool_] = ((boxes_m[:, 0] < box_m[1]) & (boxes_m[:, 1] > box_m[0])).all(axis=1)
    return overlap


def _together(meshes: list[Mesh]) -> Mesh:
    offsets = np.cumsum([0, *(len(mesh.vertices_m) for mesh in meshes[:-1])])
    triangles = [mesh.triangles + np.uint32(offset) for mesh, offset in zip(meshes, offsets.tolist(), strict=True)]
    return Mesh(np.concatenate([mesh.vertices_m for mesh in meshes]), np.concatenate(triangles))


def _pits(network: Network) -> dict[int, tuple[FloatArray, FloatArray]]:
    """Return of each tube with a dump at its end where the pit begins, and the direction into it, both (2,)."""
    found = {}
    for place in network.plan.places:
        if place.kind == "dump":
            index, end_m, direction = place_end(network, place)
            pose = network.tubes[index].pose(end_m - direction * PIT_M, direction)
            found[index] = (pose[:2], np.array([np.cos(pose[3]), np.sin(pose[3])]))
    return found


def _opened(skin: Skin, start_m: FloatArray, direction: FloatArray) -> Skin:
    """Return a surface without the floor of a pit."""
    middle = skin.mesh.vertices_m[skin.mesh.triangles].mean(axis=1)[:, :2] - start_m
    along = middle @ direction
    beside = np.abs(middle @ np.array([-direction[1], direction[0]]))
    keep = ~(skin.floor & (along > 0.0) & (along < PIT_M + 2.0) & (beside < 20.0))
    return Skin(Mesh(skin.mesh.vertices_m, skin.mesh.triangles[keep]), skin.floor[keep])

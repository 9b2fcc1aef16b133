"""Planar mines of separate tunnels, taught by a drive whose odometry drifts, and other drives through them, with truth."""

from __future__ import annotations

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np
from lhdmap.geometry import se2
from lhdmap.landmarks.build import node_surface
from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.scans import NodeScan
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.messages import FloatArray
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.topology.model import UNEXPLORED, TopologicalMap, Tunnel
from tests.landmarks.worlds import MODERATE, ROUGH, SMOOTH, TunnelWorld, seen, tunnel

LENGTH_M, TUNNELS, APART_M = 300.0, 10, 500.0
TEACH_EVERY_M, SCAN_EVERY_M = 0.4, 0.36  # 2 m/s at 5 Hz; 3.6 m/s at 10 Hz
SCALE, WALK_RAD = 0.001, math.radians(0.01)  # of an odometry: 0.1 %, heading by the square root of a metre
_SETTINGS = LandmarkSettings()


class Kind(NamedTuple):
    """Class of tunnels: roughness of walls (m, rms), which of the tunnels have bends and niches."""

    rms_m: float
    bends: tuple[bool, ...]


KINDS = {
    "rough": Kind(ROUGH, (False, True)),
    "moderate": Kind(MODERATE, (False, True)),
    "smooth, bends and niches": Kind(SMOOTH, (True,)),
    "smooth, featureless": Kind(SMOOTH, (False,)),
}


class LiveScan(NamedTuple):
    """A scan of a drive: true pose (3,), pose by an odometry (3,), hits (N, 2) in the machine's frame."""

    true: FloatArray
    odom: FloatArray
    points: FloatArray


class Taught(NamedTuple):
    """A map, and of each tunnel the true and the taught poses (K, 3) of the drive that made it."""

    known: KnownMap
    true: tuple[FloatArray, ...]
    said: tuple[FloatArray, ...]

    def on_map(self, number: int, true: FloatArray) -> FloatArray:
        """Return where a true pose (3,) in a tunnel lies on the map: by the nearest pose of the teaching drive."""
        near = int(np.hypot(*(self.true[number][:, :2] - true[:2]).T).argmin())
        moved: FloatArray = se2.compose(self.said[number][near], se2.between(self.true[number][near], true))
        return moved


def world_of(kind: str, seed: int, number: int) -> TunnelWorld:
    """Return tunnel `number` of a mine."""
    one = KINDS[kind]
    bends = one.bends[number % len(one.bends)]
    return tunnel(1000 * seed + number, one.rms_m, LENGTH_M, bends=bends, niches=bends)


def drifting(true: FloatArray, rng: np.random.Generator, begin: FloatArray) -> FloatArray:
    """Return the poses (K, 3) that an odometry has of true ones, from a pose (3,) on."""
    said, scale = [begin], 1.0 + SCALE * rng.choice([-1.0, 1.0])
    for before, after in itertools.pairwise(true):
        step = se2.between(before, after)
        way = math.hypot(step[0], step[1])
        turn = WALK_RAD * math.sqrt(way) * rng.standard_normal()
        said.append(se2.compose(said[-1], np.array([scale * step[0], scale * step[1], step[2] + turn])))
    return np.array(said)


def poses_through(world: TunnelWorld, every_m: float, rng: np.random.Generator, *, back: bool) -> FloatArray:
    """Return poses (K, 3) of a drive through a tunnel, weaving about an offset; `back`: from its end to its start."""
    at = np.arange(0.0, world.length_m, every_m)
    offset, phase = rng.uniform(-0.5, 0.5), rng.uniform(0.0, 6.0)
    weave = offset + 0.15 * np.sin(at / 7.0 + phase)
    jitter = math.radians(0.3) * np.sin(at / 3.0 + phase)
    places = at[::-1] if back else at
    return np.array([world.pose(*where) for where in zip(places, weave, jitter + math.pi * back, strict=True)])


@functools.lru_cache(maxsize=2)
def taught(kind: str, seed: int) -> Taught:
    """Return the map of a mine."""
    tunnels, surfaces, true, said = [], {}, [], []
    for number in range(TUNNELS):
        world, rng, name = world_of(kind, seed, number), np.random.default_rng([seed, number, 1]), f"T{number}"
        poses = poses_through(world, TEACH_EVERY_M, rng, back=False)
        taken = drifting(poses, rng, poses[0] + np.array([0.0, APART_M * number, 0.0]))
        scans = [
            NodeScan(name, TEACH_EVERY_M * k, where, seen(world, pose, rng))
            for k, (pose, where) in enumerate(zip(poses, taken, strict=True))
        ]
        frame = np.array([*taken[0, :2], 0.0, taken[0, 2]])
        surfaces[name] = node_surface(scans, frame, _SETTINGS, tunnel=True)
        line = np.column_stack([taken[::3, :2], np.zeros(len(taken[::3]))])
        tunnels.append(Tunnel(name, name, (UNEXPLORED, UNEXPLORED), line, np.full((len(line), 2), 2.2), frame))
        true.append(poses)
        said.append(taken)
    none = np.zeros(0)
    landmarks = Landmarks(
        np.zeros((0, 2), np.float32), np.zeros(1, np.int64), np.zeros((0, 3)), np.zeros(0, np.str_), none, none, none,
        np.zeros(0, np.int32), np.zeros(0, np.bool_), {}, surfaces,
    )  # fmt: skip
    return Taught(KnownMap(TopologicalMap(tunnels=tuple(tunnels)), landmarks, []), tuple(true), tuple(said))


def drive_through(kind: str, seed: int, number: int, drive: int) -> list[LiveScan]:
    """Return the scans of a drive through a tunnel; odd drives go from its end to its start. Numbers from 10 on are not mapped."""
    world, rng = world_of(kind, seed, number), np.random.default_rng([seed, number, 2, drive])
    poses = poses_through(world, SCAN_EVERY_M, rng, back=bool(drive % 2))
    odom = drifting(poses, rng, np.zeros(3))
    return [LiveScan(true, said, seen(world, true, rng)) for true, said in zip(poses, odom, strict=True)]

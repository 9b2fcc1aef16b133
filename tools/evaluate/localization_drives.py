"""Planar drives for the tables of localization: a tunnel is taught, driven through again, and the map's own code builds the map.

The machine is articulated, with two level scanners, tachometer and joints; its wheels are 1 % too fast, noisy, and slip in bursts.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from lhdmap.config import settings_from
from lhdmap.evaluation.localization import LocalizationTable, MapTruth, evaluated
from lhdmap.geometry import se2, se3
from lhdmap.kinematics import T_base_rear, articulation_along_path
from lhdmap.localization.rows import columns
from lhdmap.logs.writer import LogWriter
from lhdmap.machine import Machine
from lhdmap.mapfolder import MapFolder
from lhdmap.messages import FloatArray, Joints, LaserScan, Message, Mount, Tachometer
from lhdmap.pipeline.build import BuildRequest, build_map
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.pipeline.localize import Localizer
from lhdmap.roles import ROLES
from lhdmap.simulation.planar import PlanarWorld, world_from_polylines
from lhdmap.trajectory import Trajectory
from scipy.ndimage import gaussian_filter1d
from tests.landmarks.worlds import BEYOND_M, MODERATE, ROUGH, SMOOTH, STEP_M, TunnelWorld, tunnel

CLASSES = {
    "rough, 12 cm": (ROUGH, None),
    "moderate, 3 cm": (MODERATE, None),
    "smooth, 5 mm, bends and niches": (SMOOTH, True),
    "smooth, 5 mm, featureless": (SMOOTH, False),
}
"""Roughness, and whether it has bends and niches; None: every second world."""
WAYS = ("same", "opposite", "reverse")
LENGTH_M = 100.0
MACHINE = Machine()
FRONT_M, REAR_M = 0.8, -3.0
_ANGLES = np.radians(np.arange(-95.0, 95.01, 0.5))
_RANGE_M, _NOISE_M = 50.0, 0.012
_FIRST_NS, _SECOND = 1_700_000_000_000_000_000, 1e9
_FINE_M = 0.05
_SMOOTH_M = 0.8
_LATERAL_M = 0.15
_SETTLES_M = 5.0
SETTINGS = {"pile.method": "off", "recording.scan_interval_s": 10.0}


class Path3(NamedTuple):
    """A way of the front axle at each `_FINE_M`: poses (N, 3), angles of the joint (N,)."""

    poses: FloatArray
    joint_rad: FloatArray

    def at(self, way_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return poses (M, 3) and joint angles (M,) at places along it."""
        grid = _FINE_M * np.arange(len(self.joint_rad))
        poses = np.column_stack([np.interp(way_m, grid, column) for column in self.poses.T])
        return poses, np.interp(way_m, grid, self.joint_rad)


class Drive(NamedTuple):
    """Messages by role in order, and the truth at the front scans."""

    messages: list[tuple[str, Message]]
    truth: Trajectory


def world_of(name: str, seed: int) -> TunnelWorld:
    """Return the tunnel of a class."""
    rms_m, bent = CLASSES[name]
    features = bool(seed % 2) if bent is None else bent
    return tunnel(seed, rms_m, LENGTH_M, bends=features, niches=features)


def planar_world(world: TunnelWorld) -> PlanarWorld:
    """Return the tunnel's walls as a world that rays are cast in."""
    walls = np.split(world.segments_m, 2)
    lines = [np.vstack([wall[:, :2], wall[-1:, 2:]]) for wall in walls]
    return world_from_polylines(lines, world.line)


def path_of(world: TunnelWorld, rng: np.random.Generator, way: str, *, offset_m: float, weave_m: float) -> Path3:
    """Return a way from one end of a tunnel to the other; `opposite` begins at its end, `reverse` is told by the drive."""
    s = np.arange(0.0, world.length_m, _FINE_M)
    lateral = offset_m + weave_m * np.sin(s / 7.0 + rng.uniform(0.0, 6.0))
    row = (s + BEYOND_M) / STEP_M
    x, y, h = (np.interp(row, np.arange(len(world.line)), column) for column in world.line.T)
    xy = np.column_stack([x - lateral * np.sin(h), y + lateral * np.cos(h)])
    xy = gaussian_filter1d(xy, _SMOOTH_M / _FINE_M, axis=0, mode="nearest")[40:-40]
    if way == "opposite":
        xy = xy[::-1]
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(xy, axis=0), axis=1))])
    even = np.arange(0.0, length[-1], _FINE_M)
    xy = np.column_stack([np.interp(even, length, column) for column in xy.T])
    heading = np.unwrap(np.arctan2(*np.gradient(xy, axis=0).T[::-1]))
    curvature = gaussian_filter1d(np.gradient(heading) / _FINE_M, 5.0)
    size = MACHINE.dimensions
    joint = articulation_along_path(curvature, _FINE_M, size.joint_to_front_axle_m, size.joint_to_rear_axle_m)
    return Path3(np.column_stack([xy, heading]), joint)


def drive(
    planar: PlanarWorld,
    path: Path3,
    seed: int,
    *,
    speed_mps: float,
    rate_hz: float = 10.0,
    reverse: bool = False,
    slip: bool = True,
) -> Drive:
    """Return a drive along a path, from rest; `reverse`: from its end in reverse gear."""
    rng = np.random.default_rng([seed, 5])
    length = _FINE_M * (len(path.joint_rad) - 1)
    times = np.arange(0.0, length / speed_mps + 6.0, 0.02)
    travelled = _travelled(times, speed_mps)
    times, travelled = times[travelled < length], travelled[travelled < length]
    way = length - travelled if reverse else travelled
    poses, joints = path.at(way)
    speed = np.gradient(travelled, 0.02) * (-1.0 if reverse else 1.0)
    told = speed * _wheels(times, rng, slip=slip) + 0.03 * rng.standard_normal(len(times))
    joints_told = joints + math.radians(0.05) * rng.standard_normal(len(times))
    messages: list[tuple[str, Message]] = _mounts()
    every = round(50.0 / rate_hz)
    stamps = _FIRST_NS + np.round(times * _SECOND).astype(np.int64)
    for k, stamp in enumerate(stamps.tolist()):
        messages += [("tachometer", Tachometer(stamp, float(told[k])))]
        messages += [("joints", Joints(stamp, {"articulation": float(joints_told[k])}, {}))]
        if k % every == 0:
            messages += _scans(planar, poses[k], float(joints[k]), stamp, rng)
    rows = np.arange(0, len(stamps), every)
    level = np.zeros(len(rows))
    positions = np.column_stack([poses[rows, :2], level])
    quaternions = se3.quaternions_from_rpy(level, level, poses[rows, 2])
    return Drive(messages, Trajectory(stamps[rows], positions, quaternions))


def _travelled(times: FloatArray, speed_mps: float) -> FloatArray:
    """Return the way driven: at rest for a second, then up to speed at 0.6 m/s²."""
    ramp_s = speed_mps / 0.6
    since = np.maximum(times - 1.0, 0.0)
    way: FloatArray = 0.3 * np.minimum(since, ramp_s) ** 2 + speed_mps * np.maximum(since - ramp_s, 0.0)
    return way


def _wheels(times: FloatArray, rng: np.random.Generator, *, slip: bool) -> FloatArray:
    """Return the speed of the wheels over that of the ground: 1 % more, in bursts by 30 to 100 % for 0.5 to 2 s each 8 to 25 s."""
    factor, at = np.full(len(times), 1.01), rng.uniform(8.0, 25.0)
    while slip and at < times[-1]:
        until = at + rng.uniform(0.5, 2.0)
        factor[(times >= at) & (times < until)] *= 1.0 + rng.uniform(0.3, 1.0)
        at = until + rng.uniform(8.0, 25.0)
    return factor


def _mounts() -> list[tuple[str, Message]]:
    front = se3.from_rpy(0.0, 0.0, 0.0, (FRONT_M, 0.0, 1.8))
    rear = se3.from_rpy(0.0, 0.0, math.pi, (REAR_M, 0.0, 1.8))
    return [
        ("tf_static", Mount(_FIRST_NS, "base_link", "lidar_front", front)),
        ("tf_static", Mount(_FIRST_NS, "rear_link", "lidar_rear", rear)),
    ]


def _scans(
    planar: PlanarWorld, pose: FloatArray, joint_rad: float, stamp: int, rng: np.random.Generator
) -> list[tuple[str, Message]]:
    rear = T_base_rear(joint_rad, MACHINE)
    T_base_rear_axle = np.array([rear[0, 3], rear[1, 3], -joint_rad])
    places = {
        "front": se2.compose(pose, np.array([FRONT_M, 0.0, 0.0])),
        "rear": se2.compose(se2.compose(pose, T_base_rear_axle), np.array([REAR_M, 0.0, math.pi])),
    }
    found: list[tuple[str, Message]] = []
    for role, at in places.items():
        ranges = planar.ranges(at, _ANGLES, _RANGE_M)
        noisy = (ranges + _NOISE_M * rng.standard_normal(len(ranges))).astype(np.float32)
        first, step = float(_ANGLES[0]), float(_ANGLES[1] - _ANGLES[0])
        found.append((role, LaserScan(stamp, f"lidar_{role}", first, step, 0.0, 0.1, _RANGE_M, noisy)))
    return found


class Taught(NamedTuple):
    """A world, its map as `build-map` made it, and the truth of the teaching drive."""

    world: TunnelWorld
    planar: PlanarWorld
    known: KnownMap
    truth: MapTruth


def taught(name: str, seed: int, folder: Path) -> Taught:
    """Drive through a tunnel at 2 m/s, without slip, and build its map from the log; maps that are there are read."""
    world = world_of(name, seed)
    planar, rng = planar_world(world), np.random.default_rng([seed, 1])
    path = path_of(world, rng, "same", offset_m=0.0, weave_m=0.05)
    first = drive(planar, path, 1000 + seed, speed_mps=2.0, slip=False)
    made = folder / f"map_{list(CLASSES).index(name)}_{seed}"
    if not made.exists():
        log = made.with_suffix(".mcap")
        with LogWriter(log) as writer:
            for role, message in first.messages:
                writer.write(ROLES[role].topic, [message] if isinstance(message, Mount) else message)
        build_map(BuildRequest([log], made, settings_from(dict(SETTINGS))))
        log.unlink()
    return Taught(world, planar, KnownMap.read(made), MapTruth(first.truth, MapFolder.open(made).trajectory()))


class Run(NamedTuple):
    """Figures of `eval localization`, the table they are of, and the truth on the map (N, 4)."""

    figures: dict[str, Any]
    table: LocalizationTable


def second(place: Taught, seed: int, way: str) -> Drive:
    """Return another drive through a tunnel: 3.6 m/s, beside the middle, weaving."""
    rng = np.random.default_rng([seed, WAYS.index(way), 2])
    offset = rng.uniform(0.1, 0.5) * rng.choice([-1.0, 1.0])
    path = path_of(place.world, rng, way, offset_m=offset, weave_m=_LATERAL_M)
    return drive(place.planar, path, 10 * seed + WAYS.index(way), speed_mps=3.6, reverse=way == "reverse")


def localized(place: Taught, done: Drive, method: str, changes: dict[str, Any] | None = None) -> Run:
    """Localize a drive of which the start is about known."""
    first = done.truth
    yaw = 2.0 * math.atan2(first.quaternions_xyzw[0, 2], first.quaternions_xyzw[0, 3])
    start = place.truth.placed(np.array([[*first.positions_m[0], yaw]]))[0]
    settings = settings_from({**SETTINGS, "localization.method": method, **(changes or {})})
    with Localizer(
        place.known, settings, MACHINE, start[[0, 1, 3, 2]] + np.array([0.1, 0.05, 0.005, 0.0])
    ) as localizer:
        for role, message in done.messages:
            localizer.update(role, message)
        localizer.finish()
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(first.positions_m, axis=0), axis=1))])
    settled = set(first.stamps_ns[way > _SETTLES_M].tolist())
    kept = [row for row in localizer.rows if row.stamp_ns in settled]
    table = LocalizationTable.of({name: np.asarray(values) for name, values in columns(kept).items()})
    return Run(evaluated(table, first, place.truth), table)

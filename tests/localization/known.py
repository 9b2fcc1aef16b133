"""A drift with rough walls as a map that is known exactly, and drives in it as messages: one level scanner, wheels."""

from __future__ import annotations

import functools
import math
from itertools import pairwise

import numpy as np
from lhdmap.geometry import se2
from lhdmap.landmarks.build import landmarks_of
from lhdmap.landmarks.scans import NodeScan
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.messages import FloatArray, LaserScan, Message, Mount
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.simulation.planar import (
    PlanarScanner,
    PlanarWorld,
    drift_world,
    poses_along,
    simulate_scans,
    way_from_rest,
    world_from_polylines,
)
from lhdmap.topology.model import DEAD_END, TopologicalMap, Tunnel, Waypoint
from lhdmap.topology.sheet import FREE, OCCUPIED, Sheet

from tests.settings.streams import RATE_HZ, Stream, wheels_of

PIECES = ((22.0, 0.0), (4.0, math.pi / 6), (24.0, 0.0))
LENGTH_M = 50.0
SPEED_MPS = 3.0
HALF_WIDTH_M = 2.0
_CELL_M = 0.1
_SCANNER = PlanarScanner()


@functools.cache
def world() -> PlanarWorld:
    """Return a closed drift of 50 m with a bend in its middle."""
    return drift_world(11, rms_m=0.12, pieces=PIECES, cross_drift_at_m=None)


def poses_at(way_m: FloatArray) -> FloatArray:
    """Return the poses (N, 3) of `base_link` at places (N,) along the drift, facing its end."""
    return poses_along(world().centre_line_m, way_m)


def hits_of(scan: LaserScan) -> FloatArray:
    """Return the hits (N, 2) of a scan in the machine's frame, which is the scanner's."""
    ranges = np.asarray(scan.ranges_m, dtype=float)
    angles, hit = _SCANNER.angles_rad, np.isfinite(ranges)
    return np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles)])[hit]


def hits_at(poses: FloatArray, seed: int) -> list[FloatArray]:
    """Return the hits (N, 2) that the scanner has at each of some poses, in the machine's frame."""
    return [hits_of(scan) for scan in simulate_scans(world(), poses, _SCANNER, RATE_HZ, seed)]


@functools.cache
def known_map() -> KnownMap:
    """Return the map of a drive from 2 m to 48 m, placed by its true poses: a tunnel `t` with waypoints at 10 m and 40 m."""
    line = world().centre_line_m[::50]
    centre = np.column_stack([line[:, :2], np.zeros(len(line))])
    frame = np.array([*centre[0], math.atan2(*(centre[1] - centre[0])[1::-1])])
    tunnel = Tunnel("t", "T1", (DEAD_END, DEAD_END), centre, np.full((len(centre), 2), HALF_WIDTH_M), frame)
    stops = [Waypoint(f"w{at}", f"W{at}", "t", _stop(at), "stop") for at in (10, 40)]
    places = np.arange(2.0, 48.0, 0.5)
    poses = poses_at(places)
    scans = [
        NodeScan("t", float(at), pose, points)
        for at, pose, points in zip(places, poses, hits_at(poses, 1), strict=True)
    ]
    landmarks = landmarks_of(scans, {"t": frame}, {"t"}, LandmarkSettings())
    return KnownMap(TopologicalMap(tunnels=(tunnel,), waypoints=tuple(stops)), landmarks, [_sheet()])


def _stop(at_m: float) -> FloatArray:
    x, y, heading = poses_at(np.array([at_m]))[0].tolist()
    return np.array([x, y, 0.0, heading])


def _sheet() -> Sheet:
    """Return the drift's free space: walls as they are, free within 1.7 m of its middle."""
    walls, line = world().segments_m[:, :2], world().centre_line_m
    low = walls.min(axis=0) - 5.0
    columns, rows = np.ceil((walls.max(axis=0) + 5.0 - low) / _CELL_M).astype(int)
    sheet = Sheet(np.zeros((rows, columns), np.uint8), low, _CELL_M)
    for lateral in np.arange(-1.7, 1.71, 0.05):
        beside = line[:, :2] + lateral * np.column_stack([-np.sin(line[:, 2]), np.cos(line[:, 2])])
        sheet.cells[tuple(sheet.at(beside).T)] = FREE
    sheet.cells[tuple(sheet.at(walls).T)] = OCCUPIED
    return sheet


def changed_world(nearer: tuple[float, float, float] | None, parked: tuple[float, float] | None) -> PlanarWorld:
    """Return the drift with both walls nearer between two places by so much, and with a box parked on its left between two."""
    built = world()
    segments, line = built.segments_m.copy(), built.centre_line_m
    if nearer is not None:
        middles = 0.5 * (segments[:, :2] + segments[:, 2:])
        rows = np.linalg.norm(middles[:, None] - line[None, ::10, :2], axis=2).argmin(axis=1) * 10
        inside = (line_m()[rows] > nearer[0]) & (line_m()[rows] < nearer[1])
        inward = line[rows, :2] - middles
        inward *= nearer[2] / np.linalg.norm(inward, axis=1, keepdims=True)
        segments[inside] += np.tile(inward[inside], 2)
    if parked is not None:
        corners = [poses_at(np.array([at]))[0] for at in parked]
        near, far = [[se2.compose(pose, np.array([0.0, y, 0.0]))[:2] for pose in corners] for y in (0.9, 1.7)]
        ring = [near[0], near[1], far[1], far[0], near[0]]
        segments = np.vstack([segments, [[*a, *b] for a, b in pairwise(ring)]])
    return world_from_polylines(list(segments.reshape(-1, 2, 2)), line)


@functools.cache
def line_m() -> FloatArray:
    """Return the way (N,) at each point of the centre line."""
    steps = np.linalg.norm(np.diff(world().centre_line_m[:, :2], axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


@functools.cache
def drive(
    from_m: float,
    way_m: float,
    seed: int = 3,
    *,
    jump_m: float = 0.0,
    nearer: tuple[float, float, float] | None = None,
    parked: tuple[float, float] | None = None,
) -> tuple[Stream, FloatArray]:
    """Return messages of a drive from rest, and the true poses (N, 3) of its scans; half-way it is put ahead by `jump_m`.

    The wheels are 1 % too fast and do not know of the jump. `nearer`, `parked`: as for `changed_world`.
    """
    way = from_m + way_from_rest(SPEED_MPS, RATE_HZ, way_m, 1.5)
    told = poses_at(way)
    poses = poses_at(way + jump_m * (way > from_m + 0.5 * way_m))
    scans = simulate_scans(changed_world(nearer, parked), poses, _SCANNER, RATE_HZ, seed)
    messages: list[tuple[str, Message]] = [("front", scan) for scan in scans]
    messages += wheels_of("articulated", told, [scan.stamp_ns for scan in scans])
    messages.sort(key=lambda one: one[1].stamp_ns)
    return (("tf_static", Mount(0, "base_link", "laser", np.eye(4))), *messages), poses

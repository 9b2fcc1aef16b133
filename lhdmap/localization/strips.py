"""The map as strips of wall profile: left and right wall and turn of the mid line, each 0.1 m, along all ways through the graph.

A tunnel is one strip. Through an intersection there is a strip for each pair of arms, which begins and ends some metres inside
the tunnels, where the mid line no longer bends. Each strip is there in both directions. A strip knows which ones lead into it, so
that a profile runs on across every hand-over (`lhdmap.localization.placing`). Where nothing leads in, the way comes from outside.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter

from lhdmap.geometry import se2
from lhdmap.landmarks.distinct import channels
from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.profile import WallProfile, profile_of
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.localization.strip_ways import (
    BEYOND_M,
    LEAST_M,
    access_points,
    arm_of,
    curve_through,
    extended,
    inside_m,
    point_on,
    tail_of,
)
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.topology.driven import arc_m
from lhdmap.topology.model import TopologicalMap

_OPEN_M = 6.0  # beyond an end of the map: unknown walls, so that a window that reaches out of it is not lost
_NEAR_M = 40.0
_ANOTHER_DRIVE, _LEAST_NOISE, _MOST_NOISE = 2.0, 0.1, 4.0
_MAD = 1.4826

Port = tuple[str, int, bool]
"""Tunnel, its end (0 or 1), whether the way leads out of the tunnel there."""


class Strip(NamedTuple):
    """One way along walls: `values`, `variances` (3, n) of `channels`, mid line `poses` (n, 3) and `heights_m` in `map`.

    `evidence` (3, n): what a bin tells where it fits, nats. `enters`, `leaves`: ports, None at an end of the map.
    """

    node: str
    values: FloatArray
    variances: FloatArray
    evidence: FloatArray
    poses: FloatArray
    heights_m: FloatArray
    enters: Port | None
    leaves: Port | None


class Strips(NamedTuple):
    """All strips one after the other, B bins: float32 (3, B) but for what says otherwise.

    `known`: 0 or 1; `values`, `evidence` are 0 where not. `poses` (B, 3), `heights_m` (B,); `starts` (S + 1,): first bins; those
    that lead into strip s: `before[before_starts[s] : before_starts[s + 1]]`, none where it begins at an end of the map.
    `nodes` (S,): ids. `noise`: factor of the variance that is not due to the walls' slope (`channels`), for live profiles, too.
    """

    values: Float32Array
    variances: Float32Array
    known: Float32Array
    evidence: Float32Array
    poses: FloatArray
    heights_m: FloatArray
    starts: npt.NDArray[np.int64]
    before: npt.NDArray[np.int64]
    before_starts: npt.NDArray[np.int64]
    nodes: tuple[str, ...]
    noise: float

    def node_at(self, place: int) -> str:
        """Return the node of a bin."""
        return self.nodes[int(np.searchsorted(self.starts, place, side="right")) - 1]


def strips_of(topology: TopologicalMap, landmarks: Landmarks, settings: LandmarkSettings) -> Strips:
    """Return the strips of a map's walls; none where no tunnel has any."""
    walls = _Walls(topology, landmarks)
    one_way = [*_tunnels(topology, walls, settings), *_crossings(topology, walls, settings)]
    return _joined([*one_way, *map(_turned, one_way)], walls.noise)


class _Walls:
    """Fused walls of nodes in `map`.

    `noise`: what halves of nodes' own scans tell of the variances of their profiles.
    """

    def __init__(self, topology: TopologicalMap, landmarks: Landmarks) -> None:
        self._cells = {
            node: (
                se2.transform(topology.nodes[node].pose_map_node[[0, 1, 3]], surface.cells.points_m.astype(float)),
                surface.cells.counts.astype(float),
            )
            for node, surface in landmarks.surfaces.items()
            if node in topology.nodes
        }
        chi2 = [surface.quality.chi2 for surface in landmarks.surfaces.values() if surface.quality.chi2 > 0.0]
        told = _ANOTHER_DRIVE * float(np.percentile(chi2, 75.0)) if chi2 else 1.0
        self.noise = min(max(told, _LEAST_NOISE), _MOST_NOISE)

    def __contains__(self, node: str) -> bool:
        return node in self._cells

    def near(self, nodes: Sequence[str], way: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return cells (M, 2) of some nodes and their counts (M,), of those about a way (K, 2)."""
        low, high = way.min(axis=0) - 7.0, way.max(axis=0) + 7.0
        parts, counts = [np.zeros((0, 2))], [np.zeros(0)]
        for node in nodes:
            if node in self._cells:
                points, count = self._cells[node]
                near = ((points > low) & (points < high)).all(axis=1)
                parts.append(points[near])
                counts.append(count[near])
        return np.concatenate(parts), np.concatenate(counts)


def _tunnels(topology: TopologicalMap, walls: _Walls, settings: LandmarkSettings) -> Iterator[Strip]:
    for tunnel in topology.tunnels:
        if tunnel.id not in walls or len(tunnel.line_m) < 2 or tunnel.length_m < LEAST_M:
            continue
        line, at = tunnel.line_m, arc_m(tunnel.line_m)
        joined = [end in topology.nodes for end in tunnel.ends]
        inside = inside_m(tunnel)
        way, along = extended(line[:, :2], at, BEYOND_M)
        profile = profile_of(*walls.near([tunnel.id, *tunnel.ends], way), way, along, settings)
        first, last = (inside if joined[0] else 0.0), at[-1] - (inside if joined[1] else 0.0)
        rows = _between(profile, point_on(line, at, first), point_on(line, at, last))
        enters = (tunnel.id, 0, False) if joined[0] else None
        leaves = (tunnel.id, 1, True) if joined[1] else None
        strip = _strip(tunnel.id, profile, rows, settings, walls.noise)
        heights = np.interp(profile.at_m[rows], at, line[:, 2])
        yield _opened(strip._replace(heights_m=heights, enters=enters, leaves=leaves), settings)


def _crossings(topology: TopologicalMap, walls: _Walls, settings: LandmarkSettings) -> Iterator[Strip]:
    """Yield the strips through intersections, one for each pair of arms."""
    for node in topology.intersections:
        arms = [arm for arm in (arm_of(topology, point) for point in access_points(topology, node)) if arm is not None]
        nodes = [node.id, *(tunnel.id for _, tunnel, _ in arms)]
        for (p, a, end_a), (q, b, end_b) in combinations(arms, 2):
            if a.id not in walls or b.id not in walls:
                continue
            tail, cut_a = tail_of(a, end_a)
            head, cut_b = tail_of(b, end_b)
            way = np.concatenate([tail[::-1], curve_through(p.pose, q.pose), head])
            profile = profile_of(*walls.near(nodes, way), way, arc_m(way), settings)
            rows = _between(profile, cut_a, cut_b)
            strip = _strip(node.id, profile, rows, settings, walls.noise)
            heights = np.full(len(strip.poses), node.pose_map_node[2])
            yield strip._replace(heights_m=heights, enters=(a.id, end_a, True), leaves=(b.id, end_b, False))


def _between(profile: WallProfile, first: FloatArray, last: FloatArray) -> slice:
    """Return the bins from the one nearest to a point (2,) up to the one before another."""
    if not len(profile.at_m):
        return slice(0, 0)
    near = [int(np.hypot(*(profile.line_m.astype(float) - point).T).argmin()) for point in (first, last)]
    return slice(near[0], max(near[1], near[0]))


def _strip(node: str, profile: WallProfile, rows: slice, settings: LandmarkSettings, noise: float) -> Strip:
    values, variances = channels(profile, settings.profile_m, noise)
    evidence = _evidence(values, variances, settings)
    poses = np.column_stack([profile.line_m.astype(float), profile.heading_rad.astype(float)])[rows]
    columns = values[rows].T, variances[rows].T, evidence[rows].T
    return Strip(node, *columns, poses, np.zeros(len(poses)), None, None)


def _evidence(values: FloatArray, variances: FloatArray, settings: LandmarkSettings) -> FloatArray:
    """Return (n, 3) what a fit tells: 1, which the right place itself costs, and the log of the variances' ratio.

    That is, of two walls of this kind over that of one wall seen twice.
    """
    size = max(round(2.0 * settings.smooth_m / settings.profile_m), 1)
    out = np.full(values.shape, np.nan)
    for channel in range(3):
        known = np.isfinite(values[:, channel])
        if known.any():
            wall = np.interp(np.arange(len(known)), np.flatnonzero(known), values[known, channel])
            off = wall - median_filter(wall, size=size, mode="nearest")
            spread = (_MAD * float(np.median(np.abs(off)))) ** 2
            out[:, channel] = 1.0 + np.log1p(spread / variances[:, channel])
    return out


def _opened(strip: Strip, settings: LandmarkSettings) -> Strip:
    """Return a strip that goes on, with unknown walls, beyond each of its ends where the map ends."""
    if not len(strip.poses):
        return strip
    n = round(_OPEN_M / settings.profile_m)
    before, after = (n * (port is None) for port in (strip.enters, strip.leaves))
    way = settings.profile_m * np.arange(1, n + 1)[:, None]
    ahead = [np.column_stack([np.cos(pose[2]), np.sin(pose[2]), 0.0]) * way for pose in strip.poses[[0, -1]]]
    poses = [(strip.poses[0] - ahead[0])[::-1][n - before :], strip.poses, (strip.poses[-1] + ahead[1])[:after]]
    beside = ((0, 0), (before, after))
    return strip._replace(
        values=np.pad(strip.values, beside, constant_values=np.nan),
        variances=np.pad(strip.variances, beside, constant_values=np.nan),
        evidence=np.pad(strip.evidence, beside, constant_values=np.nan),
        poses=np.concatenate(poses),
        heights_m=np.pad(strip.heights_m, (before, after), mode="edge"),
    )


def _turned(strip: Strip) -> Strip:
    """Return a strip the other way round: left is right, and a turn is against its sign."""
    values, variances, evidence = (one[[1, 0, 2], ::-1] for one in (strip.values, strip.variances, strip.evidence))
    values = values * np.array([[1.0], [1.0], [-1.0]])
    poses = strip.poses[::-1] + np.array([0.0, 0.0, math.pi])
    return Strip(
        strip.node, values, variances, evidence, poses, strip.heights_m[::-1], _back(strip.leaves), _back(strip.enters)
    )


def _back(port: Port | None) -> Port | None:
    return None if port is None else (port[0], port[1], not port[2])


def _joined(strips: list[Strip], noise: float) -> Strips:
    strips = [strip for strip in strips if len(strip.poses)]
    leaving: dict[Port, list[int]] = {}
    for number, strip in enumerate(strips):
        if strip.leaves is not None:
            leaving.setdefault(strip.leaves, []).append(number)
    before = [leaving.get(strip.enters, []) if strip.enters is not None else [] for strip in strips]
    values = np.concatenate([np.zeros((3, 0)), *(strip.values for strip in strips)], axis=1)
    variances = np.concatenate([np.zeros((3, 0)), *(strip.variances for strip in strips)], axis=1)
    evidence = np.concatenate([np.zeros((3, 0)), *(strip.evidence for strip in strips)], axis=1)
    known = np.isfinite(values) & np.isfinite(variances)
    return Strips(
        np.where(known, values, 0.0).astype(np.float32),
        np.where(known, variances, 1.0).astype(np.float32),
        known.astype(np.float32),
        np.where(known, evidence, 0.0).astype(np.float32),
        np.concatenate([np.zeros((0, 3)), *(strip.poses for strip in strips)]),
        np.concatenate([np.zeros(0), *(strip.heights_m for strip in strips)]),
        np.cumsum([0, *(len(strip.poses) for strip in strips)]),
        np.array([one for leads in before for one in leads], dtype=np.int64),
        np.cumsum([0, *map(len, before)]),
        tuple(strip.node for strip in strips),
        noise,
    )

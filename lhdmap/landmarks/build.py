"""From the scans of all nodes to the landmarks of a map: the whole of it on one screen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet

import numpy as np

from lhdmap.errors import InputError
from lhdmap.landmarks.distinct import gaps, reduced_chi2
from lhdmap.landmarks.keys import Keys, choose_keys
from lhdmap.landmarks.model import Landmarks, NodeSurface
from lhdmap.landmarks.profile import WallProfile, profile_of
from lhdmap.landmarks.quality import quality_of
from lhdmap.landmarks.scans import NodeCloud, NodeScan, along_tunnel, checked, in_node, of_intersection, ordered
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.landmarks.similarity import similarity
from lhdmap.landmarks.surface import Cells, fused, placed
from lhdmap.messages import Float32Array, FloatArray

Progress = Callable[[str, float], None]
"""Is told the node that is worked on, and the share (0 to 1) of all nodes that is done."""


def landmarks_of(
    scans: Sequence[NodeScan],
    frames: Mapping[str, FloatArray],
    tunnels: AbstractSet[str],
    settings: LandmarkSettings,
    progress: Progress | None = None,
) -> Landmarks:
    """Return the landmarks of a map (paper, Section 3.2), and the walls of its nodes.

    Args:
        scans: of all nodes, one each half to whole metre of the drive, at their final poses; several visits are fine.
        frames: of each node pose_map_node (4,): x, y, z, yaw.
        tunnels: which of them are tunnels; the others are intersections.
        settings: `LandmarkSettings`.
        progress: is told how far it is.

    Raises:
        InputError: a scan is in a node without a frame, or its pose or points are not usable.
    """
    by_node = _by_node(scans, frames)
    parts: list[tuple[str, list[NodeCloud], Keys]] = []
    matrices: dict[str, Float32Array] = {}
    surfaces: dict[str, NodeSurface] = {}
    for number, (node, own) in enumerate(by_node.items()):
        told = _share(progress, node, number, len(by_node))
        told(0.0)
        pose_map_node = np.asarray(frames[node], dtype=np.float64)
        surfaces[node] = node_surface(own, pose_map_node, settings, tunnel=node in tunnels)
        if node in tunnels:
            clouds = along_tunnel(own, pose_map_node, settings)
            matrices[node] = similarity(clouds, settings, done=told)
            parts.append((node, clouds, choose_keys(matrices[node], settings)))
        else:
            clouds = [cloud for cloud in (of_intersection(own, pose_map_node, settings),) if len(cloud.points_m)]
            parts.append((node, clouds, _whole(len(clouds))))
    return _joined(parts, matrices, surfaces)


def _share(progress: Progress | None, node: str, number: int, count: int) -> Callable[[float], None]:
    """Return what takes the share of one node that is done, and tells the share of all."""

    def told(share: float) -> None:
        if progress is not None:
            progress(node, (number + share) / count)

    return told


def node_surface(
    scans: Sequence[NodeScan], pose_map_node: FloatArray, settings: LandmarkSettings, *, tunnel: bool
) -> NodeSurface:
    """Return the fused walls of a node from its scans, in order along it; a tunnel's with the profile."""
    cells = fused(
        [placed(scan, pose_map_node, settings) for scan in scans], settings.cell_m, [scan.height_m for scan in scans]
    )
    quality = quality_of(cells, scans, pose_map_node, settings)
    if not tunnel:
        return NodeSurface(cells, quality, None)
    profile = _profile(cells, scans, pose_map_node, settings)
    parts = [scans[k::2] for k in (0, 1)]
    halves = [fused([placed(scan, pose_map_node, settings) for scan in part], settings.cell_m) for part in parts]
    one, other = (_profile(half, part, pose_map_node, settings) for half, part in zip(halves, parts, strict=True))
    quality = quality._replace(chi2=reduced_chi2(one, other, settings))
    return NodeSurface(cells, quality, profile._replace(gap=gaps(profile, settings)))


def _profile(
    cells: Cells, scans: Sequence[NodeScan], pose_map_node: FloatArray, settings: LandmarkSettings
) -> WallProfile:
    at_m, way = _way(scans, pose_map_node)
    points, counts = cells.points_m.astype(np.float64), cells.counts.astype(np.float64)
    return profile_of(points, counts, way, at_m, settings)


def _by_node(scans: Sequence[NodeScan], frames: Mapping[str, FloatArray]) -> dict[str, list[NodeScan]]:
    """Return the scans of each node, checked and in order; nodes in the order of their frames."""
    found: dict[str, list[NodeScan]] = {}
    for scan in scans:
        if scan.node not in frames:
            raise InputError(
                f"landmarks: a scan is in '{scan.node}', which has no frame: {', '.join(frames) or 'none'}"
            )
        if np.shape(frames[scan.node]) != (4,) or not np.isfinite(frames[scan.node]).all():
            raise InputError(f"landmarks: the frame of '{scan.node}' is {frames[scan.node]}; x, y, z, yaw were wanted")
        found.setdefault(scan.node, []).append(checked(scan))
    return {node: ordered(found[node]) for node in frames if node in found}


def _way(scans: Sequence[NodeScan], pose_map_node: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places (K,) and positions (K, 2) along a tunnel, each metre the mean of all visits."""
    at_m = np.array([scan.at_m for scan in scans])
    positions = np.array([in_node(scan, pose_map_node)[:2] for scan in scans])
    metres, which = np.unique(np.round(at_m).astype(np.int64), return_inverse=True)
    counts = np.bincount(which)
    means = [np.bincount(which, values) / counts for values in (at_m, *positions.T)]
    return (means[0], np.column_stack(means[1:])) if len(metres) else (np.zeros(0), np.zeros((0, 2)))


def _whole(count: int) -> Keys:
    """Return the flags of an intersection's landmark: it is the key, and nothing tells a threshold."""
    nothing = np.full(count, np.nan)
    return Keys(nothing, nothing, np.zeros(count, dtype=np.int32), np.ones(count, dtype=np.bool_))


def _joined(
    parts: Sequence[tuple[str, list[NodeCloud], Keys]],
    matrices: Mapping[str, Float32Array],
    surfaces: Mapping[str, NodeSurface],
) -> Landmarks:
    clouds = [cloud for _, own, _ in parts for cloud in own]
    points, keys = [cloud.points_m for cloud in clouds], [one for _, _, one in parts]
    return Landmarks(
        np.concatenate([np.zeros((0, 2)), *points]).astype(np.float32),
        np.concatenate([[0], np.cumsum([len(one) for one in points])]).astype(np.int64),
        np.array([cloud.pose_node_base for cloud in clouds]).reshape(-1, 3),
        np.array([node for node, own, _ in parts for _ in own], dtype=np.str_),
        np.array([cloud.at_m for cloud in clouds], dtype=np.float64),
        np.concatenate([np.zeros(0), *(one.threshold for one in keys)]),
        np.concatenate([np.zeros(0), *(one.delta for one in keys)]),
        np.concatenate([np.zeros(0, np.int32), *(one.radius for one in keys)]),
        np.concatenate([np.zeros(0, np.bool_), *(one.key for one in keys)]),
        matrices,
        surfaces,
    )

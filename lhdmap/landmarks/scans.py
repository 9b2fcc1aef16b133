"""What landmarks are made of: the scans of a node; and the clouds of landmarks, thinned to one density."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lhdmap.errors import InputError
from lhdmap.geometry import se2
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.messages import FloatArray


class NodeScan(NamedTuple):
    """One stored cloud: the hits of both scanners, joined in the machine's level base frame.

    `node`: id of the tunnel or intersection. `at_m`: distance along the node's line (tunnels), or along the drive within it
    (intersections). `pose_map_base` (3,): x, y, yaw. `points_m` (N, 2): hits, without the machine's own. `height_m`: of the floor
    in `map`; a tunnel may wind above itself.
    """

    node: str
    at_m: float
    pose_map_base: FloatArray
    points_m: FloatArray
    height_m: float = 0.0


class NodeCloud(NamedTuple):
    """A landmark's cloud `points_m` (N, 2): in the machine's frame at `pose_node_base` (3,), `at_m` along its node."""

    at_m: float
    pose_node_base: FloatArray
    points_m: FloatArray


def checked(scan: NodeScan) -> NodeScan:
    """Return a scan with float64 arrays and without hits that are no numbers.

    Raises:
        InputError: place, pose or shape of the points are not usable.
    """
    pose = np.asarray(scan.pose_map_base, dtype=np.float64)
    points = np.asarray(scan.points_m, dtype=np.float64)
    if pose.shape != (3,) or points.ndim != 2 or points.shape[1] != 2:
        raise InputError(f"scan in {scan.node}: pose {pose.shape}, points {points.shape}; (3,) and (N, 2) were wanted")
    if not (math.isfinite(scan.at_m) and math.isfinite(scan.height_m) and np.isfinite(pose).all()):
        raise InputError(f"scan in {scan.node}: its place {scan.at_m} m or pose {pose.tolist()} is not a number")
    return NodeScan(scan.node, float(scan.at_m), pose, points[np.isfinite(points).all(axis=1)], float(scan.height_m))


def ordered(scans: Sequence[NodeScan]) -> list[NodeScan]:
    """Return scans in the order along their node, the same whatever order they come in."""
    return sorted(scans, key=lambda scan: (scan.at_m, *scan.pose_map_base.tolist(), len(scan.points_m)))


def in_node(scan: NodeScan, pose_map_node: FloatArray) -> FloatArray:
    """Return the pose (3,) of a scan in the frame of its node, pose_map_node (4,): x, y, z, yaw."""
    T: FloatArray = se2.between(pose_map_node[[0, 1, 3]], scan.pose_map_base)
    return T


def near(points_m: FloatArray, range_m: float, centre_m: float) -> FloatArray:
    """Return the points (N, 2) within a range of the machine's centre, which is `centre_m` along x."""
    kept: FloatArray = points_m[np.hypot(points_m[:, 0] - centre_m, points_m[:, 1]) <= range_m]
    return kept


def thinned(points_m: FloatArray, voxel_m: float) -> FloatArray:
    """Return the mean point of each cell that has points (N, 2), ordered by cell; whatever order they come in."""
    if not len(points_m):
        return np.zeros((0, 2))
    cells = np.floor(points_m / voxel_m).astype(np.int64)
    order = np.lexsort((points_m[:, 1], points_m[:, 0], cells[:, 1], cells[:, 0]))
    cells, points = cells[order], points_m[order]
    starts = np.flatnonzero(np.r_[True, (np.diff(cells, axis=0) != 0).any(axis=1)])
    counts = np.diff(np.r_[starts, len(points)])
    means: FloatArray = np.add.reduceat(points, starts, axis=0) / counts[:, None]
    return means


def along_tunnel(scans: Sequence[NodeScan], pose_map_node: FloatArray, settings: LandmarkSettings) -> list[NodeCloud]:
    """Return the clouds of a tunnel: of the scan nearest to each multiple of the spacing, if one is within half of it."""
    scans = ordered(scans)
    places = np.array([scan.at_m for scan in scans])
    chosen: list[int] = []
    for k in range(round(places.min() / settings.spacing_m), round(places.max() / settings.spacing_m) + 1):
        best = int(np.argmin(np.abs(places - k * settings.spacing_m)))
        if abs(places[best] - k * settings.spacing_m) <= 0.5 * settings.spacing_m and best not in chosen[-1:]:
            chosen.append(best)
    clouds = [_cloud(scans[k], pose_map_node, settings) for k in chosen]
    return [cloud for cloud in clouds if len(cloud.points_m)]


def _cloud(scan: NodeScan, pose_map_node: FloatArray, settings: LandmarkSettings) -> NodeCloud:
    points = thinned(near(scan.points_m, settings.range_m, settings.centre_m), settings.voxel_m)
    return NodeCloud(scan.at_m, in_node(scan, pose_map_node), points)


def of_intersection(scans: Sequence[NodeScan], pose_map_node: FloatArray, settings: LandmarkSettings) -> NodeCloud:
    """Return the one cloud of an intersection, in the node's frame: all its scans, integrated."""
    parts = [
        se2.transform(in_node(scan, pose_map_node), near(scan.points_m, settings.range_m, settings.centre_m))
        for scan in ordered(scans)
    ]
    return NodeCloud(0.0, np.zeros(3), thinned(np.concatenate(parts), settings.voxel_m))

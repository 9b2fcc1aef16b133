"""A topological map in another frame: all of it turned about the vertical and shifted."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.topology.model import TopologicalMap


def carried(topology: TopologicalMap, pose_frame_map: FloatArray) -> TopologicalMap:
    """Return the map with its places in the frame that `pose_frame_map` (4,: x, y, z, yaw) leads to."""

    def points(line: FloatArray) -> FloatArray:
        return carried_points(line, pose_frame_map)

    def pose(one: FloatArray) -> FloatArray:
        return np.append(points(one[None, :3])[0], math.remainder(one[3] + pose_frame_map[3], 2.0 * math.pi))

    return replace(
        topology,
        tunnels=tuple(
            replace(one, line_m=points(one.line_m), pose_map_node=pose(one.pose_map_node)) for one in topology.tunnels
        ),
        intersections=tuple(
            replace(one, outline_m=points(one.outline_m), pose_map_node=pose(one.pose_map_node))
            for one in topology.intersections
        ),
        access_points=tuple(replace(one, pose=pose(one.pose)) for one in topology.access_points),
        waypoints=tuple(replace(one, pose=pose(one.pose)) for one in topology.waypoints),
        connections=tuple(replace(one, line_m=points(one.line_m)) for one in topology.connections),
    )


def carried_points(points_m: FloatArray, pose_frame_map: FloatArray) -> FloatArray:
    """Return points (N, 2) or (N, 3) in the frame that `pose_frame_map` (4,: x, y, z, yaw) leads to."""
    x, y, z, yaw = pose_frame_map.tolist()
    c, s = math.cos(yaw), math.sin(yaw)
    out = np.array(points_m, dtype=float)
    out[:, 0] = x + c * points_m[:, 0] - s * points_m[:, 1]
    out[:, 1] = y + s * points_m[:, 0] + c * points_m[:, 1]
    if out.shape[1] > 2:
        out[:, 2] += z
    return out

"""Landmarks of a map: its views put to its nodes, and what the landmarks tell of the tunnels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lhdmap.landmarks.build import landmarks_of
from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.scans import NodeScan
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.topology.build import Seen
from lhdmap.topology.driven import arc_m
from lhdmap.topology.lookup import Lookup
from lhdmap.topology.model import TopologicalMap

_WITHIN_M = 8.0  # a view farther from all nodes is of a room that has none
_EVERY_M = 1.0
_HEIGHT = 2.0  # a metre of height is as far as so many in plan: a tunnel may wind above itself
_LEVEL_M = 2.5  # of height over the floor up to which hits are walls and not the roof


def landmarks_for(topology: TopologicalMap, seen: Seen, settings: LandmarkSettings) -> Landmarks:
    """Return the landmarks of all nodes, from the views of the drive(s)."""
    frames = {node.id: node.pose_map_node for node in topology.nodes.values()}
    return landmarks_of(node_scans(topology, seen), frames, {tunnel.id for tunnel in topology.tunnels}, settings)


def with_stretches(topology: TopologicalMap, landmarks: Landmarks, settings: LandmarkSettings) -> TopologicalMap:
    """Return the map with the stretches of its tunnels that are not distinctive."""
    tunnels = [
        replace(tunnel, not_distinctive_m=tuple(landmarks.not_distinctive_m(tunnel.id, settings)))
        for tunnel in topology.tunnels
    ]
    return replace(topology, tunnels=tuple(tunnels))


def node_scans(topology: TopologicalMap, seen: Seen) -> list[NodeScan]:
    """Return the views as scans of the nodes that they were taken in, about one each metre of a visit."""
    nodes = Lookup(topology).nodes_at(seen.view_poses[:, :3], _WITHIN_M)
    lines = {tunnel.id: (tunnel.line_m, arc_m(tunnel.line_m)) for tunnel in topology.tunnels}
    travelled: dict[str, float] = {}
    scans, last = [], -np.inf
    before = ""
    for view, pose, node in zip(seen.views, seen.view_poses, nodes, strict=True):
        if not node or (node == before and abs(view.travelled_m - last) < 0.9 * _EVERY_M):
            continue
        travelled[node] = travelled.get(node, 0.0) + (view.travelled_m - last if node == before else 0.0)
        before, last = node, view.travelled_m
        if node in lines:
            line, along = lines[node]
            at_m = float(along[np.linalg.norm((line - pose[:3]) * [1.0, 1.0, _HEIGHT], axis=1).argmin()])
        else:
            at_m = travelled[node]
        hits = view.hits_m
        scans.append(NodeScan(node, at_m, pose[[0, 1, 3]], hits[hits[:, 2] < _LEVEL_M, :2], float(pose[2])))
    return scans

"""Views put to the nodes of a map: along a tunnel that winds above itself, by height too."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.pipeline.landmarks import node_scans
from lhdmap.topology.build import Seen
from lhdmap.topology.driven import arc_m
from lhdmap.topology.model import DEAD_END, TopologicalMap, Tunnel
from lhdmap.topology.views import Fan, View

RADIUS_M, RISE_M = 20.0, 8.0


def test_places_along_a_helix_are_those_of_their_winding() -> None:
    turns = np.linspace(0.0, 2.0, 500)
    angle = 2.0 * math.pi * turns
    line = np.column_stack([RADIUS_M * np.cos(angle), RADIUS_M * np.sin(angle), RISE_M * turns])
    helix = Tunnel("h", "H", (DEAD_END, DEAD_END), line, np.full((500, 2), 2.0), np.array([RADIUS_M, 0.0, 0.0, 1.57]))
    rows = np.arange(0, 500, 4)
    hits = np.array([[1.0, 2.0, 0.5], [1.0, -2.0, 0.5]], np.float32)
    along = arc_m(line)
    views = [View(int(k), float(along[k]), (Fan(np.zeros(2), hits),)) for k in rows]
    poses = np.column_stack([line[rows], angle[rows] + 0.5 * math.pi])
    scans = node_scans(
        TopologicalMap(tunnels=(helix,)), Seen(views, poses, poses, rows.astype(np.int64), [""] * len(rows))
    )
    assert len(scans) > 100
    heights = np.array([scan.height_m for scan in scans])
    assert [scan.at_m for scan in scans] == pytest.approx(np.interp(heights, line[:, 2], along), abs=0.6)

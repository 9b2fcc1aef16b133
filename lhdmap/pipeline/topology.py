"""What the topology is made of: views and path of a run at their final poses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.track import TrackRows, resample
from lhdmap.topology.build import Seen, Topology

_STEP_M = 0.25
_PLANAR_AND_HEIGHT = [0, 1, 2, 5]  # of a pose: x, y, z, heading


def seen_of(pipeline: MappingPipeline, rows: TrackRows) -> Seen:
    """Return what a run saw along its final path `rows`; views beyond its ends are left out (given poses may be fewer)."""
    views = [view for view in pipeline.evidence.views if rows.times_ns[0] <= view.time_ns <= rows.times_ns[-1]]
    times = np.array([view.time_ns for view in views], dtype=np.int64)
    chosen = each_step(rows)
    path_ns = rows.times_ns[chosen]
    return Seen(
        views,
        resample(rows, times).poses[:, _PLANAR_AND_HEIGHT],
        rows.poses[chosen][:, _PLANAR_AND_HEIGHT],
        path_ns,
        said_at(pipeline.evidence.said, path_ns),
        pipeline.machine,
    )


def counts_of(topology: Topology) -> dict[str, Any]:
    """Return the figures of `build-map --json`."""
    found = topology.map
    return {
        "tunnels": len(found.tunnels),
        "intersections": len(found.intersections),
        "levels": len(topology.sheets),
        "waypoints": len(found.waypoints),
        "unexplored": sum(tunnel.ends.count("unexplored") for tunnel in found.tunnels),
        "infeasible": sum(not one.feasible for one in found.connections),
    }


def each_step(rows: TrackRows) -> npt.NDArray[np.int64]:
    """Return the rows each quarter metre of a path, the first and the last among them."""
    steps = np.linalg.norm(np.diff(rows.poses[:, :2], axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    first = np.unique((travelled / _STEP_M).astype(np.int64), return_index=True)[1]
    return np.unique(np.append(first, len(rows.times_ns) - 1))


def said_at(said: Sequence[tuple[int, str]], times_ns: npt.NDArray[np.int64]) -> list[str]:
    """Return what was said last (when, what) at each of these times, empty before the first."""
    if not said:
        return [""] * len(times_ns)
    began = np.array([time_ns for time_ns, _ in said], dtype=np.int64)
    at = np.searchsorted(began, times_ns, side="right") - 1
    return [said[row][1] if row >= 0 else "" for row in at.tolist()]

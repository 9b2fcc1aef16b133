"""Landmarks of a map: those of the paper, and the fused walls of its nodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.landmarks.distinct import Stretches, not_distinctive
from lhdmap.landmarks.profile import WallProfile
from lhdmap.landmarks.quality import Quality
from lhdmap.landmarks.settings import LandmarkSettings
from lhdmap.landmarks.surface import Cells, surface_map
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.scan_matching.surface_map import SurfaceMap


class NodeSurface(NamedTuple):
    """Walls of a node: averaged hits, how well its own scans fit them, and of a tunnel the profile along it."""

    cells: Cells
    quality: Quality
    profile: WallProfile | None


@dataclass(frozen=True)
class Landmarks:
    """K landmarks, those of a node together and in order along it, and the walls of each node.

    `points_m` (N, 2) float32, of landmark k the rows `offsets[k]` to `offsets[k + 1]`, in the machine's frame at
    `poses_node[k]` (K, 3: x, y, yaw in the node's frame); that of an intersection is in the node's frame, its pose zero. `node`
    (K,): ids; `at_m` (K,). `threshold`, `delta` (K,): fitness (m²) that a match may have, and how much more the next one has
    that is no neighbour; NaN in intersections. `radius` (K,): landmarks to each side that match. `key` (K,): the one of an
    intersection is. `similarity`: by tunnel, (n, n) float32, source i on target j. `surfaces`: by node.
    """

    points_m: Float32Array
    offsets: npt.NDArray[np.int64]
    poses_node: FloatArray
    node: npt.NDArray[np.str_]
    at_m: FloatArray
    threshold: FloatArray
    delta: FloatArray
    radius: npt.NDArray[np.int32]
    key: npt.NDArray[np.bool_]
    similarity: Mapping[str, Float32Array] = field(default_factory=dict)
    surfaces: Mapping[str, NodeSurface] = field(default_factory=dict)

    def __len__(self) -> int:
        """Return K."""
        return len(self.node)

    def cloud(self, k: int) -> Float32Array:
        """Return the points (N, 2) of landmark k."""
        return self.points_m[self.offsets[k] : self.offsets[k + 1]]

    def of(self, node: str) -> npt.NDArray[np.intp]:
        """Return which landmarks a node has, in order along it."""
        return np.flatnonzero(self.node == node)

    def surface_map(self, node: str, about_m: FloatArray | None = None, reach_m: float = 60.0) -> SurfaceMap:
        """Return the walls of a node for `match`, in its frame; of long ones those around a point (2,).

        Raises:
            InputError: the node has no walls, or is too long to be had as a whole.
        """
        if node not in self.surfaces:
            raise InputError(
                f"landmarks: no walls of '{node}'; there are those of {', '.join(self.surfaces) or 'none'}"
            )
        return surface_map(self.surfaces[node].cells, about_m, reach_m)

    def not_distinctive_m(self, tunnel: str, settings: LandmarkSettings) -> Stretches:
        """Return the stretches [from, to] of a tunnel whose walls do not tell where along it one is (`Tunnel`), m."""
        if settings.method == "paper":
            return self._beyond_keys(tunnel, settings)
        surface = self.surfaces.get(tunnel)
        if surface is None or surface.profile is None:
            return []
        return not_distinctive(surface.profile.at_m, surface.profile.gap, settings.distinct_gap)

    def _beyond_keys(self, tunnel: str, settings: LandmarkSettings) -> Stretches:
        """Return what is beyond the radius of each key."""
        rows = self.of(tunnel)
        if not len(rows):
            return []
        found, free = [], float(self.at_m[rows[0]])
        for k in rows[self.key[rows]]:
            reach = (float(self.radius[k]) + 0.5) * settings.spacing_m
            if self.at_m[k] - reach > free:
                found.append((free, float(self.at_m[k] - reach)))
            free = max(free, float(self.at_m[k] + reach))
        end = float(self.at_m[rows[-1]])
        return [*found, (free, end)] if free < end else found

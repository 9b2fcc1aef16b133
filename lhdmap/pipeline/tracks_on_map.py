"""A map as tracking needs it: its walls, where a pose lies on it, and trackers that begin on it."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.config import Settings
from lhdmap.landmarks.quality import Quality
from lhdmap.localization.method import Tracks
from lhdmap.localization.paper import PaperTracker
from lhdmap.localization.paper_nodes import PaperNodes
from lhdmap.localization.place_on_map import Placer
from lhdmap.localization.tracker import MapTracker
from lhdmap.localization.walls import MapWalls
from lhdmap.messages import FloatArray
from lhdmap.pipeline.known_map import KnownMap

_LEAST_SUPPORT = 0.35  # where a node's own scans tell of none
_LOWEST_SUPPORT = 0.15  # no drop below it: so many hits agree with any wall by chance


class TracksOnMap:
    """`walls` and `placer` of a map; `at` begins a tracker by the method of the settings."""

    def __init__(self, known: KnownMap, settings: Settings) -> None:
        self._settings = settings.localization
        self.walls, self.placer = MapWalls(known.topology, known.landmarks), Placer(known.topology)
        paper = self._settings.method == "paper"
        self._paper = PaperNodes(known.topology, known.landmarks, settings.landmarks) if paper else None

    def at(self, pose: FloatArray, std: FloatArray, height_m: float) -> Tracks:
        """Return what tracks from a pose (3,) with these deviations (3,)."""
        tracker = MapTracker(self.walls, self._settings, pose, np.diag(std**2), height_m)
        return tracker if self._paper is None else PaperTracker(self._paper, self.placer, tracker)

    def begun(self, start: FloatArray) -> Tracks:
        """Return what tracks from a start (3,) or (4,), or from the first of several (K, 4)."""
        std = np.array([self._settings.start_std_m] * 2 + [math.radians(self._settings.start_std_deg)])
        start = start if start.ndim == 1 else start[0]
        return self.at(start[:3], std, float(start[3]) if len(start) > 3 else 0.0)

    def height_m(self, pose: FloatArray, height_m: float) -> float:
        """Return the floor's height at a pose (3,), near a height."""
        return self.placer.height_m(pose[0], pose[1], height_m)

    def quality(self, tracker: Tracks) -> Quality:
        """Return how well the walls are known where a tracker is."""
        return self.walls.quality(self.placer.node_at(tracker.pose, tracker.height_m))

    def wanted_support(self, tracker: Tracks) -> float:
        """Return the share of hits that must agree with the walls where a tracker is."""
        least = self.quality(tracker).support_least
        drop = self._settings.support_drop
        return max((least if math.isfinite(least) else _LEAST_SUPPORT) - drop, _LOWEST_SUPPORT)

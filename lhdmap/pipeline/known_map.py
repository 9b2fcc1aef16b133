"""A map as localization needs it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, Self

from lhdmap.config import Settings
from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.store import read_landmarks
from lhdmap.localization.search import GlobalSearch
from lhdmap.localization.strips import strips_of
from lhdmap.localization.walls import MapWalls
from lhdmap.mapfolder import MapFolder
from lhdmap.topology.files import read_topology
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import Sheet, read_sheets


class KnownMap(NamedTuple):
    """What of a map localization needs."""

    topology: TopologicalMap
    landmarks: Landmarks
    sheets: list[Sheet]

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read it from a map folder; raises InputError where something is missing."""
        folder = MapFolder.open(path)
        sheets = read_sheets(folder.file("free_space.npz"))
        return cls(read_topology(path), read_landmarks(folder.file("landmarks.npz")), sheets)

    def search(self, walls: MapWalls, settings: Settings) -> GlobalSearch:
        """Return what searches it, with walls of its own: it works in a thread of its own."""
        strips = strips_of(self.topology, self.landmarks, settings.landmarks)
        return GlobalSearch(strips, walls.apart(), settings.localization, settings.landmarks)

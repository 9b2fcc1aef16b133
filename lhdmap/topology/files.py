"""Reading the topological map of a map folder, or of a file alone."""

from __future__ import annotations

from pathlib import Path

from lhdmap.errors import InputError
from lhdmap.json_files import read_json
from lhdmap.topology.geojson import from_geojson
from lhdmap.topology.model import TopologicalMap

NAME = "topology.geojson"


def topology_file(path: Path) -> Path:
    """Return the file of the topological map that a map folder holds, or that is named itself.

    Raises:
        InputError: there is none.
    """
    file = path / NAME if path.is_dir() else path
    if not file.is_file():
        told = "the map has no topology; build it again with lhdmap build-map" if path.is_dir() else "no such file"
        raise InputError(f"{file}: {told}")
    return file


def read_topology(path: Path) -> TopologicalMap:
    """Return the topological map of a map folder, or of a `topology.geojson`.

    Raises:
        InputError: there is none, or it cannot be read.
    """
    file = topology_file(path)
    return from_geojson(read_json(file, "the topological map", "build the map again"), str(file))

"""The formats of `lhdmap export`, in one table. A format is a module of this package with `write(content, path, at)`."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, cast

if TYPE_CHECKING:
    from lhdmap.exports.content import Content


class Format(NamedTuple):
    """One format: its module, suffixes of its file (the first is the default), what follows the map's name in a default one.

    `machines`: read by a machine that is localized in `map`; it stays in that frame unless the grid is asked for.
    """

    module: str
    summary: str
    suffixes: tuple[str, ...]
    ending: str = ""
    machines: bool = False


FORMATS = {
    "geojson": Format("geojson", "topology as GeoJSON", (".geojson", ".json")),
    "nav2-route": Format("nav2_route", "graph of nav2_route", (".geojson", ".json"), "_nav2_route", machines=True),
    "occupancy": Format(
        "occupancy", "free space for nav2's map_server: YAML and PGM", (".yaml", ".yml"), machines=True
    ),
    "dxf": Format("dxf", "drawing: walls, centre lines, nodes, points", (".dxf",)),
    "graphml": Format("graphml", "graph of places, for network tools", (".graphml", ".xml")),
    "laz": Format("cloud", "cloud as LAZ or LAS", (".laz", ".las")),
    "ply": Format("cloud", "cloud as PLY", (".ply",)),
    "e57": Format("e57", "cloud as ASTM E57 (extra e57)", (".e57",)),
    "tmap2": Format("tmap2", "topological map of LCAS topological_navigation", (".tmap2", ".yaml"), machines=True),
}


class Writer(Protocol):
    """A format's module."""

    def write(self, content: Content, path: Path, at: Callable[[Path], Path]) -> dict[str, Any]:
        """Write the map as `path`; each file to `at(its path)`. Return counts of what was written.

        Raises:
            InputError: the map lacks what the format needs.
        """
        ...


def writer_of(name: str) -> Writer:
    """Return the writer of a format."""
    return cast("Writer", importlib.import_module(f"lhdmap.exports.{FORMATS[name].module}"))


def files_of(name: str, content: Content, path: Path) -> list[Path]:
    """Return the files that a format writes as `path`: it alone, or more where its module says so (`files`)."""
    more = getattr(writer_of(name), "files", None)
    return [path] if more is None else list(more(content, path))

"""Checks of what a map folder says beside its topology: its files as they were written, heights, landmarks."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.machine import Machine
from lhdmap.mapfolder import MapFolder
from lhdmap.movement.findings import Finding
from lhdmap.topology.geojson import content_sha256
from lhdmap.topology.model import TopologicalMap

_LANDMARKS = "landmarks.npz"
_NO_HEIGHT = "no inclinometer"  # in the warning of a log that is treated as planar


def folder_findings(folder: MapFolder, topology: TopologicalMap) -> Iterator[Finding]:
    """Yield what is wrong with a map folder around its topology."""
    for name in folder.changed_files():
        yield Finding("error", "hash", name, "is missing or not as it was written")
    if any(_NO_HEIGHT in str(text) for text in folder.info.get("warnings", [])):
        text = "no source of heights: the drive was treated as planar; levels that cross look like one"
        yield Finding("warning", "height", "map", text)
    if (folder.path / _LANDMARKS).is_file():
        yield from landmark_findings(folder.path / _LANDMARKS, topology)
    else:
        yield Finding("note", "landmarks", "map", f"no {_LANDMARKS}: nothing to localize with")


def content_findings(table: dict[str, Any]) -> Iterator[Finding]:
    """Yield whether the features of a topology are those that its hash was made of."""
    wanted = table.get("lhdmap", {}).get("content_sha256")
    if wanted is not None and wanted != content_sha256(table["features"]):
        text = "its features are not those that its content_sha256 was made of: changed by hand?"
        yield Finding("error", "hash", "topology", text)


def landmark_findings(path: Path, topology: TopologicalMap) -> Iterator[Finding]:
    """Yield landmarks of no node, ambiguous ones, and driven nodes without any.

    Raises:
        InputError: the file cannot be read.
    """
    nodes, key, radius = _landmarks(path)
    for name in dict.fromkeys(nodes.tolist()):
        if name not in topology.nodes:
            count = int((nodes == name).sum())
            yield Finding("error", "landmarks", name, f"{count} landmarks of a node that the map does not have")
    for node in topology.nodes.values():
        own = nodes == node.id
        if not own.any():
            if getattr(node, "driven", True):
                yield Finding(
                    "warning", "landmarks", node.name, "no landmark: the machine cannot localize itself in it"
                )
        elif not key[own].any():
            yield Finding("warning", "landmarks", node.name, "no key landmark: all look like others")
        elif (radius[own & key] <= 0.0).any():
            count = int((radius[own & key] <= 0.0).sum())
            yield Finding("warning", "landmarks", node.name, f"{count} key landmarks with radius 0: ambiguous")


def _landmarks(path: Path) -> tuple[npt.NDArray[Any], npt.NDArray[np.bool_], npt.NDArray[np.float64]]:
    """Return node (K,) as text, key (K,) and radius (K,) of the landmarks."""
    try:
        with np.load(path, allow_pickle=False) as table:
            nodes = np.array([str(name) for name in table["node"]], dtype=object)
            key, radius = np.asarray(table["key"], bool), np.asarray(table["radius"], float)
    except (OSError, ValueError, KeyError, EOFError) as error:
        raise InputError(f"{path}: not readable as landmarks ({error}); build the map again") from error
    if not len(nodes) == len(key) == len(radius):
        raise InputError(f"{path}: {len(nodes)} nodes, {len(key)} keys, {len(radius)} radii; build the map again")
    return nodes, key, radius


def machine_of_map(folder: MapFolder) -> Machine | None:
    """Return the machine that the map was built for, where that is the default one; None where its file is needed."""
    request = folder.info.get("options", {}).get("request") or {}
    name = request.get("machine") if isinstance(request, dict) else None
    return Machine() if name in (None, Machine().name) else None

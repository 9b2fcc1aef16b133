"""The cloud as LAZ, LAS or PLY. In the grid: LAZ with the header's offset, PLY with x, y, z as doubles."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from lhdmap.exports.content import Content
from lhdmap.integration.cloud_io import write_cloud
from lhdmap.integration.ply import write_ply


def write(content: Content, path: Path, at: Callable[[Path], Path]) -> dict[str, Any]:
    """Write the cloud in the format of the suffix."""
    if path.suffix.lower() == ".ply":
        write_ply(at(path), content.cloud, frame=content.frame)
    else:
        write_cloud(at(path), content.cloud)
    return {"points": len(content.cloud)}

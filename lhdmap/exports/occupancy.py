"""Free space for nav2's map_server (and ROS 1's): a YAML file and a PGM picture for each level.

Pixels are those of map_saver: free 254, occupied 0, unknown 205. With its `free_thresh` of 0.25 an unknown pixel would be read as
free, as (255 - 205) / 255 = 0.19608; 0.196, ROS 1's, keeps it unknown.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.errors import InputError
from lhdmap.exports.content import Content
from lhdmap.topology.sheet import FREE, OCCUPIED, UNKNOWN, Sheet

PIXELS = np.zeros(256, dtype=np.uint8)
PIXELS[[UNKNOWN, FREE, OCCUPIED]] = 205, 254, 0
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196


def files(content: Content, path: Path) -> list[Path]:
    """Return the files: a pair, or one a level, from the lowest: NAME_1, NAME_2, … The YAML files come last.

    Raises:
        InputError: the map has no free space.
    """
    sheets = len(content.sheets)
    if not sheets:
        raise InputError(f"{content.folder.path}: free_space.npz has no level in it; build the map again")
    stems = [path.stem] if sheets == 1 else [f"{path.stem}_{k}" for k in range(1, sheets + 1)]
    return [path.with_name(stem + suffix) for suffix in (".pgm", path.suffix) for stem in stems]


def write(content: Content, path: Path, at: Callable[[Path], Path]) -> dict[str, Any]:
    """Write the pairs; raises InputError as `files`."""
    sheets = sorted(content.sheets, key=lambda sheet: sheet.height_m)
    names = files(content, path)
    for sheet, pgm, yaml in zip(sheets, names[: len(sheets)], names[len(sheets) :], strict=True):
        _write_pgm(at(pgm), sheet)
        _write_yaml(at(yaml), sheet, pgm.name, content)
    return {"levels": len(sheets), "heights_m": [sheet.height_m for sheet in sheets]}


def _write_pgm(path: Path, sheet: Sheet) -> None:
    """Write the picture: its first row is the top, the highest y."""
    pixels = PIXELS[sheet.cells[::-1]]
    rows, columns = pixels.shape
    with path.open("wb") as file:
        file.write(f"P5\n# lhdmap: {sheet.cell_m:g} m a pixel\n{columns} {rows}\n255\n".encode("ascii"))
        file.write(pixels.tobytes())


def _write_yaml(path: Path, sheet: Sheet, image: str, content: Content) -> None:
    """Write what map_server reads: `origin` is the pose of the lower left pixel's corner, turned where the grid is."""
    from ruamel.yaml import YAML

    yaw_rad = 0.0 if content.T_grid_map is None else content.T_grid_map.rotation_rad
    corner = content.in_frame(np.array(sheet.origin_m, dtype=float))
    table = {
        "image": image,
        "mode": "trinary",
        "resolution": float(sheet.cell_m),
        "origin": [round(float(corner[0]), 4), round(float(corner[1]), 4), float(yaw_rad)],
        "negate": 0,
        "occupied_thresh": OCCUPIED_THRESH,
        "free_thresh": FREE_THRESH,
    }
    with path.open("w", encoding="utf-8") as file:
        YAML().dump(table, file)

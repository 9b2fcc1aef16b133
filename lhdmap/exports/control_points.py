"""Files of control points: CSV or TOML, of points that are known in the map and in the mine's grid.

CSV, a line a point: `name, x, y, z, E, N, Z` and optionally `std_m`. TOML: `[[control_point]]` with `name`, `map_m` (or `at`: the
name of a waypoint or access point of the map), `grid_m`, `std_m`. Without x, y, z the point's name is that of a place on the map.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.errors import InputError
from lhdmap.exports.registration import STD_M, ControlPoint
from lhdmap.messages import FloatArray
from lhdmap.settings import nearest, read_toml
from lhdmap.topology.model import AccessPoint, TopologicalMap, Waypoint

Places = Callable[[str], FloatArray | None]
_COLUMNS = {
    "name": ("name", "id", "point"),
    "at": ("at", "place"),
    "x": ("x", "mapx"),
    "y": ("y", "mapy"),
    "z": ("z", "mapz"),
    "E": ("e", "gride", "east", "easting"),
    "N": ("n", "gridn", "north", "northing"),
    "Z": ("u", "h", "gridz", "elevation", "height", "rl"),
    "std": ("std", "sigma"),
}
_WANTED = "name, x, y, z, E, N, Z"


def read_control_points(path: Path, topology: TopologicalMap | None = None) -> list[ControlPoint]:
    """Return the control points of a CSV or TOML file; names of places are looked up in the map.

    Raises:
        InputError: the file is missing or damaged, a column is missing, a number is none, or a place is not on the map.
    """
    rows = _toml_rows(path) if path.suffix.lower() == ".toml" else _csv_rows(path)
    points = [_point(f"{path}, {where}", row, topology) for where, row in rows]
    names = [point.name for point in points]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{path}: control point {twice} is there twice; each name once was wanted")
    return points


def _toml_rows(path: Path) -> list[tuple[str, dict[str, Any]]]:
    tables = read_toml(path, "control points").get("control_point", [])
    if not isinstance(tables, list) or not all(isinstance(one, Mapping) for one in tables):
        raise InputError(f"{path}: tables [[control_point]] with name, map_m, grid_m were wanted")
    rows: list[tuple[str, dict[str, Any]]] = []
    for number, table in enumerate(tables, 1):
        where = f"[[control_point]] {number}"
        unknown = next((key for key in table if key not in ("name", "at", "map_m", "grid_m", "std_m")), None)
        if unknown is not None:
            known = ("name", "at", "map_m", "grid_m", "std_m")
            raise InputError(f"{path}, {where}: unknown setting {unknown!r}{nearest(unknown, known)}")
        row = {"name": table.get("name", ""), "at": table.get("at", ""), "std": table.get("std_m", "")}
        for key, axes in (("map_m", "xyz"), ("grid_m", "ENZ")):
            values = table.get(key, ("", "", ""))
            if not isinstance(values, Sequence) or len(values) != 3:
                raise InputError(f"{path}, {where}: {key} = {values!r}; three numbers were wanted")
            row |= dict(zip(axes, values, strict=True))
        rows.append((where, row))
    return rows


def _csv_rows(path: Path) -> list[tuple[str, dict[str, Any]]]:
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}: control points cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from error
    numbered = [(number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    if not numbered:
        raise InputError(f"{path}: empty; control points were wanted, a first line {_WANTED} and one a point")
    mark = next((mark for mark in ";\t" if mark in numbered[0][1]), ",")
    cells = list(csv.reader([line for _, line in numbered], delimiter=mark, skipinitialspace=True))
    columns = _columns(path, cells[0])
    return [
        (f"line {number}", {key: row[at].strip() if at < len(row) else "" for key, at in columns.items()})
        for (number, _), row in zip(numbered[1:], cells[1:], strict=True)
    ]


def _columns(path: Path, header: Sequence[str]) -> dict[str, int]:
    """Return where each column is. A lone Z beside z is the grid's; the case of a letter counts only there."""
    words = [cell.strip() for cell in header]
    plain = [
        "".join(c for c in word.lower() if c.isalnum()).removesuffix("m") if len(word) > 1 else word for word in words
    ]
    found: dict[str, int] = {}
    for at, word in enumerate(plain):
        key = next((key for key, names in _COLUMNS.items() if word == key or word.lower() in names), None)
        if word == "Z":
            key = "Z"
        if key is not None:
            found.setdefault(key, at)
    missing = [key for key in ("E", "N", "Z") if key not in found]
    if missing or not {"name", "at"} & found.keys():
        raise InputError(
            f"{path}: columns {', '.join(words)}; {_WANTED} were wanted in the first line (without x, y, z where name is a "
            "place on the map)"
        )
    return found


def _point(where: str, row: Mapping[str, Any], topology: TopologicalMap | None) -> ControlPoint:
    name = str(row.get("name") or row.get("at") or "")
    if not name:
        raise InputError(f"{where}: the control point has no name")
    grid_m = np.array([_number(where, row, key) for key in "ENZ"])
    given = [row.get(key, "") != "" for key in "xyz"]
    if any(given):
        map_m = np.array([_number(where, row, key) for key in "xyz"])
    else:
        map_m = _place(where, str(row.get("at") or name), topology)
    std_m = _number(where, row, "std") if row.get("std", "") != "" else STD_M
    if std_m <= 0.0:
        raise InputError(f"{where}: std_m {std_m:g}; more than 0 was wanted")
    return ControlPoint(name, map_m, grid_m, std_m)


def _number(where: str, row: Mapping[str, Any], key: str) -> float:
    text = row.get(key, "")
    try:
        value = math.nan if isinstance(text, bool) else float(text)
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{where}: {key} is {text!r}, a number (m, decimal point) was wanted")
    return value


def _place(where: str, name: str, topology: TopologicalMap | None) -> FloatArray:
    """Return where a place (3,) is on the map."""
    if topology is None:
        raise InputError(f"{where}: no x, y, z, and the map has no places to look {name} up in")
    found = topology.called(name)
    if isinstance(found, (AccessPoint, Waypoint)):
        return np.array(found.pose[:3], dtype=float)
    what = "is no point but a node" if found is not None else "is not on the map"
    points = [*(one.name for one in topology.waypoints), *topology.points]
    raise InputError(
        f"{where}: no x, y, z, and {name} {what}; a waypoint or access point was wanted{nearest(name, points)}"
    )

"""`export`: one map in one format, registered in the mine's grid where control points or the map itself say how."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.errors import LhdmapWarning, UsageError
from lhdmap.exports.content import MAP, TOPOLOGY, Content, table_in_map
from lhdmap.exports.control_points import read_control_points
from lhdmap.exports.formats import FORMATS, files_of, writer_of
from lhdmap.exports.judgement import refuse_misfit, remarks
from lhdmap.exports.registration import GRID, TOLERANCE_M, Registration, Transform, read_transform, register
from lhdmap.mapfolder import MapFolder
from lhdmap.names import beside, name_of
from lhdmap.outputs import OutputFiles
from lhdmap.topology.geojson import from_geojson


@dataclass(frozen=True, slots=True)
class ExportRequest:
    """What is to be written: a map folder as a format; `frame`: `map`, `mine_grid`, or empty for what fits the format."""

    map: Path
    format: str
    output: Path | None = None
    control_points: Path | None = None
    tolerance_m: float = TOLERANCE_M
    frame: str = ""
    force: bool = False


def export(request: ExportRequest) -> dict[str, Any]:
    """Write the files and return what `lhdmap export --json` prints.

    Raises:
        UsageError: the suffix is none of the format's, a file is there already, or the grid is not known.
        InputError: the map lacks what the format needs, or the control points cannot be used.
        Misfit: the control points do not fit within the tolerance (an EvaluationShortfall).
    """
    path = _target(request)
    folder = MapFolder.open(request.map)
    registration, T_grid_map = _registered(request, folder)
    content = Content(folder, registration, T_grid_map if _in_grid(request, T_grid_map) else None)
    inputs = [folder.file(name) for name in folder.info.get("files", {}) if (folder.path / name).is_file()]
    inputs += [request.control_points] if request.control_points else []
    with OutputFiles(*files_of(request.format, content, path), force=request.force, inputs=inputs) as files:
        counts = writer_of(request.format).write(content, path, files.at)
    return {
        "format": request.format,
        "files": [str(one) for one in files_of(request.format, content, path)],
        "frame": content.frame,
        "counts": counts,
        "registration": registration,
    }


def _target(request: ExportRequest) -> Path:
    """Return the file to write; its suffix must be one of the format's."""
    form = FORMATS[request.format]
    if request.output is None:
        return beside(request.map, "").with_name(name_of(request.map) + form.ending + form.suffixes[0])
    if request.output.suffix.lower() not in form.suffixes:
        raise UsageError(
            f"-o {request.output}: {request.format} was asked for; its suffix is {' or '.join(form.suffixes)}"
        )
    return request.output


def _registered(request: ExportRequest, folder: MapFolder) -> tuple[Mapping[str, Any] | None, Transform | None]:
    """Return the registration, from control points or else from the map, as JSON has it and as a transform."""
    table = table_in_map(folder) if (folder.path / TOPOLOGY).is_file() else None
    if request.control_points is None:
        member = None if table is None else table["lhdmap"].get("registration")
        return member, None if member is None else read_transform(member, str(folder.path / TOPOLOGY))
    topology = None if table is None else from_geojson(table)
    points = read_control_points(request.control_points, topology)
    registration = register(points, request.tolerance_m)
    refuse_misfit(registration)
    for text in remarks(registration, _reach_m(folder, registration)):
        warnings.warn(text, LhdmapWarning, stacklevel=2)
    return registration.to_json(), registration.T_grid_map


def _reach_m(folder: MapFolder, registration: Registration) -> float:
    """Return how far the drive goes from the middle of the control points, in plan (m)."""
    if not (folder.path / "trajectory.tum").is_file():
        return 0.0
    middle = np.mean([one.map_m for one in registration.points], axis=0)
    away = folder.trajectory().positions_m[:, :2] - middle[:2]
    return float(np.linalg.norm(away, axis=1).max()) if len(away) else 0.0


def _in_grid(request: ExportRequest, T_grid_map: Transform | None) -> bool:
    if request.frame == GRID and T_grid_map is None:
        raise UsageError(f"--frame {GRID}: the map has no registration; --control-points FILE gives it one")
    if request.frame:
        return request.frame != MAP
    asked = request.control_points is not None
    return T_grid_map is not None and (asked or not FORMATS[request.format].machines)

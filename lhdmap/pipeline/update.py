"""`update-map` as a function: a map and another drive in, a new version of the map out; the old one stays as it is.

drive -> its own map -> placed in the map (all headings and shifts) -> fitted scan by scan -> path, views, cloud of both
-> topology -> difference
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from lhdmap.config import Settings, settings_table
from lhdmap.errors import InputError, LhdmapWarning, UsageError
from lhdmap.machine import Machine
from lhdmap.mapfolder import MapFolderWriter
from lhdmap.messages import FloatArray
from lhdmap.names import name_of
from lhdmap.outputs import free_folder
from lhdmap.pipeline.build import BuildRequest, Progress, build_map
from lhdmap.pipeline.landmarks import landmarks_for, with_stretches
from lhdmap.pipeline.taught import TaughtMap, path_of, scratch
from lhdmap.pipeline.update_files import Made, joined, write_version
from lhdmap.provenance import file_entry
from lhdmap.runfolder import RunInfo
from lhdmap.smoothing.smoother import Correction
from lhdmap.topology.build import Seen, topology_of
from lhdmap.topology.edits import TopologyEdits, load_edits
from lhdmap.topology.lookup import Lookup
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.views import View
from lhdmap.trajectory import Trajectory
from lhdmap.update import fit, merge
from lhdmap.update.difference import difference
from lhdmap.update.place import placings

_NEWER_WEIGHT = 4  # of what was seen later
_ALIKE = 0.7  # of the share of scans that fit where it is best
_NAMED_WITHIN_M = 3.0
_OVERLAP = "{}: its times are those of the map's drives, too; in the new version they are {:.0f} s later"


@dataclass(frozen=True, slots=True)
class UpdateRequest:
    """What is to be done: map, logs of one drive, the folder to make, settings, edits, `start` (3,): about where the drive begins.

    `progress`, `topics`, `machine`, `force` as for `build_map`.
    """

    map: Path
    logs: Sequence[Path]
    target: Path
    settings: Settings = field(default_factory=Settings)
    topics: Mapping[str, str] = field(default_factory=dict)
    machine: Machine | None = None
    progress: Progress | None = None
    edits: Path | None = None
    start: FloatArray | None = None
    force: bool = False


@dataclass(frozen=True, slots=True)
class UpdateResult:
    """What came of it: the folder, its version, the difference report, warnings."""

    folder: Path
    version: int
    difference: dict[str, Any]
    warnings: list[str]


def update_map(request: UpdateRequest) -> UpdateResult:
    """Add a drive to a map and write the new version.

    Raises:
        UsageError: the folder is there already, or is that of the old map.
        InputError: the map or a log cannot be used, or the drive does not lie in the map.
    """
    inputs = [request.map, *request.logs]
    if request.target.resolve() == request.map.resolve():
        raise UsageError(f"{request.target}: a new version is a folder of its own; name another one with -o")
    free_folder(request.target, force=request.force, inputs=inputs)
    edits, known = load_edits(request.edits), TaughtMap.read(request.map)
    with scratch() as alone:
        drive_folder = alone / "drive"
        built = build_map(
            BuildRequest(
                request.logs, drive_folder, request.settings, request.topics, request.machine, request.progress
            )
        )
        drive = TaughtMap.read(drive_folder).after(known.trajectory)
        if drive.later_ns:
            built.warnings.append(_OVERLAP.format(name_of(request.logs[0]), drive.later_ns * 1e-9))
        correction = _in_the_map(known, drive, request)
        with MapFolderWriter(request.target, force=request.force, inputs=inputs) as folder:
            return _written(folder, request, edits, known, drive, correction, built.warnings)


def _in_the_map(known: TaughtMap, drive: TaughtMap, request: UpdateRequest) -> Correction:
    """Return how the drive is to be moved into the map's frame."""
    log, smoothing = request.logs[0], request.settings.smoothing
    places = placings(known.sheets, drive.sheets[0], request.start)
    if not places:
        raise InputError(
            f"{log}: its walls are nowhere in {request.map}; say where it begins with --start, or build it apart"
        )
    shares = [fit.share_that_fits(known.seen, drive.seen, one.pose_map_drive, smoothing) for one in places]
    best, *others = sorted(shares, reverse=True)
    if others and best > 0.0 and others[0] >= _ALIKE * best:
        raise InputError(
            f"{log}: two places of {request.map} look alike to it ({100 * best:.0f} and {100 * others[0]:.0f} % of its "
            "scans fit); say where it begins with --start X,Y,HEADING_DEG"
        )
    place = places[shares.index(best)]
    found = fit.fitted(known.seen, drive.seen, place.pose_map_drive, smoothing)
    if found is None:
        raise InputError(f"{log}: its scans do not fit the walls of {request.map}; build it apart")
    if found.tied < 0.2 * found.keys:
        text = f"{log}: only {found.tied} of {found.keys} places of the drive are held by the map's walls"
        warnings.warn(text, LhdmapWarning, stacklevel=2)
    return found.correction


def _written(
    folder: MapFolderWriter,
    request: UpdateRequest,
    edits: TopologyEdits,
    known: TaughtMap,
    drive: TaughtMap,
    correction: Correction,
    remarks: list[str],
) -> UpdateResult:
    """Write the new version from both."""
    moved = merge.moved_trajectory(drive.trajectory, correction)
    final = joined(known.trajectory, moved)
    views, seen = _seen(known, drive, moved, request)
    topology = topology_of(seen, request.settings.topology, edits)
    landmarks = landmarks_for(topology.map, seen, request.settings.landmarks)
    version = known.topology.version + 1
    newer = with_stretches(topology.map, landmarks, request.settings.landmarks)
    newer = replace(newer, version=version, registration=known.topology.registration)
    table, walls = difference(known.topology, newer, (known.sheets, topology.sheets))
    went = np.concatenate([np.zeros((0, 2)), *(one.went_m for one in walls)])
    cloud = merge.joined_clouds(known.cloud, merge.moved_cloud(drive.cloud, correction), went, seen.path)
    made = Made(
        request.target.name,
        request.map,
        request.logs,
        request.settings,
        request.machine or Machine(bodies={}),
        (known.folder, drive.folder),
        drive.later_ns,
        final,
        views,
        newer,
        topology.sheets,
        landmarks,
        cloud,
        table,
        walls,
        _counts(known, drive, newer, correction),
        remarks,
    )
    write_version(folder, made)
    info = RunInfo(
        request.logs,
        {**settings_table(request.settings), "request": {"update_of": _entry(known)}},
        made.counts,
        remarks,
        {},
        {"version": version, "previous": _entry(known), "earlier_sources": known.folder.info.get("sources", [])},
    )
    return UpdateResult(folder.complete(info), version, table, remarks)


def _seen(known: TaughtMap, drive: TaughtMap, moved: Trajectory, request: UpdateRequest) -> tuple[list[View], Seen]:
    """Return the views of both, and what the topology is made of: names stay, the newer views tell more."""
    views = [*known.views, *drive.views]
    poses = np.vstack([known.seen.poses, merge.view_poses(moved, drive.views)])
    paths = [path_of(known.trajectory), path_of(moved)]
    lookup = Lookup(known.topology)
    said = [*lookup.names_at(paths[0][0][:, :3]), *lookup.names_at(paths[1][0][:, :3], _NAMED_WITHIN_M)]
    weights = np.concatenate([np.ones(len(known.views)), np.full(len(drive.views), _NEWER_WEIGHT)]).astype(np.int64)
    path = np.vstack([paths[0][0], paths[1][0]])
    times = np.concatenate([paths[0][1], paths[1][1]])
    return views, Seen(views, poses, path, times, said, request.machine, weights)


def _counts(known: TaughtMap, drive: TaughtMap, newer: TopologicalMap, correction: Correction) -> dict[str, Any]:
    """Return the figures of both drives together; places where the map's walls hold the drive count as closed loops."""
    earlier, added = known.folder.info.get("counts", {}), drive.folder.info.get("counts", {})
    summed = ("scans_processed", "duration_s", "lost_stretches", "closures")
    return {
        **earlier,
        **{key: earlier.get(key, 0) + added.get(key, 0) for key in summed},
        "closures": earlier.get("closures", 0) + added.get("closures", 0) + correction.closures,
        "map_version": known.topology.version + 1,
        "scans": len(known.trajectory.stamps_ns) + len(drive.trajectory.stamps_ns),
        "distance_m": earlier.get("distance_m", _length_m(known.trajectory)) + _length_m(drive.trajectory),
        "tied": correction.closures,
        "tunnels": len(newer.tunnels),
        "intersections": len(newer.intersections),
    }


def _length_m(trajectory: Trajectory) -> float:
    return float(np.linalg.norm(np.diff(trajectory.positions_m, axis=0), axis=1).sum())


def _entry(known: TaughtMap) -> dict[str, Any]:
    file = known.folder.file("topology.geojson")
    return {"map": str(known.folder.path.name), "version": known.topology.version, "topology": file_entry(file)}

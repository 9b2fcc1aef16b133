"""`build-map` of logs of several drives: each drive is mapped alone, then all become one map where they overlap.

drives -> a map of each -> the first is the map; each other one is found on it by the global search and fitted scan by scan
-> path, views, cloud of all -> topology, landmarks
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lhdmap.errors import InputError
from lhdmap.integration.cloud import GridCloud
from lhdmap.landmarks.model import Landmarks
from lhdmap.machine import Machine
from lhdmap.names import name_of
from lhdmap.outputs import free_folder
from lhdmap.pile.moved import moved_report
from lhdmap.pile.result import PileReport
from lhdmap.pipeline.build import BuildRequest, BuildResult, build_map
from lhdmap.pipeline.cost import CompileClock
from lhdmap.pipeline.drives import LogDrive, drives_of
from lhdmap.pipeline.join_files import Joined, write_joined
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.pipeline.landmarks import landmarks_for, with_stretches
from lhdmap.pipeline.overlap import overlap_of
from lhdmap.pipeline.path import motion_at
from lhdmap.pipeline.taught import TaughtMap, path_of, scratch
from lhdmap.pipeline.topology import said_at
from lhdmap.pipeline.update_files import joined
from lhdmap.topology.build import Seen, Topology, topology_of
from lhdmap.topology.edits import NO_EDITS, TopologyEdits
from lhdmap.topology.points import with_piles
from lhdmap.trajectory import Trajectory
from lhdmap.update import fit, merge

_APART = (
    "{other}: it cannot be joined to {first}: {reason}; drives of one map share some 25 m of tunnel at least. "
    "Build them apart, or leave one out"
)
_OVERLAP = "{}: its times are those of an earlier drive, too; in the map they are {:.0f} s later"
_STAYED = "after a pause at {:.0f} s the machine seems to be in another place, and the drive after it could not be joined ({})"
_HARDLY = "{}: only {} of {} places of the drive are held by the walls of the others"


class _Part(NamedTuple):
    """A drive in the map's frame: its map (times moved where needed), what came of its run, how often its walls were tied."""

    drive: LogDrive
    taught: TaughtMap
    built: BuildResult
    path: Trajectory
    cloud: GridCloud
    pile: PileReport | None
    tied: int = 0


def build_drives(request: BuildRequest) -> BuildResult:
    """Build one map of the logs of one drive or of several (`build_map`, where they are one).

    Raises:
        InputError: a log cannot be used, or drives do not overlap.
        UsageError: the folder is there already.
    """
    started = time.monotonic()
    free_folder(request.target, force=request.force, inputs=request.logs)
    edits = request.inputs.edits  # a mistake in them is told before the logs are read
    drives = [LogDrive(tuple(request.logs))] if request.poses else drives_of(request.logs, request.topics)
    if len(drives) == 1:
        return build_map(request)
    with CompileClock() as compiling, scratch() as folder:
        parts = [_alone(request, drive, folder / f"drive_{number}") for number, drive in enumerate(drives)]
        try:
            together, warnings = _together(parts, request)
        except _ApartError as error:
            if len({path for drive in drives for path in drive.logs}) > 1:
                raise InputError(str(error)) from None
            return _as_one(request, error)
        warnings = list(dict.fromkeys([*warnings, *(text for part in parts for text in part.built.warnings)]))
        return write_joined(request, _map_of(together, request, edits), warnings, started, compiling)


class _ApartError(InputError):
    """Drives that do not overlap."""

    def __init__(self, text: str, reason: str, at_s: float) -> None:
        super().__init__(text)
        self.reason, self.at_s = reason, at_s


def _as_one(request: BuildRequest, apart: _ApartError) -> BuildResult:
    """Build a log whose drives after a pause could not be joined as it is, and say so: the scan may have misled."""
    result = build_map(request)
    result.warnings.append(_STAYED.format(apart.at_s, apart.reason))
    return result


def _alone(request: BuildRequest, drive: LogDrive, folder: Path) -> _Part:
    """Build the map of one drive."""
    own = replace(request, logs=drive.logs, target=folder, window_ns=drive.window_ns, edits=None, force=request.force)
    built = build_map(own)
    taught = TaughtMap.read(folder)
    return _Part(drive, taught, built, taught.trajectory, taught.cloud, built.pile)


def _together(parts: Sequence[_Part], request: BuildRequest) -> tuple[list[_Part], list[str]]:
    """Return the parts in one frame, that of the first; whichever overlaps what is there already comes next."""
    done, waiting, told = [parts[0]], list(parts[1:]), list[str]()
    known = KnownMap.read(parts[0].taught.folder.path)
    while waiting:
        added = _next(known, done, waiting, request)
        if isinstance(added, str):
            raise _apart(parts[0], waiting[0], added)
        part, found = added
        waiting = [one for one in waiting if one is not part]
        done.append(_moved(part, found, done, told))
        if waiting:
            known = _known_of(done, request)
    return done, told


def _next(
    known: KnownMap, done: Sequence[_Part], waiting: Sequence[_Part], request: BuildRequest
) -> tuple[_Part, fit.Fit] | str:
    """Return a drive that overlaps what is there and how it fits; where none does, why the first does not."""
    seen, reasons = _seen_by(done), list[str]()
    for part in waiting:
        overlap = overlap_of(known, seen, part.taught.seen, request.settings)
        if overlap.found is not None:
            return part, overlap.found
        reasons.append(overlap.reason)
    return reasons[0]


def _apart(first: _Part, other: _Part, reason: str) -> _ApartError:
    at_s = 1e-9 * (int(other.taught.trajectory.stamps_ns[0]) - int(first.taught.trajectory.stamps_ns[0]))
    text = _APART.format(other=other.drive.logs[0], first=first.drive.logs[0], reason=reason)
    return _ApartError(text, reason, at_s)


def _moved(part: _Part, found: fit.Fit, done: Sequence[_Part], told: list[str]) -> _Part:
    """Return a drive in the map's frame, its times behind those of the others where they overlap."""
    taught = part.taught
    for other in done:
        taught = taught.after(other.path)
    by_ns = int(taught.trajectory.stamps_ns[0]) - int(part.taught.trajectory.stamps_ns[0])
    taught = replace(taught, later_ns=by_ns)
    correction = found.correction._replace(times_ns=found.correction.times_ns + by_ns)
    if by_ns:
        told.append(_OVERLAP.format(name_of(part.drive.logs[0]), by_ns * 1e-9))
    if found.tied < 0.2 * found.keys:
        told.append(_HARDLY.format(name_of(part.drive.logs[0]), found.tied, found.keys))
    pile = part.pile and moved_report(part.pile, partial(motion_at, found.correction))
    path = merge.moved_trajectory(taught.trajectory, correction)
    return part._replace(
        taught=taught, path=path, cloud=merge.moved_cloud(taught.cloud, correction), pile=pile, tied=found.tied
    )


def _seen_by(parts: Sequence[_Part]) -> fit.Seen:
    views = [view for part in parts for view in part.taught.views]
    return fit.Seen(views, np.vstack([merge.view_poses(part.path, part.taught.views) for part in parts]))


def _topology_seen(parts: Sequence[_Part], machine: Machine | None) -> Seen:
    """Return what all drives saw, as that of one drive."""
    seen, paths = _seen_by(parts), [path_of(part.path) for part in parts]
    said = [
        name
        for part, (_, times_ns) in zip(parts, paths, strict=True)
        for name in said_at([(at_ns + part.taught.later_ns, name) for at_ns, name in part.built.said], times_ns)
    ]
    path, times = np.vstack([one for one, _ in paths]), np.concatenate([times_ns for _, times_ns in paths])
    return Seen(seen.views, seen.poses, path, times, said, machine)


def _known_of(parts: Sequence[_Part], request: BuildRequest) -> KnownMap:
    """Return the map of some drives as the search wants it."""
    topology, landmarks = _mapped(_topology_seen(parts, request.machine), request, NO_EDITS)
    return KnownMap(topology.map, landmarks, topology.sheets)


def _mapped(seen: Seen, request: BuildRequest, edits: TopologyEdits) -> tuple[Topology, Landmarks]:
    topology = topology_of(seen, request.settings.topology, edits)
    return topology, landmarks_for(topology.map, seen, request.settings.landmarks)


def _map_of(parts: Sequence[_Part], request: BuildRequest, edits: TopologyEdits) -> Joined:
    """Return all that the map folder holds."""
    seen = _topology_seen(parts, request.machine)
    topology, landmarks = _mapped(seen, request, edits)
    whole = with_stretches(topology.map, landmarks, request.settings.landmarks)
    piles = [middle for part in parts if part.pile is not None for middle in part.pile.middles_m()]
    trajectory, cloud = parts[0].path, parts[0].cloud
    for part in parts[1:]:
        trajectory = joined(trajectory, part.path)
        cloud = merge.joined_clouds(cloud, part.cloud, np.zeros((0, 2)), seen.path)
    return Joined(
        folders=[(part.taught.folder, part.taught.later_ns) for part in parts],
        logs=[path for part in parts for path in part.drive.logs],
        built=[part.built for part in parts],
        trajectory=trajectory,
        views=list(seen.views),
        topology=topology._replace(map=with_piles(whole, piles)),
        landmarks=landmarks,
        cloud=cloud,
        pile=_pile(parts),
        tied=[part.tied for part in parts[1:]],
    )


def _pile(parts: Sequence[_Part]) -> PileReport | None:
    """Return the newest pile that was found, else what the first drive says of none."""
    order = sorted(parts, key=lambda part: -int(part.path.stamps_ns[-1]))
    found = [part.pile for part in order if part.pile is not None and part.pile.estimate.status not in (None, "none")]
    return found[0] if found else parts[0].pile

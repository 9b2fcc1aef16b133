"""`build-map` as a function: logs in, map folder out. Reads once, keeps what is finished when interrupted."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeVar

from lhdmap.config import Settings, settings_table
from lhdmap.errors import InputError, LhdmapWarning
from lhdmap.integration.cloud_io import write_cloud
from lhdmap.landmarks.store import write_landmarks
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.mapfolder import Diagnostics, MapFolderWriter
from lhdmap.messages import Message
from lhdmap.movement.costs import connection_times
from lhdmap.outputs import free_folder
from lhdmap.pile.result import PileReport
from lhdmap.pipeline.beside import HelperDied, Here, ProcessBeside
from lhdmap.pipeline.cost import CompileClock, Spent, cost, peak_memory_mib
from lhdmap.pipeline.driven import odometry_of, ways_of
from lhdmap.pipeline.given import GROUND_TRUTH, given_rows
from lhdmap.pipeline.inputs import ROLES_READ, Inputs
from lhdmap.pipeline.inspection import Inspection, Inspector, PileBeside
from lhdmap.pipeline.interruption import Interruption
from lhdmap.pipeline.live_view import LiveView
from lhdmap.pipeline.mapping import MappingOptions, MappingPipeline
from lhdmap.pipeline.mounts import machine_of
from lhdmap.pipeline.outcome import MapOutcome
from lhdmap.pipeline.refusal import require_a_map
from lhdmap.pipeline.stream import Stream
from lhdmap.provenance import file_entry, source_entry
from lhdmap.report.page import fill_in_cost
from lhdmap.report.recording_settings import Thinning
from lhdmap.runfolder import RunInfo
from lhdmap.topology.edits import load_edits
from lhdmap.topology.geojson import to_geojson
from lhdmap.topology.sheet import write_sheets
from lhdmap.topology.views_file import write_views
from lhdmap.trajectory import Trajectory

_ASKED = "interrupted: what was read so far is being written; Ctrl-C once more ends at once"
_BESIDE_FROM_S = 60.0  # a process takes most of a second to start
_Stamped = TypeVar("_Stamped", Trajectory, Diagnostics)
Progress = Callable[[Iterable[tuple[str, Message]], float], Iterable[tuple[str, Message]]]


@dataclass(frozen=True, slots=True)
class BuildRequest:
    """What is to be built: logs, the folder to make, settings, topics by role, the machine, how to show progress.

    `poses`: given poses for the cloud and the final trajectory (`given.given_rows`); empty: the odometry's.
    `helper`: whether a second process may look for the pile, record and report; what comes out is the same.
    `edits`: TOML file with a user's changes of the topology.
    `force`: replace a map folder that is there, and try a log that the survey calls unusable. `recorded_as`: names of logs in
    `map.json`, where they are moved later. `window_ns`: only what was logged between these times. `stream`: the log is still
    being written; it must be complete when the messages end.
    """

    logs: Sequence[Path]
    target: Path
    settings: Settings = field(default_factory=Settings)
    topics: Mapping[str, str] = field(default_factory=dict)
    machine: Machine | None = None
    progress: Progress | None = None
    poses: str = ""
    helper: bool = False
    force: bool = False
    edits: Path | None = None
    recorded_as: Mapping[Path, Path] = field(default_factory=dict)
    window_ns: tuple[int, int] | None = None
    stream: Stream | None = None

    @property
    def inputs(self) -> Inputs:
        """What the map is made of."""
        name = self.target.name
        edits = load_edits(self.edits)
        return Inputs(self.logs, self.settings, self.topics, name, self.poses, self.force, edits, self.window_ns)


@dataclass(frozen=True, slots=True)
class BuildResult:
    """What came of it: the folder, the figures of `build-map --json`, the final trajectory.

    `said`: when the operator began to name a node, and the name; `pile`: what was looked for and found.
    """

    folder: Path
    summary: dict[str, Any]
    warnings: list[str]
    trajectory: Trajectory
    said: Sequence[tuple[int, str]] = ()
    pile: PileReport | None = None


def build_map(request: BuildRequest) -> BuildResult:
    """Read the logs, run the pipeline, write the map folder.

    Raises:
        UsageError: the folder is there already.
        InputError: a log cannot be used, or holds no scan.
        KeyboardInterrupt: Ctrl-C was pressed; what was finished is kept in the partial folder.
    """
    started, compiling = time.monotonic(), CompileClock()
    free_folder(request.target, force=request.force, inputs=request.logs)
    inputs = request.inputs  # edits are read here: a mistake in them is told before the log is read
    given = given_rows(request.poses, request.logs, request.topics) if request.poses else None
    with (
        compiling,
        _source(request) as source,
        MapFolderWriter(request.target, force=request.force, inputs=request.logs) as folder,
    ):
        pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix="hash")
        hashes = {} if request.stream else _hash_in_background(pool, request.logs)
        interruption = Interruption()
        with pool, _inspector(request, source, folder.path) as inspector, interruption.comes_first():
            primary: Literal["front", "points"] = "front" if "front" in source.roles else "points"
            view = LiveView(inspector) if request.stream and request.stream.live_port is not None else None
            pipeline = MappingPipeline(
                request.settings,
                machine_of(source, request.machine),
                MappingOptions(
                    primary,
                    on_sweep=_sweep_sink(inspector, request.settings.recording.scan_interval_s),
                    pile=PileBeside(inspector),
                    on_step=None if view is None else view.take,
                ),
            )
            if view is not None:
                view.pipeline = pipeline
            with pipeline:
                _run(pipeline, source, request, interruption)
            hashes = hashes or _hash_in_background(pool, request.logs)
            as_recorded = partial(source.recorded_ns, primary)
            # An interruption of what follows must not lose it.
            folder.write_odometry(_stamped(odometry_of(pipeline), as_recorded))
            folder.write_diagnostics(_stamped(pipeline.records.diagnostics(), as_recorded))
            ways = ways_of(pipeline, given)
            if given is None and not interruption.asked:
                require_a_map(source.paths[0], pipeline.records, ways.rows)
            final = _stamped(ways.final, as_recorded)
            folder.write_trajectory(final)
            outcome = MapOutcome(inputs, source, pipeline, ways)
            outcome.warnings = renamed(outcome.warnings, request.recorded_as)
            beside = _write(folder, request, source, outcome, inspector)
        known = {path: _entry(request, path, future) for path, future in hashes.items()}
        own = Spent(peak_memory_mib(), compiling.seconds)
        figures = outcome.summary | cost(started, outcome.duration_s, own, beside)  # one for page, map.json and screen
        fill_in_cost(folder.path / "report.html", figures)
        info = RunInfo(request.logs, options_of(request), figures, outcome.warnings, frames_of(request))
        path = folder.complete(info, known)
    said, pile = pipeline.evidence.said, outcome.pile
    return BuildResult(path, figures | {"map": str(path)}, outcome.warnings, final, said, pile)


def _stamped(rows: _Stamped, stamps_of: Callable[[Any], Any]) -> _Stamped:
    """Return poses or diagnostics under the stamps that their scans have in the log."""
    if isinstance(rows, Trajectory):
        return rows._replace(stamps_ns=stamps_of(rows.stamps_ns))
    return rows._replace(stamp_ns=stamps_of(rows.stamp_ns))


def _source(request: BuildRequest) -> LogSource:
    growing = None if request.stream is None else request.stream.opened
    return LogSource(
        list(request.logs), request.topics, force=request.force, window_ns=request.window_ns, growing=growing
    )


def _run(pipeline: MappingPipeline, source: LogSource, request: BuildRequest, interruption: Interruption) -> None:
    """Send all messages through the stages, until Ctrl-C: the stages then finish with what they have."""
    messages: Iterable[tuple[str, Message]] = source.messages([role for role in ROLES_READ if role in source.roles])
    if request.progress is not None:
        messages = request.progress(messages, source.duration_s)
    if request.stream is not None:
        messages = request.stream.through(source, messages, pipeline)
    with interruption:
        for role, message in messages:
            pipeline.update(role, message)
            if interruption.asked:
                break
    if interruption.asked and len(pipeline.track):
        warnings.warn(_ASKED, LhdmapWarning, stacklevel=2)
    pipeline.finish()
    if not len(pipeline.track):
        damage = f" ({source.damage[0]})" if source.damage else ""
        raise InputError(f"{source.paths[0]}: no usable scan in it{damage}; lhdmap doctor tells what is wrong")


def _write(
    folder: MapFolderWriter, request: BuildRequest, source: LogSource, outcome: MapOutcome, inspector: Inspector
) -> Spent:
    """Write the rest of the map but `map.json`; return what a process beside this one needed."""
    shown = outcome.report(), outcome.pipeline.machine or Machine(bodies={})
    inspector.tell(Inspection.write, *shown)
    write_cloud(folder.path / "cloud.ply", outcome.cloud)
    folder.finished(folder.path / "cloud.ply")
    if outcome.pile is not None:
        folder.write_json("pile.json", outcome.pile.to_json())
    if evidence := outcome.pipeline.evidence.smoother.evidence:
        folder.write_json("closures.json", {"closures": [one.to_json() for one in evidence]})
    if outcome.topology is not None:
        times_s = connection_times(outcome.topology.map, request.settings.movement)
        folder.write_json("topology.geojson", to_geojson(outcome.topology.map, times_s))
        folder.finished(write_sheets(folder.path / "free_space.npz", outcome.topology.sheets))
        if outcome.landmarks is not None:
            write_landmarks(folder.path / "landmarks.npz", outcome.landmarks)
            folder.finished(folder.path / "landmarks.npz")
        folder.finished(write_views(folder.path / "views.npz", list(outcome.pipeline.evidence.views)))
    try:
        spent = inspector.ask(Inspection.spent)
    except HelperDied as error:
        outcome.warnings.append(f"{error}; the recording has no scans in it")
        with _inspection(Here, request, source, folder.path) as here:
            here.ask(Inspection.write, *shown)
        return Spent()
    return spent if isinstance(inspector, ProcessBeside) else Spent()


def _inspector(request: BuildRequest, source: LogSource, folder: Path) -> Inspector:
    """Return where the inspection happens: beside this process where that is wanted and pays."""
    pays = source.duration_s >= _BESIDE_FROM_S or request.stream is not None
    beside = request.helper and pays and _cores() > 1
    return _inspection(ProcessBeside if beside else Here, request, source, folder)


def _inspection(make: Callable[..., Inspector], request: BuildRequest, source: LogSource, folder: Path) -> Inspector:
    port = None if request.stream is None else request.stream.live_port
    return make(Inspection, folder, request.target.name, source.start_ns or 0, request.settings, port)


def _cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _sweep_sink(inspector: Inspector, interval_s: float) -> Callable[[str, int, Any], None]:
    thinning = Thinning(interval_s)

    def take(role: str, stamp_ns: int, points_map: Any) -> None:
        if thinning.take(stamp_ns, role):
            inspector.tell(Inspection.record, stamp_ns, points_map.copy(), role)

    return take


def _hash_in_background(pool: ThreadPoolExecutor, logs: Sequence[Path]) -> dict[Path, Future[dict[str, Any]]]:
    return {path: pool.submit(source_entry, path) for path in logs}


def _entry(request: BuildRequest, path: Path, entry: Future[dict[str, Any]]) -> dict[str, Any]:
    return entry.result() | {"path": str(request.recorded_as.get(path, path))}


def renamed(texts: Iterable[str], names: Mapping[Path, Path]) -> list[str]:
    """Return texts with the names that logs will have once they are moved."""
    texts = list(texts)
    for old, new in names.items():
        texts = [text.replace(str(old), str(new)) for text in texts]
    return texts


def options_of(request: BuildRequest) -> dict[str, Any]:
    """Return the settings, and what else the request says of how the map was made."""
    poses = Path(request.poses) if request.poses and request.poses != GROUND_TRUTH else None
    return {
        **settings_table(request.settings),
        "request": {
            "poses": request.poses or None,
            "poses_file": None if poses is None else file_entry(poses),
            "topics": dict(request.topics),
            "edits": None if request.edits is None else file_entry(request.edits),
            "machine": None if request.machine is None else request.machine.name,
        },
    }


def frames_of(request: BuildRequest) -> dict[str, str]:
    """Return what is to be said of the frames beside what holds for each map."""
    return {"map": "that of the given poses"} if request.poses else {}

"""The run folder of a grizzly: `journal.jsonl`, `run.mcap`, `verdict.json`, page and recording."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, cast

import numpy as np

from lhdmap import __version__
from lhdmap.config import Settings
from lhdmap.errors import InputError, UsageError
from lhdmap.json_files import read_json
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import Joints, PointCloud
from lhdmap.pipeline.interruption import Interruption
from lhdmap.replay.grizzly_run import GrizzlyRun
from lhdmap.replay.journal import Journal
from lhdmap.replay.run import (
    JOURNAL,
    KIND,
    LOG,
    RECORDING,
    REPORT,
    VERDICT,
    ReplayRequest,
    ReplayResult,
    run_info,
)
from lhdmap.replay.scenario import Scenario, scenario_toml
from lhdmap.report.grizzly_page import write_grizzly_report
from lhdmap.report.grizzly_recording import write_grizzly_recording
from lhdmap.rockbreaker.machine import JOINTS, load_rockbreaker
from lhdmap.rockbreaker.station import Station
from lhdmap.rockbreaker.story import Story
from lhdmap.rockbreaker.timing import Timing
from lhdmap.runfolder import RunFolderWriter
from lhdmap.simulation.grizzly_world import GrizzlyWorld
from lhdmap.simulation.history import SECOND_NS, START_NS

TOPICS = {"cloud": "/lidar/points", "joints": "/machine/joints"}
_EVERY = 2  # of the rows of the story, which are 20 a second


def replay_grizzly(request: ReplayRequest) -> ReplayResult:
    """Run a scenario of a grizzly and write its folder.

    Raises:
        UsageError: the folder is there already, it is to be followed live, or there is no room for so many rocks.
        InputError: machine or pile cannot be read.
        KeyboardInterrupt: Ctrl-C was pressed; what was finished is kept in the partial folder.
    """
    if request.live_port is not None:
        raise UsageError("a grizzly is not followed live: run it without --view, then lhdmap view RUN")
    interruption = Interruption()
    with RunFolderWriter(KIND, request.target, force=request.force, inputs=request.sources) as folder:
        run, journal = _made(request.scenario, request.settings or Settings(), folder.path / JOURNAL)
        with interruption.comes_first():
            began = time.monotonic()
            with interruption:
                _go(run, journal, interruption, request)
            journal.close()
            verdict = run.verdict(run.now_s / max(time.monotonic() - began, 1e-6))
            _write(folder, request, verdict, run)
        path = folder.complete(run_info(request, verdict))
    return ReplayResult(path, verdict)


def _made(scenario: Scenario, settings: Settings, journal_path: Path) -> tuple[GrizzlyRun, Journal]:
    """Return the run with world and station."""
    machine = load_rockbreaker(Path(scenario.machine) if scenario.machine else None)
    given, opening_m = scenario.grizzly, machine.grizzly.opening_m
    sizes_m = [size for size in _boulders_m(given.pile) if size > opening_m] if given.pile else []
    world = GrizzlyWorld(machine, scenario.seed, scenario.rocks, sizes_m)
    station = Station(
        machine,
        settings.rockbreaker,
        cast("Timing", given.timing),
        margin_m=given.margin_m,
        most_blows=given.most_blows,
    )
    journal = Journal(journal_path)
    told = {"kind": scenario.kind, "rocks": len(world.oversize), "from_pile": len(sizes_m), "seed": scenario.seed}
    journal.write("engine", "started", values=told)
    return GrizzlyRun(scenario, world, station, journal), journal


def _boulders_m(name: str) -> list[float]:
    """Return the sizes of the boulders that a `pile.json`, or that in a folder, lists."""
    path = Path(name) / "pile.json" if Path(name).is_dir() else Path(name)
    found = read_json(path, "the estimate of a pile", "lhdmap pile or lhdmap build-map writes it")
    try:
        return [float(one["size_m"]) for one in found["boulders"] if one["size_m"] is not None]
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: no list of boulders with size_m in it; a pile.json of lhdmap was wanted") from error


def _go(run: GrizzlyRun, journal: Journal, interruption: Interruption, request: ReplayRequest) -> None:
    def moments() -> Any:
        while not run.ended and not interruption.asked:
            run.step()
            yield journal.now_ns

    limit_s = request.scenario.limits.time_s
    for _ in moments() if request.progress is None else request.progress(moments(), limit_s):
        pass
    if not run.ended:
        run.interrupt()
    journal.write("engine", "ended", cause=run.reason)


def _write(folder: RunFolderWriter, request: ReplayRequest, verdict: dict[str, Any], run: GrizzlyRun) -> None:
    story = run.story
    folder.finished(folder.path / JOURNAL)
    with LogWriter(folder.path / LOG) as log:
        _write_log(log, story)
    folder.finished(folder.path / LOG)
    folder.write_json(VERDICT, verdict)
    if request.recording and story.rows:
        write_grizzly_recording(folder.path / RECORDING, request.name, run.machine, story)
        folder.finished(folder.path / RECORDING)
    made = {"software": f"lhdmap {__version__}", "machine": run.machine.name, "seed": str(request.scenario.seed)}
    title = f"Replay {request.name}"
    write_grizzly_report(
        folder.path / REPORT, title, verdict, run.machine, story, made | {"scenario": scenario_toml(request.scenario)}
    )
    folder.finished(folder.path / REPORT)


def _write_log(log: LogWriter, story: Story) -> None:
    """Write clouds and joints by time; the joints have the names of the machine file."""
    messages: list[tuple[int, str, Any]] = []
    for look in story.looks:
        stamp_ns = START_NS + round(look.at_s * SECOND_NS)
        none = np.zeros(0, dtype=np.float32)
        messages.append((stamp_ns, "cloud", PointCloud(stamp_ns, "base", look.points_m.astype(np.float32), none)))
    for row in story.table()[::_EVERY] if story.rows else ():
        stamp_ns = START_NS + round((story.began_s + float(row[0])) * SECOND_NS)
        angles = dict(zip(JOINTS, np.radians(row[3:7]).tolist(), strict=True))
        messages.append((stamp_ns, "joints", Joints(stamp_ns, angles, {})))
    for _, name, message in sorted(messages, key=lambda one: one[:2]):
        log.write(TOPICS[name], message)

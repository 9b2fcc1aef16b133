"""`replay`: a scenario in, a run folder out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from lhdmap import __version__
from lhdmap.config import Settings
from lhdmap.console.attendant import Attendant
from lhdmap.logs.writer import LogWriter
from lhdmap.pipeline.interruption import Interruption
from lhdmap.replay.assemble import Run, Watchers, assemble, parts_of
from lhdmap.replay.assemble_station import check_attended
from lhdmap.replay.crew_parts import FIRST
from lhdmap.replay.journal import Event, Journal, Listener
from lhdmap.replay.mission_tally import MissionTally
from lhdmap.replay.namespace import machine_of, only, role_of
from lhdmap.replay.parts import Parts
from lhdmap.replay.processes.executive import EXECUTIVE
from lhdmap.replay.processes.film import Film
from lhdmap.replay.processes.film_drive import DriveFilm
from lhdmap.replay.processes.film_load import LoadFilm
from lhdmap.replay.processes.recorder import Recorder
from lhdmap.replay.scenario import GRIZZLY, HAULAGE, Scenario, scenario_toml
from lhdmap.replay.series import Timeline
from lhdmap.replay.stops import Stops
from lhdmap.report.mission_chart import has_mission, write_mission_picture
from lhdmap.report.replay_data import ReplayData
from lhdmap.report.replay_page import write_replay_report
from lhdmap.report.replay_recording import ReplayRecording
from lhdmap.runfolder import RunFolderWriter, RunInfo
from lhdmap.simulation.history import SECOND_NS, START_NS

KIND = "replay"
LOG, JOURNAL, VERDICT, REPORT, RECORDING = "run.mcap", "journal.jsonl", "verdict.json", "report.html", "recording.rrd"
PICTURE = "mission.png"
GRIZZLY_FRAMES = {"base": "origin on the swing axis, x along the grizzly's middle, y left, z up"}
_GRACE_S = 60  # the monitor ends a run at its limit; this is for a monitor that sees nothing
Progress = Callable[[Iterable[int], float], Iterable[int]]


@dataclass(frozen=True, slots=True)
class ReplayRequest:
    """What is to be replayed, and what is to be written.

    `truth`: the true pose in the log; `recording`: a Rerun recording; `live_port`: where it can be followed meanwhile;
    `sources`: files that the run is made from; `settings`: of perception
    and control; `progress` shows the simulated times that it is given with their end (s); `attendant`: who attends the machine
    instead of the scripted station.
    """

    scenario: Scenario
    target: Path
    name: str = KIND
    truth: bool = True
    recording: bool = True
    live_port: int | None = None
    force: bool = False
    sources: Sequence[Path] = ()
    progress: Progress | None = None
    settings: Settings | None = None
    attendant: Attendant | None = None


@dataclass(frozen=True, slots=True)
class ReplayResult:
    """The folder and the verdict."""

    folder: Path
    verdict: dict[str, Any]


def replay(request: ReplayRequest, parts: Parts | None = None) -> ReplayResult:
    """Run a scenario and write its folder; `parts` are used instead of those that the scenario names.

    Raises:
        UsageError: the folder is there already, or the scenario names what is not there.
        ConfigError: a fault of the scenario has no target here.
        KeyboardInterrupt: Ctrl-C was pressed; what was finished is kept in the partial folder.
    """
    if request.attendant is not None:
        check_attended(request.scenario)
    if request.scenario.kind == GRIZZLY:
        from lhdmap.replay.grizzly_folder import replay_grizzly  # it needs what is here

        return replay_grizzly(request)
    interruption = Interruption()
    with RunFolderWriter(KIND, request.target, force=request.force, inputs=request.sources) as folder:
        made = parts_of(request.scenario, folder.path, request.settings) if parts is None else parts
        made = replace(made, attendant=request.attendant or made.attendant)
        with interruption.comes_first():
            verdict = _Replay(request, made, folder).run(interruption)
        path = folder.complete(run_info(request, verdict))
    return ReplayResult(path, verdict)


class _Replay:
    """One run with all that it writes."""

    def __init__(self, request: ReplayRequest, parts: Parts, folder: RunFolderWriter) -> None:
        self._request, self._parts, self._folder = request, parts, folder
        self._timeline, self._stops = Timeline(), Stops()
        self._recording: ReplayRecording | None = None
        self._others: dict[str, Film] = {}

    def run(self, interruption: Interruption) -> dict[str, Any]:
        """Run, write all files, return the verdict."""
        journal = Journal(self._folder.path / JOURNAL)
        journal.listeners += [_shown_of(self._timeline), only("", self._stops)]
        with ExitStack() as open_files:
            open_files.callback(journal.close)
            log = open_files.enter_context(LogWriter(self._folder.path / LOG))
            film = self._film(journal)
            spaces = [_space(name) for name in self._parts.crew] or [""]
            recorder = Recorder(log, truth=self._request.truth, machines=spaces)
            self._others = {name: Film(own.machine) for name, own in self._parts.crew.items() if _space(name)}
            run = assemble(self._request.scenario, self._parts, journal, Watchers(film, recorder, others=self._others))
            told = self._request.scenario.kind in ("mission", HAULAGE)
            missions = {name: MissionTally() for name in (self._parts.crew or (FIRST,)) if told}
            journal.listeners += [only(_space(name), one) for name, one in missions.items()]
            started = time.monotonic()
            with interruption:
                self._go(run, journal, interruption)
            simulated_s = (run.engine.now_ns - START_NS) / SECOND_NS
            factor = simulated_s / max(time.monotonic() - started, 1e-6)
        faults = [fault.told() for fault in run.faults.all]
        verdict = run.judges.verdict(run.engine.now_ns, faults, factor, journal.sha256, missions)
        self._write(verdict, film)
        return verdict

    def _film(self, journal: Journal) -> Film:
        request, machine = self._request, self._parts.machine
        if request.recording:
            path = self._folder.path / RECORDING
            self._recording = ReplayRecording(path, request.name, START_NS, machine, request.live_port)
            expected_s = self._parts.expected_s or request.scenario.limits.time_s
            self._recording.begin(self._parts.lines_m, expected_s)
        given = self._parts.autonomous
        drive = None if given is None else DriveFilm(given.known.topology)
        loads = self._parts.loading is not None or bool(request.scenario.mission)
        load = LoadFilm(machine.drive.payload_kg) if loads else None
        film = Film(machine, self._recording, live=request.live_port is not None, drive=drive, load=load)
        journal.listeners.append(film.take)
        return film

    def _go(self, run: Run, journal: Journal, interruption: Interruption) -> None:
        """Run until the monitor has seen enough, or somebody wants it to end."""
        scenario = self._request.scenario
        settings = {"kind": scenario.kind, "mine": Path(scenario.mine or scenario.site).stem, "seed": scenario.seed}
        journal.write("engine", "started", values=settings)
        for _ in self._shown(run.engine.run(START_NS + round((scenario.limits.time_s + _GRACE_S) * SECOND_NS))):
            if run.judges.ended or interruption.asked:
                break
        if interruption.asked:
            run.judges.interrupt()
        run.engine.finish()
        missed = {name: count for name, count in run.engine.missed().items() if count}
        values = {"ok": run.judges.ok, "messages": run.engine.messages, "lost": run.link.lost, "missed": missed}
        journal.write("engine", "ended", cause=run.judges.reason, values=values)

    def _shown(self, moments: Iterator[int]) -> Iterable[int]:
        request = self._request
        if request.progress is None:
            return moments
        return request.progress(moments, self._parts.expected_s or request.scenario.limits.time_s)

    def _write(self, verdict: dict[str, Any], film: Film) -> None:
        """Write what is known at the end."""
        folder = self._folder
        for name in (JOURNAL, LOG):
            folder.finished(folder.path / name)
        folder.write_json(VERDICT, verdict)
        data = self._data(verdict, film)
        if self._recording is not None:
            self._recording.close(data)
            folder.finished(folder.path / RECORDING)
        write_replay_report(folder.path / REPORT, data)
        folder.finished(folder.path / REPORT)
        if has_mission(data) and self._request.scenario.kind == "mission":
            write_mission_picture(folder.path / PICTURE, data)
            folder.finished(folder.path / PICTURE)

    def _data(self, verdict: dict[str, Any], film: Film) -> ReplayData:
        scenario = self._request.scenario
        made = {
            "software": f"lhdmap {__version__}",
            "mine": scenario.mine or scenario.site,
            "machine": self._parts.machine.name,
            "seed": str(scenario.seed),
            "speed of the run": f"{verdict['realtime_factor']:.1f} × real time",
        }
        left_out = self._timeline.left_out
        warnings = [f"{left_out} changes of state are in journal.jsonl alone: there are too many to draw"]
        rows = film.series.rows()
        drive = None if film.drive is None else film.drive.data(rows, self._parts.machine)
        return ReplayData(
            f"Replay {self._request.name}", verdict, rows, START_NS, self._timeline.changes,
            self._parts.lines_m, film.believed_m(), self._parts.goal_m, made, scenario_toml(scenario),
            warnings if left_out else (), drive, self._stops.rows(), None if film.load is None else film.load.data(),
            {name: one.series.rows() for name, one in self._others.items()},
        )  # fmt: skip


def _shown_of(timeline: Timeline) -> Listener:
    """Return a listener that is told of the first machine's events, and of the missions of the others."""

    def listen(event: Event) -> None:
        if not machine_of(event.process) or role_of(event.process) == EXECUTIVE:
            timeline(event)

    return listen


def _space(name: str) -> str:
    """Return the namespace of a machine: the first one has the contract's topics."""
    return "" if name == FIRST else name


def run_info(request: ReplayRequest, verdict: dict[str, Any]) -> RunInfo:
    """Return what `run.json` says of a run."""
    counts = {key: value for key, value in verdict.items() if key not in ("contacts", "faults")}
    counts |= {"contacts": len(verdict["contacts"]), "faults": len(verdict["faults"])}
    asked = {"name": request.name, "truth": request.truth, "recording": request.recording}
    frames = GRIZZLY_FRAMES if request.scenario.kind == GRIZZLY else {"map": "the mine's own grid"}
    options = {
        "scenario": asdict(request.scenario),
        "settings": asdict(request.settings or Settings()),
        "request": asked,
    }
    return RunInfo(request.sources, options, counts, (), frames)

"""The demo: a sample drive, its map from the log alone, that against the truth; then a mine is taught, and a machine works in it.

The sample drive is one that is hard to map: bends, a decline, a late inclinometer. The mine is the smallest with a draw point and
a dump: an operator drives through it, its map is built, and on this map the machine loads, hauls and dumps one bucket by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from lhdmap.config import Settings, settings_table
from lhdmap.evaluation.trajectory import TrajectoryEvaluation, evaluate_trajectory
from lhdmap.machine import load_machine
from lhdmap.mine.make_network import make_network
from lhdmap.mine.plan import find_plan, load_plan
from lhdmap.pipeline.build import BuildRequest, BuildResult, Progress, build_map
from lhdmap.replay.assemble import parts_of
from lhdmap.replay.run import PICTURE, ReplayRequest, ReplayResult, replay
from lhdmap.replay.run import Progress as ReplayProgress
from lhdmap.replay.scenario import find_scenario
from lhdmap.replay.scenario import load_scenario as load_replay
from lhdmap.replay.teaching import teach
from lhdmap.resources import resource
from lhdmap.runfolder import RunFolderWriter, RunInfo
from lhdmap.simulation.drive import Progress as SimulationProgress
from lhdmap.simulation.drive import SimulatedDrive, simulate_drift
from lhdmap.simulation.scenario import load_scenario

SCENARIO, CYCLE = "datasets/demo_drift.toml", "demo_cycle"
MINE_MAP = "mine_map"


@dataclass(frozen=True, slots=True)
class Watcher:
    """Who is told how far the demo is: `say(text)` at each step, and a wrapper of each stream; all may be absent."""

    say: Callable[[str], None] | None = None
    simulate: SimulationProgress | None = None
    build: Progress | None = None
    replay: ReplayProgress | None = None


@dataclass(frozen=True, slots=True)
class Demo:
    """What the demo made: its folder, the drive in it, the drive's map, how far that is from the truth, the run of one cycle."""

    folder: Path
    drive: SimulatedDrive
    built: BuildResult
    evaluation: TrajectoryEvaluation
    evaluation_file: Path
    plot_file: Path
    cycle: ReplayResult

    @property
    def picture(self) -> Path:
        """The picture of the cycle."""
        return self.cycle.folder / PICTURE


def run_demo(
    target: Path, settings: Settings | None = None, watcher: Watcher | None = None, *, force: bool = False
) -> Demo:
    """Make the folder `target` with the drive, its map and its evaluation; with `force` over an earlier one, at the end.

    Raises:
        UsageError: the folder is there already.
        InputError: it cannot be made.
    """
    watcher, settings = watcher or Watcher(), settings or Settings()
    with RunFolderWriter("demo", target, force=force) as folder:
        demo = _demo(folder, settings, watcher)
        within = {"log": demo.drive.log.name, "map": demo.built.folder.name}
        return _moved(demo, folder.complete(RunInfo(options=settings_table(settings), more=within)))


def _demo(folder: RunFolderWriter, settings: Settings, watcher: Watcher) -> Demo:
    """Run the steps in the folder that grows."""
    from lhdmap.report.evaluation_plot import plot_evaluation

    say, path = watcher.say or _silent, folder.path
    scenario = load_scenario(resource(SCENARIO))
    say(f"1/5 simulate: {scenario.drive.distance_m:g} m of drift at {scenario.drive.speed_kmh:g} km/h, 2 scanners")
    drive = simulate_drift(scenario, path / "drive.mcap", progress=watcher.simulate)
    folder.finished(drive.log)
    say("2/5 build-map: from the log alone, its ground truth is not read")
    known_as = {drive.log: folder.target / drive.log.name}
    request = BuildRequest([drive.log], path / "drive_map", settings, progress=watcher.build, recorded_as=known_as)
    built = build_map(request)
    say("3/5 eval: the map's trajectory against the truth of the simulation")
    evaluation = evaluate_trajectory(built.trajectory, drive.truth)
    evaluation_file, plot_file = folder.write_json("evaluation.json", evaluation.to_json()), path / "evaluation.png"
    plot_evaluation(evaluation, plot_file)
    cycle = _cycle(folder, settings, watcher)
    return Demo(path, drive, built, evaluation, evaluation_file, plot_file, cycle)


def _cycle(folder: RunFolderWriter, settings: Settings, watcher: Watcher) -> ReplayResult:
    """Teach the mine, and let the machine haul one bucket on the map that came of it."""
    say, path = watcher.say or _silent, find_scenario(CYCLE)
    scenario = load_replay(path)
    say("4/5 teach: an operator drives through a small mine and says the names; its map is built of that log")
    network, machine = make_network(load_plan(find_plan(scenario.mine))), load_machine()
    teach(scenario, network, machine, folder.path / MINE_MAP, settings)
    say("5/5 replay: on this map the machine loads, hauls and dumps a bucket by itself, and drives home")
    parts = parts_of(replace(scenario, map=str(folder.path / MINE_MAP)), folder.path, settings)
    told = replace(scenario, map=str(folder.target / MINE_MAP))  # where it is once the folder is complete
    request = ReplayRequest(
        told, folder.path / "cycle", CYCLE, sources=[path], progress=watcher.replay, settings=settings
    )
    return replay(request, parts)


def _moved(demo: Demo, folder: Path) -> Demo:
    """Return the demo with its files in the folder that it has come to."""
    drive, built = demo.drive, demo.built
    log, truth, scenario = (folder / path.name for path in (drive.log, drive.truth_file, drive.scenario_file))
    target = folder / built.folder.name
    return Demo(
        folder,
        replace(drive, log=log, truth_file=truth, scenario_file=scenario),
        replace(built, folder=target, summary=built.summary | {"map": str(target)}),
        demo.evaluation,
        folder / demo.evaluation_file.name,
        folder / demo.plot_file.name,
        replace(demo.cycle, folder=folder / demo.cycle.folder.name),
    )


def _silent(text: str) -> None:
    """Say nothing."""

"""The sample drive from end to end: simulate it, build its map from the log alone, compare that with the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from lhdmap.config import Settings, settings_table
from lhdmap.evaluation.trajectory import TrajectoryEvaluation, evaluate_trajectory
from lhdmap.pipeline.build import BuildRequest, BuildResult, Progress, build_map
from lhdmap.resources import resource
from lhdmap.runfolder import RunFolderWriter, RunInfo
from lhdmap.simulation.drive import Progress as SimulationProgress
from lhdmap.simulation.drive import SimulatedDrive, simulate_drift
from lhdmap.simulation.scenario import load_scenario

SCENARIO = "datasets/demo_drift.toml"


@dataclass(frozen=True, slots=True)
class Watcher:
    """Who is told how far the demo is: `say(text)` at each step, and a wrapper of each stream; all may be absent."""

    say: Callable[[str], None] | None = None
    simulate: SimulationProgress | None = None
    build: Progress | None = None


@dataclass(frozen=True, slots=True)
class Demo:
    """What the demo made: its folder, the drive in it, the map of the drive, how far the map is from the truth."""

    folder: Path
    drive: SimulatedDrive
    built: BuildResult
    evaluation: TrajectoryEvaluation
    evaluation_file: Path
    plot_file: Path


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
    """Run the three steps in the folder that grows."""
    from lhdmap.report.evaluation_plot import plot_evaluation

    say, path = watcher.say or _silent, folder.path
    scenario = load_scenario(resource(SCENARIO))
    say(f"1/3 simulate: {scenario.drive.distance_m:g} m of drift at {scenario.drive.speed_kmh:g} km/h, 2 scanners")
    drive = simulate_drift(scenario, path / "drive.mcap", progress=watcher.simulate)
    folder.finished(drive.log)
    say("2/3 build-map: from the log alone, its ground truth is not read")
    known_as = {drive.log: folder.target / drive.log.name}
    request = BuildRequest([drive.log], path / "drive_map", settings, progress=watcher.build, recorded_as=known_as)
    built = build_map(request)
    say("3/3 eval: the map's trajectory against the truth of the simulation")
    evaluation = evaluate_trajectory(built.trajectory, drive.truth)
    evaluation_file, plot_file = folder.write_json("evaluation.json", evaluation.to_json()), path / "evaluation.png"
    plot_evaluation(evaluation, plot_file)
    return Demo(path, drive, built, evaluation, evaluation_file, plot_file)


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
    )


def _silent(text: str) -> None:
    """Say nothing."""

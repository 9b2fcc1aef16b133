"""The sample drive from end to end: simulate it, build its map from the log alone, compare that with the truth."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lhdmap.config import Settings
from lhdmap.errors import InputError
from lhdmap.evaluation.trajectory import TrajectoryEvaluation, evaluate_trajectory
from lhdmap.pipeline.build import BuildRequest, BuildResult, Progress, build_map
from lhdmap.resources import resource
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


def run_demo(target: Path, settings: Settings | None = None, watcher: Watcher | None = None) -> Demo:
    """Make the folder `target` (or `target-2`, … where that is taken) with the drive, its map and its evaluation.

    Raises:
        InputError: the folder cannot be made.
    """
    from lhdmap.report.evaluation_plot import plot_evaluation

    watcher = watcher or Watcher()
    say = watcher.say or _silent
    folder = new_folder(target)
    scenario = load_scenario(resource(SCENARIO))
    say(f"1/3 simulate: {scenario.drive.distance_m:g} m of drift at {scenario.drive.speed_kmh:g} km/h, 2 scanners")
    drive = simulate_drift(scenario, folder / "drive.mcap", progress=watcher.simulate)
    say("2/3 build-map: from the log alone, its ground truth is not read")
    request = BuildRequest([drive.log], folder / "drive_map", settings or Settings(), progress=watcher.build)
    built = build_map(request)
    say("3/3 eval: the map's trajectory against the truth of the simulation")
    evaluation = evaluate_trajectory(built.trajectory, drive.truth)
    evaluation_file, plot_file = folder / "evaluation.json", folder / "evaluation.png"
    evaluation_file.write_text(json.dumps(evaluation.to_json(), indent=2) + "\n", encoding="utf-8")
    plot_evaluation(evaluation, plot_file)
    return Demo(folder, drive, built, evaluation, evaluation_file, plot_file)


def _silent(text: str) -> None:
    """Say nothing."""


def new_folder(target: Path) -> Path:
    """Make the folder `target`, or `target-2`, `target-3`, … where that name is taken; return it.

    Raises:
        InputError: it cannot be made.
    """
    for path in itertools.chain([target], (target.with_name(f"{target.name}-{n}") for n in itertools.count(2))):
        try:
            path.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise InputError(f"{path}: the output folder cannot be made: {error.strerror}") from error
        return path
    raise AssertionError("the numbers do not end")

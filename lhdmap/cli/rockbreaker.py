"""`lhdmap rockbreaker plan|workspace`: trajectories of a rockbreaker over its grizzly, and where its tip can be."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_common, add_output, add_settings
from lhdmap.cli.rockbreaker_text import plan_text, workspace_text
from lhdmap.errors import EvaluationShortfall, UsageError

if TYPE_CHECKING:
    from lhdmap.messages import FloatArray
    from lhdmap.rockbreaker.collision import Obstacles
    from lhdmap.rockbreaker.machine import Rockbreaker
    from lhdmap.rockbreaker.plan import Planner, Request, Trajectory
    from lhdmap.rockbreaker.rocks import Scene
    from lhdmap.rockbreaker.settings import RockbreakerSettings
    from lhdmap.runfolder import RunFolderWriter

TASKS = {
    "plan": "a trajectory between two tips, or from the cloud of a grizzly to above its largest oversize rock",
    "workspace": "where the tip can be, and which orientations it allows at a point",
}
MINUS = "A point that begins with a minus is given with an equals sign: --to=-0.5,2,-1."
CLOUDS = (".ply", ".pcd", ".laz", ".las")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of both tasks."""
    tasks = parser.add_subparsers(dest="task", metavar="TASK", title="tasks", required=True)
    for name, summary in TASKS.items():
        sub = tasks.add_parser(name, help=summary, description=summary[0].upper() + summary[1:] + ".", epilog=MINUS)
        sub.add_argument("--machine", type=Path, metavar="FILE.toml", help="the machine (default: the paper's Table 1)")
        add_output(sub, f"folder to make (default: rockbreaker_{name} here)")
        sub.add_argument(
            "--no-pictures", action="store_true", help="no report and no recording: the figures and the table only"
        )
        (_add_plan if name == "plan" else _add_workspace)(sub)
        add_common(sub, again=True)


def _add_plan(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--from", dest="start", metavar="X,Y,Z", help="tip at the start, m (default: base.park_m of the machine)"
    )
    parser.add_argument(
        "--from-cylinders", metavar="R1,R2,R3,R4", help="instead: measured cylinder lengths ρ1 to ρ4, m"
    )
    parser.add_argument("--to", dest="end", metavar="X,Y,Z", help="tip at the end, m")
    parser.add_argument(
        "--cloud",
        type=Path,
        metavar="CLOUD",
        help="instead of --to: a cloud of the grizzly with its rocks",
    )
    parser.add_argument(
        "--path", default="dsjm", choices=("dsjm", "cslm"), help="decoupled swing (default), or straight line"
    )
    parser.add_argument(
        "--timing", default="paper", choices=("paper", "paper-best", "smooth", "limit"), help="profile (default: paper)"
    )
    parser.add_argument("--phi-from", type=float, metavar="DEG", help="orientation at the start (default: Section 3.1)")
    parser.add_argument("--phi-to", type=float, metavar="DEG", help="orientation at the end (default: Section 3.1)")
    parser.add_argument(
        "--obstacles",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="boxes (.toml) or a cloud not to touch; repeatable",
    )
    add_settings(parser, ["rockbreaker"])


def _add_workspace(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--at", metavar="X,Y,Z", help="a tip, m: which orientations it allows")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Plan, or print the workspace; exit code 1 for a request that is not feasible."""
    from lhdmap.rockbreaker.machine import load_rockbreaker

    machine = load_rockbreaker(arguments.machine)
    if arguments.task == "workspace":
        return _run_workspace(arguments, console, machine)
    return _run_plan(arguments, console, machine)


@dataclass(frozen=True, slots=True)
class PlanOutcome:
    """What was planned: the values of `--json`, the trajectories of all steps, and the scene of a cloud."""

    values: dict[str, Any]
    trajectories: tuple[Trajectory, ...]
    scene: Scene | None
    obstacles: Obstacles


def _run_plan(arguments: argparse.Namespace, console: Console, machine: Rockbreaker) -> int:
    from lhdmap.config import load_settings
    from lhdmap.runfolder import RunFolderWriter

    settings = load_settings(arguments.config, arguments.set)
    sources = _sources(arguments)
    with RunFolderWriter("plan", _target(arguments), force=arguments.force, inputs=sources) as folder:
        outcome = _plan(arguments, machine, settings.rockbreaker)
        values = _write(folder, arguments, settings, outcome)
    failure = None if values["feasible"] else EvaluationShortfall(f"not feasible: {values['reason']['text']}")
    console.result(values, plan_text(values), failure=failure)
    return 0 if failure is None else failure.exit_code


def _target(arguments: argparse.Namespace) -> Path:
    return Path(arguments.output or f"rockbreaker_{arguments.task}").absolute()


def _sources(arguments: argparse.Namespace) -> list[Path]:
    paths = (arguments.machine, arguments.config, arguments.cloud, *arguments.obstacles)
    return [path for path in paths if path]


def _plan(arguments: argparse.Namespace, machine: Rockbreaker, settings: RockbreakerSettings) -> PlanOutcome:
    from lhdmap.rockbreaker.outcome import plan_json
    from lhdmap.rockbreaker.plan import Planner, start_joints

    if (arguments.end is None) == (arguments.cloud is None):
        raise UsageError("one of --to and --cloud is needed: where the tip is to go, or the cloud to find a rock in")
    request = _request(arguments, machine)
    obstacles, cloud_m = _obstacles(arguments, machine, start_joints(machine, request))
    planner = Planner(machine, settings, obstacles)
    planner.warm_up(request)
    if cloud_m is not None:
        return _plan_to_rock(planner, request, cloud_m)
    plan = planner.plan(request)
    trajectories = () if plan.trajectory is None else (plan.trajectory,)
    return PlanOutcome(plan_json(plan), trajectories, None, obstacles)


def _plan_to_rock(planner: Planner, request: Request, cloud_m: FloatArray) -> PlanOutcome:
    from lhdmap.rockbreaker.outcome import no_rock_json, task_json
    from lhdmap.rockbreaker.rocks import find_rocks
    from lhdmap.rockbreaker.task import plan_to_rock

    scene = find_rocks(cloud_m, planner.machine.grizzly)
    opening_m = planner.machine.grizzly.opening_m
    task = plan_to_rock(planner, scene, request, opening_m)
    if task is None:
        return PlanOutcome(no_rock_json(request, len(scene.rocks), opening_m), (), scene, planner.obstacles)
    trajectories = tuple(step.trajectory for step in task.steps if step.trajectory is not None)
    return PlanOutcome(task_json(task), trajectories, scene, planner.obstacles)


def _obstacles(
    arguments: argparse.Namespace, machine: Rockbreaker, theta: FloatArray
) -> tuple[Obstacles, FloatArray | None]:
    """Return what must not be touched, and the cloud of the grizzly (N, 3), which is part of it; `theta` (4,): the arm now."""
    import numpy as np

    from lhdmap.rockbreaker.collision import Obstacles, without_arm
    from lhdmap.rockbreaker.environment import cloud_in_base, read_boxes

    clouds = [path for path in arguments.obstacles if path.suffix.lower() in CLOUDS]
    boxes = [read_boxes(path) for path in arguments.obstacles if path not in clouds]
    points = [without_arm(machine, cloud_in_base(path, machine), theta) for path in clouds]
    grizzly_m = without_arm(machine, cloud_in_base(arguments.cloud, machine), theta) if arguments.cloud else None
    points += [grizzly_m] if grizzly_m is not None else []
    corners = [one.boxes_m for one in boxes if one.boxes_m is not None]
    return Obstacles(
        np.concatenate(corners) if corners else None,
        tuple(name for one in boxes for name in one.names),
        np.concatenate(points) if points else None,
    ), grizzly_m


def _request(arguments: argparse.Namespace, machine: Rockbreaker) -> Request:
    import numpy as np

    from lhdmap.rockbreaker.plan import Request

    start, phi_from = _start(arguments, machine)
    end = np.array(numbers(arguments.end, 3, "--to")) if arguments.end is not None else start
    phi_to = math.radians(_finite(arguments.phi_to, "--phi-to")) if arguments.phi_to is not None else math.nan
    return Request(start, end, phi_from, phi_to, arguments.path, arguments.timing)


def _start(arguments: argparse.Namespace, machine: Rockbreaker) -> tuple[FloatArray, float]:
    """Return tip (3,) and orientation at the start, NaN: by Section 3.1."""
    import numpy as np

    from lhdmap.rockbreaker.cylinders import theta_of_rho
    from lhdmap.rockbreaker.kinematics import pose_of_theta

    if arguments.from_cylinders is not None:
        if arguments.start is not None or arguments.phi_from is not None:
            raise UsageError(
                "--from-cylinders states tip and orientation at the start: leave out --from and --phi-from"
            )
        lengths = np.array([0.0, *numbers(arguments.from_cylinders, 4, "--from-cylinders")])
        pose = pose_of_theta(machine, theta_of_rho(machine, lengths))
        if np.isnan(pose).any():
            raise UsageError(
                f"--from-cylinders {arguments.from_cylinders}: the pins of the machine do not allow these lengths"
            )
        return pose[:3], float(pose[3])
    start = np.array(machine.base.park_m if arguments.start is None else numbers(arguments.start, 3, "--from"))
    return start, math.radians(
        _finite(arguments.phi_from, "--phi-from")
    ) if arguments.phi_from is not None else math.nan


def numbers(text: str, count: int, option: str) -> list[float]:
    """Return the numbers of `1,2,3`.

    Raises:
        UsageError: not as many finite numbers as wanted.
    """
    try:
        values = [_finite(float(part), option) for part in text.split(",")]
    except ValueError as error:
        raise UsageError(f"{option} {text}: {count} numbers with commas between them were wanted") from error
    if len(values) != count:
        raise UsageError(f"{option} {text}: {count} numbers were wanted, {len(values)} were found")
    return values


def _finite(value: float, option: str) -> float:
    if not math.isfinite(value):
        raise UsageError(f"{option}: a finite number was wanted, {value} was found")
    return value


def _write(
    folder: RunFolderWriter, arguments: argparse.Namespace, settings: Any, outcome: PlanOutcome
) -> dict[str, Any]:
    """Write the folder; return the values with the paths in it."""
    from lhdmap.config import settings_table
    from lhdmap.rockbreaker.table import UNITS, joined, sampled, write_table
    from lhdmap.runfolder import RunInfo

    values, target = outcome.values, _target(arguments)
    rows = None
    if values["feasible"]:
        rows = joined([sampled(one, settings.rockbreaker.table_hz) for one in outcome.trajectories])
        write_table(folder.path / "trajectory.csv", rows)
    if not arguments.no_pictures:
        _draw(folder.path, outcome, rows)
    csv = None if rows is None else "trajectory.csv"
    folder.write_json("plan.json", values | {"csv": csv, "csv_columns": UNITS})  # it may be moved: names only
    values |= {"csv": None if csv is None else str(target / csv), "folder": str(target)}
    options = {"rockbreaker": settings_table(settings)["rockbreaker"]}
    folder.complete(RunInfo(_sources(arguments), options, frames=FRAMES))
    return values


FRAMES = {"base": "origin on the swing axis, x along the grizzly's middle, y left, z up"}


def _draw(folder: Path, outcome: PlanOutcome, rows: FloatArray | None) -> None:
    from lhdmap.report.rockbreaker_page import write_plan_report
    from lhdmap.report.rockbreaker_recording import write_plan_recording

    write_plan_report(folder / "report.html", outcome.values, outcome.trajectories, rows, outcome.scene)
    if rows is not None:
        write_plan_recording(folder / "recording.rrd", outcome.trajectories, rows, outcome.scene, outcome.obstacles)


def _run_workspace(arguments: argparse.Namespace, console: Console, machine: Rockbreaker) -> int:
    import numpy as np

    from lhdmap.report.rockbreaker_page import write_workspace_report
    from lhdmap.rockbreaker.reach import workspace_json
    from lhdmap.runfolder import RunFolderWriter, RunInfo

    at_m = np.array(numbers(arguments.at, 3, "--at")) if arguments.at is not None else None
    target, sources = _target(arguments), [arguments.machine] if arguments.machine else []
    values = workspace_json(machine, at_m)
    if not arguments.no_pictures:
        with RunFolderWriter("workspace", target, force=arguments.force, inputs=sources) as folder:
            folder.write_json("workspace.json", values)
            write_workspace_report(folder.path / "report.html", machine, values, at_m)
            values["folder"] = str(folder.complete(RunInfo(sources, frames=FRAMES)))
    failure = EvaluationShortfall("the tip cannot be there") if values["reached"] is False else None
    console.result(values, workspace_text(values), failure=failure)
    return 0 if failure is None else failure.exit_code

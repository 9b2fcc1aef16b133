"""`lhdmap simulate SCENARIO`: writes a log, its truth and its scenario."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_output, suggest
from lhdmap.cli.simulate_mine import add_mine, refuse_others, run_mine
from lhdmap.cli.simulate_scenario import BUILT_IN, scanner_values, scenario_of
from lhdmap.errors import UsageError
from lhdmap.outputs import free_files
from lhdmap.settings import figure

if TYPE_CHECKING:
    from lhdmap.messages import Record
    from lhdmap.simulation.scenario import DriftScenario

FILES = ("log", "truth", "scenario", "mesh", "pile")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments; an option that is not given keeps the scenario's value."""
    suggest(
        parser.add_argument(
            "scenario",
            metavar="SCENARIO",
            help="'drift', 'pile', 'mine' (with a PLAN), 'grizzly' (a cloud, not a log), or a scenario file",
        ),
        *BUILT_IN,
        "files",
    )
    add_output(parser, "log to write (default: its name and seed in this folder, drift_seed0.mcap)", "LOG")
    parser.add_argument("--seed", type=int, help="same seed, same log to the bit (default 0)")
    parser.add_argument(
        "--mesh", type=Path, metavar="PLY", help="also write the drift's surface as a mesh, in the frame map"
    )
    suggest(
        parser.add_argument("--machine", metavar="TOML", help="machine file (default: the 11-t loader of the papers)"),
        "files",
    )
    parser.add_argument(
        "--no-truth", action="store_true", help="no /ground_truth/odometry in the log (the .truth.tum stays)"
    )
    parser.add_argument(
        "--planar", action="store_true", help="2D world: level scanners, flat floor, upright walls, no inclinometer"
    )
    add_mine(parser)
    _add_pile(parser.add_argument_group("pile: a drift that ends in one"))
    _add_drive(parser.add_argument_group("drift and drive"))
    _add_sensors(parser.add_argument_group("sensors"))


def _add_pile(group: Any) -> None:
    group.add_argument(
        "--variant", metavar="V", help="kind of scene, such as normal, stope, wall, boulder (default normal)"
    )
    group.add_argument("--flat-floor", action="store_true", help="no waves on the floor: the machine does not pitch")
    group.add_argument("--suite", type=Path, metavar="TOML", help="write all scenes of a suite into the folder -o")
    group.add_argument("--jobs", type=int, default=1, metavar="N", help="scenes of a suite at a time (default 1)")


def _add_drive(group: Any) -> None:
    group.add_argument("--length", type=float, metavar="M", help="distance to drive, m (default 100)")
    group.add_argument("--speed-kmh", type=float, metavar="V", help="tramming speed, km/h (default 12)")
    group.add_argument(
        "--roughness", metavar="R", help="walls: rough (12 cm), moderate (3 cm), smooth (5 mm), or rms in m"
    )
    group.add_argument("--mesh-size", type=float, metavar="M", help="edge length of the mesh, m (default 0.06)")
    group.add_argument(
        "--cross-drift", action="append", metavar="AT,DEG,LENGTH", help="a side opening, m, degrees (left +), m"
    )
    group.add_argument("--stop", action="append", metavar="AT,SECONDS", help="stop after this driven distance")
    group.add_argument(
        "--reverse", action="append", metavar="AT,BACK", help="reverse at this driven distance, and go on"
    )


def _add_sensors(group: Any) -> None:
    yes_or_no = argparse.BooleanOptionalAction
    group.add_argument("--beams", type=int, metavar="N", help="beams over 190°: 381 or 761 (default 381)")
    group.add_argument("--rate-hz", type=float, metavar="HZ", help="sweeps in a second (default 25)")
    group.add_argument("--noise-mm", type=float, metavar="MM", help="range noise, standard deviation (default 12)")
    group.add_argument("--max-range-m", type=float, metavar="M", help="longest range (default 80)")
    group.add_argument("--sweep", action=yes_or_no, help="each beam at its own time: sweep distortion (default: off)")
    group.add_argument("--dust", action="store_true", help="dust returns, mixed pixels at edges, drop-outs")
    group.add_argument("--rear", action=yes_or_no, help="rear scanner (default: on)")
    group.add_argument("--inclinometer", action=yes_or_no, help="inclinometer (default: on; off with --planar)")
    group.add_argument("--wheels", action=yes_or_no, help="tachometer, joints, pressures (default: on)")
    group.add_argument("--slip", action="store_true", help="the wheels slip in bursts of 2 s")
    group.add_argument(
        "--faults", type=Path, metavar="TOML", help="faults of sensors, each a [[fault]] (docs/sensors.md)"
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Simulate and write; return the exit code."""
    refuse_others(arguments)
    if arguments.scenario == "grizzly":
        return _run_grizzly(arguments, console)
    if arguments.scenario == "mine":
        return run_mine(arguments, console, scanner_values(arguments))
    from lhdmap.simulation.drive import simulate_drift

    if arguments.scenario != "pile" and (arguments.variant or arguments.flat_floor):
        raise UsageError("--variant and --flat-floor belong to 'lhdmap simulate pile'; another scenario was found")
    if arguments.suite is not None:
        return _run_suite(arguments, console)
    scenario = scenario_of(arguments)
    log = arguments.output or Path(f"{_stem(arguments, scenario)}_seed{scenario.seed}.mcap")

    def progress(records: Iterator[Record], duration_s: float) -> Iterator[Record]:
        return _shown(records, console, duration_s)

    console.note(
        f"simulating {figure(scenario.drive.distance_m)} m at {figure(scenario.drive.speed_kmh)} km/h, seed {scenario.seed}"
    )
    drive = simulate_drift(scenario, log, mesh_path=arguments.mesh, progress=progress, force=arguments.force)
    values = {
        "log": str(drive.log),
        "truth": str(drive.truth_file),
        "scenario": str(drive.scenario_file),
        "mesh": str(drive.mesh_file) if drive.mesh_file else None,
        "pile": str(drive.pile_file) if drive.pile_file else None,
        "scans": drive.scans,
        "messages": drive.messages,
        "duration_s": drive.duration_s,
        "distance_m": drive.distance_m,
    }
    files = "\n".join(f"{name:9} {values[name]}" for name in FILES if values[name])
    text = f"{files}\n{drive.distance_m:.1f} m in {drive.duration_s:.1f} s, {drive.scans} front scans"
    if drive.pile is not None:
        values |= {
            "status": drive.pile.status,
            "width_m": drive.pile.width_m,
            "inclination_deg": drive.pile.inclination_deg,
        }
        text += (
            f"\n{drive.pile.status}, width {drive.pile.width_m:.2f} m, inclination {drive.pile.inclination_deg:.1f}°"
        )
    console.result(values, text)
    return 0


def _run_grizzly(arguments: argparse.Namespace, console: Console) -> int:
    """Write the cloud of a grizzly with rocks on it, for `lhdmap rockbreaker plan --cloud`; return the exit code."""
    from lhdmap.rockbreaker.machine import load_rockbreaker
    from lhdmap.simulation.grizzly import scene_json, simulate_grizzly, truth_path, write_scene

    machine = load_rockbreaker(Path(arguments.machine) if arguments.machine else None)
    seed = arguments.seed or 0
    path = arguments.output or Path(f"grizzly-{seed}.ply")
    if seed < 0:
        raise UsageError(f"--seed {seed}: 0 or more was wanted")
    free_files([path, truth_path(path)], force=arguments.force)
    scene = simulate_grizzly(machine, seed)
    truth = write_scene(path, machine, scene, force=arguments.force)
    told = scene_json(machine, scene)
    values = {"cloud": str(path), "truth": str(truth), "points": len(scene.points_m)} | told
    large = sum(one["oversize"] for one in told["rocks"])
    text = f"cloud     {path}\ntruth     {truth}\n{len(scene.rocks)} rocks, {large} of them oversize"
    console.result(values, text)
    return 0


def _run_suite(arguments: argparse.Namespace, console: Console) -> int:
    """Write all scenes of a suite; return the exit code."""
    from lhdmap.simulation.pile_suite import load_suite, write_suite

    if arguments.scenario != "pile" or arguments.jobs < 1:
        raise UsageError(
            "--suite was found without 'pile', or with --jobs below 1: lhdmap simulate pile --suite FILE.toml -o DIR"
        )
    scenes = load_suite(arguments.suite)
    folder = arguments.output or Path(arguments.suite.stem)

    def told(name: str, done: int, of: int) -> None:
        console.note(f"{done} of {of}: {name}")

    table = write_suite(
        scenes, folder, jobs=arguments.jobs, told=told, force=arguments.force, sources=[arguments.suite]
    )
    console.result(
        {"folder": str(folder), "truth": str(table), "scenes": len(scenes)}, f"{len(scenes)} scenes: {table}"
    )
    return 0


def _stem(arguments: argparse.Namespace, scenario: DriftScenario) -> str:
    if arguments.scenario not in BUILT_IN:
        return Path(arguments.scenario).stem.removesuffix(".scenario")
    return "drift" if scenario.pile is None else f"pile_{scenario.pile.variant}"


def _shown(records: Iterator[Record], console: Console, total_s: float) -> Iterator[Record]:
    """Yield records with progress by their time in the log."""
    from lhdmap.simulation.history import START_NS

    def position(record: Record) -> float:
        return (record.log_time_ns - START_NS) * 1e-9

    return console.progress(records, total=total_s, label="simulate", position=position)

"""`lhdmap simulate mine PLAN`: an operator drives a route through a mine, or all of it, and writes the log."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lhdmap.cli.console import Console
from lhdmap.cli.options import suggest
from lhdmap.errors import UsageError
from lhdmap.settings import figure

if TYPE_CHECKING:
    from lhdmap.messages import Record
    from lhdmap.simulation.mine_drive import MineDriveSettings
    from lhdmap.simulation.sensing.sections import SensorSettings

_MINE_ONLY = ("plan", "route", "start", "wander", "names")
_DRIFT_ONLY = (
    "length",
    "roughness",
    "mesh_size",
    "cross_drift",
    "stop",
    "reverse",
    "variant",
    "flat_floor",
    "suite",
    "planar",
)


def add_mine(parser: argparse.ArgumentParser) -> None:
    """Declare what belongs to `simulate mine` alone."""
    suggest(
        parser.add_argument(
            "plan", metavar="PLAN", nargs="?", help="of 'mine': plan file, or ring, level, decline, narrow"
        ),
        "ring",
        "level",
        "decline",
        "narrow",
        "files",
    )
    group = parser.add_argument_group("mine: a drive through a mine plan (docs/mines.md)")
    group.add_argument(
        "--route",
        metavar="T1,T2,-T3,DP1",
        help="drifts and places in order, - means in reverse (--route=-T1 where it comes first); without it all is driven",
    )
    group.add_argument(
        "--start", metavar="NAME", help="place or drift where the drive begins (default: a park, or the first drift)"
    )
    group.add_argument(
        "--wander", type=float, metavar="M", help="slow lateral wandering of the operator, m (default 0)"
    )
    group.add_argument("--names", action="store_true", help="write /operation/node: the name of where the machine is")


def refuse_others(arguments: argparse.Namespace) -> None:
    """Refuse options of a mine with another scenario, and the other way round.

    Raises:
        UsageError: there is one.
    """
    mine = arguments.scenario == "mine"
    for name in _DRIFT_ONLY if mine else _MINE_ONLY:
        if getattr(arguments, name):
            option = f"'{arguments.plan}'" if name == "plan" else f"--{name.replace('_', '-')}"
            where = "not to a mine" if mine else "to 'lhdmap simulate mine PLAN'"
            raise UsageError(
                f"{option}: belongs {where}; {'drifts are in the plan' if mine else 'another scenario was found'}"
            )


def run_mine(arguments: argparse.Namespace, console: Console, scanner: dict[str, Any]) -> int:
    """Simulate a drive through a mine; return the exit code. `scanner` are the scanners' options."""
    from lhdmap.machine import load_machine
    from lhdmap.mine.make_network import make_network
    from lhdmap.mine.plan import find_plan, load_plan
    from lhdmap.simulation.mine_drive import simulate_mine

    if not arguments.plan:
        raise UsageError("lhdmap simulate mine PLAN: a plan file was wanted, or ring, level, decline, narrow")
    network = make_network(load_plan(find_plan(arguments.plan)))
    machine = load_machine(Path(arguments.machine) if arguments.machine else None)
    settings = _settings(arguments, scanner)
    log = arguments.output or Path(f"{network.plan.name}_seed{settings.seed}.mcap")
    way = f"route {settings.route}" if settings.route else "a teaching drive through all of it"
    console.note(f"simulating mine '{network.plan.name}': {way} at {figure(settings.operator.speed_kmh)} km/h")

    def progress(records: Iterator[Record], duration_s: float) -> Iterator[Record]:
        return _shown(records, console, duration_s)

    drive = simulate_mine(
        network, machine, settings, log, mesh_path=arguments.mesh, progress=progress, force=arguments.force
    )
    for contact in drive.contacts:
        console.warn(f"the machine touched something: {contact}")
    values = {
        "log": str(drive.log),
        "truth": str(drive.truth_file),
        "topology": str(drive.topology_file),
        "nodes": str(drive.nodes_file),
        "mesh": str(arguments.mesh) if arguments.mesh else None,
        "scans": drive.scans,
        "messages": drive.messages,
        "duration_s": drive.duration_s,
        "distance_m": drive.distance_m,
        "min_clearance_m": drive.min_clearance_m,
        "contacts": list(drive.contacts),
    }
    files = "\n".join(
        f"{name:9} {values[name]}" for name in ("log", "truth", "topology", "nodes", "mesh") if values[name]
    )
    told = f"{drive.distance_m:.1f} m in {drive.duration_s:.1f} s, {drive.scans} front scans"
    console.result(values, f"{files}\n{told}, least clearance {drive.min_clearance_m:.2f} m")
    return 0


def _settings(arguments: argparse.Namespace, scanner: dict[str, Any]) -> MineDriveSettings:
    from lhdmap.settings import load_section
    from lhdmap.simulation.mine_drive import MineDriveSettings
    from lhdmap.simulation.operator import OperatorSettings
    from lhdmap.simulation.sensing.faults import load_faults

    given = {"speed_kmh": arguments.speed_kmh, "wander_m": arguments.wander}
    operator = load_section(
        OperatorSettings, "operator", {key: value for key, value in given.items() if value is not None}
    )
    if arguments.seed is not None and arguments.seed < 0:
        raise UsageError(f"--seed {arguments.seed}: 0 or more was wanted")
    return MineDriveSettings(
        route=arguments.route or "",
        start=arguments.start or "",
        seed=arguments.seed or 0,
        names=arguments.names,
        truth=not arguments.no_truth,
        operator=operator,
        sensors=_sensors(arguments, scanner),
        faults=load_faults(arguments.faults) if arguments.faults is not None else (),
    )


def _sensors(arguments: argparse.Namespace, scanner: dict[str, Any]) -> SensorSettings:
    from lhdmap.settings import load_section
    from lhdmap.simulation.sensing.sections import (
        InclinometerSettings,
        ScannerSettings,
        SensorSettings,
        WheelSettings,
    )

    def enabled(value: bool | None) -> dict[str, Any]:
        return {} if value is None else {"enabled": value}

    sensors = SensorSettings()
    return replace(
        sensors,
        scanner=load_section(
            ScannerSettings, "scanner", {key: value for key, value in scanner.items() if value is not None}
        ),
        inclinometer=load_section(InclinometerSettings, "inclinometer", enabled(arguments.inclinometer)),
        wheels=load_section(
            WheelSettings, "wheels", enabled(arguments.wheels) | ({"slip": True} if arguments.slip else {})
        ),
    )


def _shown(records: Iterator[Record], console: Console, total_s: float) -> Iterator[Record]:
    """Yield records with progress by their time in the log."""
    from lhdmap.simulation.history import START_NS

    def position(record: Record) -> float:
        return (record.log_time_ns - START_NS) * 1e-9

    return console.progress(records, total=total_s, label="simulate", position=position)

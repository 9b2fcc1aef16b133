"""`lhdmap check-map MAP`: is the map ready to run on, and if not, why."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_settings
from lhdmap.errors import EvaluationShortfall

if TYPE_CHECKING:
    from lhdmap.movement.findings import Verdict


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap check-map`."""
    parser.add_argument("map", type=Path, metavar="MAP", help="map folder, or a topology.geojson")
    parser.add_argument(
        "--machine", type=Path, metavar="FILE.toml", help="the machine that is to run (default: the map's)"
    )
    parser.add_argument(
        "--machines",
        type=int,
        default=3,
        metavar="N",
        help="machines for which throughput is told (default: 3; 0: none)",
    )
    add_settings(parser, ["movement", "traffic"])


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Check the map and print the findings; exit code 1 where it is not ready."""
    from lhdmap.config import load_settings
    from lhdmap.machine import load_machine
    from lhdmap.movement.check import check_map
    from lhdmap.movement.findings import verdict_json, verdict_of
    from lhdmap.topology.files import read_topology
    from lhdmap.traffic.advice import traffic_findings

    settings = load_settings(arguments.config, arguments.set)
    machine = load_machine(arguments.machine) if arguments.machine else None
    verdict = check_map(arguments.map, settings.movement, machine)
    if arguments.machines > 1:
        told = traffic_findings(read_topology(arguments.map), arguments.machines, settings.traffic)
        verdict = verdict_of([*verdict.findings, *told])
    failure = None
    if not verdict.ready:
        failure = EvaluationShortfall(f"the map is not ready: {'; '.join(verdict.reasons[:3])}")
    console.result(verdict_json(verdict), _text(verdict), failure=failure)
    return 0 if failure is None else failure.exit_code


def _text(verdict: Verdict) -> str:
    """Return the verdict in words: a line for each finding, the worst first."""
    counts = f"{verdict.count('error')} errors, {verdict.count('warning')} warnings, {verdict.count('note')} notes"
    lines = [f"{'ready' if verdict.ready else 'NOT READY'}: {counts}"]
    lines += [f"{one.severity:<8} {one.rule:<12} {one.where}: {one.text}" for one in verdict.findings]
    return "\n".join(lines)

"""`lhdmap localize LOG --map MAP`: where the machine was on the map, scan by scan."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_output, add_settings, add_topics, topic_overrides
from lhdmap.names import beside


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap localize`."""
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="log(s) of one drive")
    parser.add_argument("--map", type=Path, required=True, metavar="MAP", help="map folder of build-map or update-map")
    add_output(parser, "folder of the run (default: LOG_localization beside the log)")
    add_settings(parser)
    add_topics(parser)
    parser.add_argument("--machine", type=Path, metavar="FILE.toml", help="machine description")
    parser.add_argument("--method", choices=("surface", "paper"), help="how it tracks (default: localization.method)")
    parser.add_argument(
        "--start",
        metavar="X,Y,DEG|NAME",
        help="about where the drive begins: a pose, a waypoint, or a node (default: it is searched for)",
    )
    parser.add_argument(
        "--smoother",
        action="store_true",
        help="poses of a fixed-lag smoother: each is final once the machine is 15 m farther",
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Localize the drive and print how much of it was tracked."""
    from lhdmap.cli.build_map import progress_of
    from lhdmap.config import load_settings
    from lhdmap.machine import load_machine
    from lhdmap.pipeline.localize_run import LocalizeRequest, localize

    result = localize(
        LocalizeRequest(
            arguments.logs,
            arguments.map,
            arguments.output or beside(arguments.logs[0], "localization"),
            load_settings(arguments.config, [*arguments.set, *_method(arguments)]),
            topic_overrides(arguments.topic),
            load_machine(arguments.machine) if arguments.machine else None,
            start_on(arguments.start, arguments.map) if arguments.start else None,
            progress_of(console),
            arguments.force,
            arguments.smoother,
        )
    )
    for text in result.summary["warnings"]:
        console.warn(text)
    console.result({"run": str(result.folder), **result.summary}, _text(result.folder, result.summary))
    return 0


def _method(arguments: argparse.Namespace) -> list[str]:
    return [f"localization.method={arguments.method}"] if arguments.method else []


def start_on(text: str, map_folder: Path) -> Any:
    """Return x, y, yaw and height of a start, or those of all places in a node, of which the first scan chooses."""
    from lhdmap.cli.update_map import start_of
    from lhdmap.localization.starting import poses_in
    from lhdmap.topology.files import read_topology
    from lhdmap.topology.model import Intersection, Tunnel

    topology = read_topology(map_folder)
    found = topology.called(text)
    return poses_in(topology, found.id) if isinstance(found, (Tunnel, Intersection)) else start_of(text, map_folder)


def _text(folder: Path, summary: dict[str, Any]) -> str:
    first = "none: no place on the map was sure enough"
    if summary["first_fix_s"] is not None:
        first = f"after {summary['first_fix_s']:.1f} s and {summary['first_fix_m']:.1f} m"
    return "\n".join(
        [
            f"run          {folder}",
            f"tracked      {100 * summary['tracking_share']:.1f} % of {summary['scans']} scans",
            f"first fix    {first}",
            f"lost         {summary['lost_stretches']} stretch(es); fixes withheld {summary['false_fix_guard']}",
            f"latency      {summary['latency_ms']['median']:.1f} ms median, {summary['latency_ms']['p99']:.1f} ms of 99 %",
        ]
    )

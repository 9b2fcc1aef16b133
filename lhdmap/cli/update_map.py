"""`lhdmap update-map MAP LOG…`: a new version of a map from another drive, with a difference report."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_output, add_settings, add_topics, topic_overrides
from lhdmap.errors import UsageError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap update-map`."""
    parser.add_argument("map", type=Path, metavar="MAP", help="map folder to begin with; it stays as it is")
    parser.add_argument(
        "logs", nargs="+", type=Path, metavar="LOG", help="log(s) of one drive that passes through the map"
    )
    add_output(parser, "folder of the new version (default: MAP_vN beside the map)")
    add_settings(parser)
    add_topics(parser)
    parser.add_argument("--machine", type=Path, metavar="FILE.toml", help="machine description")
    parser.add_argument("--edits", type=Path, metavar="FILE.toml", help="changes of the topology (docs/topology.md)")
    parser.add_argument(
        "--start",
        metavar="X,Y,DEG|NAME",
        help="about where the drive begins in the map: a pose, or the name of a waypoint (default: found by its walls)",
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Update the map and print what is different."""
    from lhdmap.cli.build_map import progress_of
    from lhdmap.config import load_settings
    from lhdmap.machine import load_machine
    from lhdmap.pipeline.update import UpdateRequest, update_map
    from lhdmap.topology.files import read_topology

    version = read_topology(arguments.map).version + 1
    result = update_map(
        UpdateRequest(
            arguments.map,
            arguments.logs,
            arguments.output or arguments.map.with_name(f"{_stem(arguments.map.name)}_v{version}"),
            load_settings(arguments.config, arguments.set),
            topic_overrides(arguments.topic),
            load_machine(arguments.machine) if arguments.machine else None,
            progress_of(console),
            arguments.edits,
            start_of(arguments.start, arguments.map) if arguments.start else None,
            arguments.force,
        )
    )
    for text in result.warnings:
        console.warn(text)
    table = {"map": str(result.folder), "version": result.version, "difference": result.difference}
    console.result(table | {"warnings": result.warnings}, _text(result.folder, result.version, result.difference))
    return 0


def _stem(name: str) -> str:
    """Return a map's name without the number of its version."""
    stem, separator, number = name.rpartition("_v")
    return stem if separator and number.isdigit() else name


def start_of(text: str, map_folder: Path) -> Any:
    """Return x, y, yaw (rad) and, of a waypoint, height (m) of a start that is given as `X,Y,DEG` or by a name.

    Raises:
        UsageError: it is neither.
    """
    import numpy as np

    from lhdmap.settings import nearest
    from lhdmap.topology.files import read_topology

    parts = text.split(",")
    if len(parts) == 3:
        try:
            x, y, heading_deg = map(float, parts)
        except ValueError as error:
            raise UsageError(f"--start {text}: three numbers were wanted, x, y (m) and heading (degrees)") from error
        return np.array([x, y, math.radians(heading_deg)])
    topology = read_topology(map_folder)
    point = next((one for one in topology.waypoints if text in (one.id, one.name)), None)
    if point is None:
        names = [one.name for one in topology.waypoints]
        raise UsageError(f"--start {text}: no waypoint of that name in the map{nearest(text, names)}")
    return point.pose[[0, 1, 3, 2]]


def _text(folder: Path, version: int, table: dict[str, Any]) -> str:
    """Return the difference in words."""
    lines = [f"map          {folder}", f"version      {version}, of version {table['from_version']}"]
    lines += [f"new tunnels  {', '.join(table['tunnels_new'])}"] if table["tunnels_new"] else []
    lines += [f"gone         {', '.join(table['tunnels_gone'])}"] if table["tunnels_gone"] else []
    for one in table["tunnels_changed"]:
        length, width = one["length_m"], one["width_min_m"]
        lines.append(
            f"changed      {one['name']}: length {length[0]} -> {length[1]} m, width {width[0]} -> {width[1]} m"
        )
    lines += [f"new nodes    {', '.join(table['nodes_new'])}"] if table["nodes_new"] else []
    lines += [f"moved        {one['name']} by {one['by_m']:.2f} m" for one in table["nodes_moved"]]
    for one in table["walls"]:
        if one["came_m2"] or one["went_m2"]:
            places = f"{one['came_at_m'] or ''} {one['went_at_m'] or ''}".strip()
            lines.append(f"walls        came {one['came_m2']:.1f} m², went {one['went_m2']:.1f} m² near {places}")
        lines.append(f"new room     {one['new_free_m2']:.0f} m² on level {one['level']}")
    lines.append(f"picture      {folder / 'difference.svg'}")
    return "\n".join(lines)

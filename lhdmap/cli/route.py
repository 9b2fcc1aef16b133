"""`lhdmap route MAP FROM TO`: the movement sequence between two places of a map, with inversions and its cost."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_settings
from lhdmap.errors import EvaluationShortfall
from lhdmap.extras import require
from lhdmap.outputs import OutputFiles, free_files

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lhdmap.movement.route import Route, Step
    from lhdmap.topology.model import TopologicalMap

PICTURES = (".svg", ".png", ".rrd")
_HEADING = "along or against the heading of the point, or degrees in the map"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap route`."""
    parser.add_argument("map", type=Path, metavar="MAP", help="map folder, or a topology.geojson")
    parser.add_argument("start", metavar="FROM", help="name or id of a waypoint, an access point or a node")
    parser.add_argument("goal", metavar="TO", help="the same; of a node, the nearest of its points")
    parser.add_argument(
        "--heading", metavar="H", help=f"how the machine stands at FROM: {_HEADING} (default: both tried)"
    )
    parser.add_argument("--goal-heading", metavar="H", help=f"how it is to stand at TO: {_HEADING} (default: any)")
    parser.add_argument(
        "--avoid", action="append", default=[], metavar="NAME", help="point, node, or A:B not to pass; repeatable"
    )
    parser.add_argument("--loaded", action="store_true", help="with a full bucket: its speed limit")
    parser.add_argument(
        "--picture", type=_picture, metavar="FILE", help="draw the route: .svg, .png, or .rrd for Rerun"
    )
    parser.add_argument("--force", action="store_true", help="replace an existing picture")
    add_settings(parser, ["movement"])


def _picture(text: str) -> Path:
    path = Path(text)
    if path.suffix.lower() not in PICTURES:
        raise argparse.ArgumentTypeError(f"'{text}': a name that ends in {', '.join(PICTURES)} was wanted")
    return path


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Search the route and print it; exit code 1 where there is none."""
    from lhdmap.config import load_settings
    from lhdmap.movement.route import route_json
    from lhdmap.movement.routes import RouteOptions, route
    from lhdmap.topology.files import read_topology

    if arguments.picture is not None:
        if arguments.picture.suffix.lower() == ".rrd":
            require("rerun")
        free_files([arguments.picture], force=arguments.force, inputs=[arguments.map])
    settings = load_settings(arguments.config, arguments.set).movement
    topology = read_topology(arguments.map)
    options = RouteOptions(arguments.heading, arguments.goal_heading, tuple(arguments.avoid))
    found = route(topology, arguments.start, arguments.goal, options, settings, loaded=arguments.loaded)
    if arguments.picture is not None and found.feasible:
        _draw(arguments, topology, found)
        console.note(f"picture: {arguments.picture}")
    failure = None if found.feasible else EvaluationShortfall(f"no route: {found.reason}")
    console.result(route_json(found), _text(arguments, found, topology), failure=failure)
    return 0 if failure is None else failure.exit_code


def _draw(arguments: argparse.Namespace, topology: TopologicalMap, route: Route) -> None:
    """Draw the route over the map, with the free space where the map folder has it."""
    from lhdmap.report import charts
    from lhdmap.report.topology_charts import route_figure
    from lhdmap.report.topology_recording import write_topology_recording
    from lhdmap.topology.sheet import read_sheets

    target: Path = arguments.picture
    sheets = arguments.map / "free_space.npz"
    with OutputFiles(target, force=arguments.force, inputs=[arguments.map]) as files:
        if target.suffix.lower() == ".rrd":
            title = f"{arguments.start} to {arguments.goal}"
            write_topology_recording(files.at(target), title, topology, route.states)
            return
        with charts.styled():
            figure = route_figure(topology, route.states, read_sheets(sheets) if sheets.is_file() else ())
            charts.write_figure(figure, files.at(target), target.suffix.lower()[1:])


def _text(arguments: argparse.Namespace, route: Route, topology: TopologicalMap) -> str:
    return "\n".join([f"from to      {arguments.start} to {arguments.goal}", *route_lines(route, topology)])


def route_lines(route: Route, topology: TopologicalMap) -> Iterator[str]:
    """Yield a route in words: its figures, the table of movements, what lost against it."""
    names = {one.id: one.name for one in topology.waypoints} | {one.id: one.name for one in topology.nodes.values()}
    if not route.feasible:
        yield f"no route     {route.reason}"
        return
    yield f"route        {route.distance_m:.1f} m in {route.time_s:.1f} s, {_inversions(route)}"
    yield f"heading      {route.start_heading} at the start, {route.goal_heading} at the goal"
    if route.other_heading:
        yield f"otherwise    {route.other_heading}"
    yield ""
    rows = [("at m", "at s", "point", "node", "state", "gear", ""), *_rows(route.states, names)]
    widths = [max(len(row[k]) for row in rows) for k in range(6)]
    for row in rows:
        cells = [
            text.rjust(w) if k < 2 else text.ljust(w) for k, (text, w) in enumerate(zip(row, widths, strict=False))
        ]
        yield "  ".join([*cells, row[6]]).rstrip()
    yield ""
    for one in route.alternatives:
        nodes = " > ".join(names.get(node, node) for node in one.nodes)
        yield f"instead      {nodes}: {one.distance_m:.1f} m in {one.time_s:.1f} s; {one.lost}"
    if not route.alternatives:
        yield "instead      no other way"


def _inversions(route: Route) -> str:
    turns = f", {route.turns} in a turning bay" if route.turns else ""
    return f"{route.inversions} inversion{'' if route.inversions == 1 else 's'}{turns}"


def _rows(steps: tuple[Step, ...], names: dict[str, str]) -> Iterator[tuple[str, ...]]:
    for k, step in enumerate(steps):
        yield (
            f"{step.at_m:.1f}",
            f"{step.at_s:.1f}",
            names.get(step.point, step.point),
            names.get(step.node, step.node),
            f"({step.state})",
            step.gear,
            _remark(step, first=k == 0, last=k == len(steps) - 1),
        )


def _remark(step: Step, *, first: bool, last: bool) -> str:
    if step.inversion:
        return f"<< INVERSION: goes on in {step.gear}"
    if step.turn and not last:
        return "<< TURNS ROUND"
    if first:
        return "start"
    return "goal" if last else "stop" if step.stop else ""

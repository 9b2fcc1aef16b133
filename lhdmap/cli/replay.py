"""`lhdmap replay SCENARIO`: a simulated machine in closed loop; log, journal, verdict, report and recording."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from lhdmap.cli.attendants import add_operator, attendant_of
from lhdmap.cli.console import Console
from lhdmap.cli.following import free_port, viewer_of
from lhdmap.cli.options import add_output, add_settings, suggest
from lhdmap.errors import EvaluationShortfall
from lhdmap.resources import resource


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap replay`."""
    names = sorted(path.stem for path in resource("pipelines/scenarios").glob("*.toml"))
    suggest(
        parser.add_argument(
            "scenario", metavar="SCENARIO", help=f"scenario file, or one that ships: {', '.join(names)}"
        ),
        *names,
        "files",
    )
    add_output(parser, "folder to make (default: SCENARIO_run here)", "RUN")
    add_settings(parser)
    parser.add_argument("--seed", type=int, metavar="N", help="over the scenario's; same seed, same journal to the bit")
    parser.add_argument(
        "--machines",
        type=int,
        choices=(1, 2, 3),
        metavar="N",
        help="over the scenario's: machines of a mission, 1 to 3",
    )
    parser.add_argument("--view", action="store_true", help="follow the run in Rerun: a window, or a page without one")
    add_operator(parser)
    parser.add_argument("--no-truth", action="store_true", help="no /ground_truth/odometry in run.mcap")
    parser.add_argument(
        "--view-port", type=int, metavar="N", help="with --view: a page at this port, its data at the next"
    )
    parser.add_argument("--no-recording", action="store_true", help="no recording.rrd: faster, less disk")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Run the scenario; exit code 1 where the verdict is not ok."""
    from lhdmap.config import load_settings
    from lhdmap.errors import UsageError
    from lhdmap.outputs import free_folder
    from lhdmap.replay.assemble_station import check_attended
    from lhdmap.replay.run import ReplayRequest, replay
    from lhdmap.replay.scenario import find_scenario, load_scenario

    if arguments.view and arguments.no_recording:
        raise UsageError("--view shows the recording while it is written; --no-recording was found beside it")
    if arguments.view_port is not None and not (arguments.view and 1 <= arguments.view_port <= 65_534):
        raise UsageError(f"--view-port {arguments.view_port}: --view, and a port from 1 to 65534, were wanted")
    if arguments.seed is not None and arguments.seed < 0:
        raise UsageError(f"--seed {arguments.seed}: 0 or more was wanted")
    path = find_scenario(arguments.scenario)
    over = {"seed": arguments.seed, "machines": arguments.machines}
    scenario = load_scenario(path, **{key: value for key, value in over.items() if value is not None})
    target = arguments.output or Path(f"{path.stem}_run")
    free_folder(target, force=arguments.force, inputs=[path])
    if arguments.operator != "script":
        check_attended(scenario)
    settings = load_settings(arguments.config, arguments.set)
    page = arguments.view_port
    port = (page + 1 if page else free_port()) if arguments.view else None
    request = ReplayRequest(
        scenario,
        target,
        name=path.stem,
        truth=not arguments.no_truth,
        recording=not arguments.no_recording,
        live_port=port,
        force=arguments.force,
        sources=[path],
        progress=progress_of(console),
        settings=settings,
    )
    with viewer_of(port, console, page), attendant_of(arguments, path.stem, settings, console) as attendant:
        result = replay(dataclasses.replace(request, attendant=attendant))
    values = {"run": str(result.folder), **result.verdict}
    failure = None if result.verdict["ok"] else EvaluationShortfall(f"not ok: {result.verdict['reason']}")
    console.result(values, verdict_text(values), failure=failure)
    return 0 if failure is None else failure.exit_code


def verdict_text(values: Mapping[str, Any]) -> str:
    """Return the verdict in words."""
    from lhdmap.report.text import duration

    if values["kind"] == "grizzly":
        return "\n".join(_grizzly_lines(values))
    near = values["min_clearance_m"]
    speed = f"mean {values['mean_speed_kmh']:.1f} km/h, {values['stops']} stops"
    lines = [
        f"verdict      {'ok' if values['ok'] else 'not ok'}: {values['reason']}",
        f"run          {values['run']}",
        f"report       {Path(values['run']) / 'report.html'}",
        f"drive        {values['distance_m']:.1f} m in {duration(values['duration_s'])}, {speed}",
        f"{'lane ' if values['kind'] == 'haulage' else 'walls'}        {len(values['contacts'])} contacts"
        + ("" if near is None else f", never nearer than {near:.2f} m"),
        *_haulage_lines(values),
        *_crew_lines(values),
        *([f"faults       {len(values['faults'])} injected"] if values["faults"] else []),
        f"journal      {values['journal_sha256'][:16]}…, {values['realtime_factor']:.1f} x real time",
    ]
    return "\n".join(lines)


def _haulage_lines(values: Mapping[str, Any]) -> list[str]:
    if values["kind"] != "haulage" or values["sum_rms_m"] is None:
        return []
    used = f"half a lane used {values['half_lane_used_m']:.2f} of {values['half_lane_m']:.2f} m"
    return [
        f"loads        {values['cycles']}, {values['tonnes']:.1f} t",
        f"both bodies  off by {values['sum_rms_m']:.3f} m rms, {values['sum_max_m']:.2f} m at most; {used}",
    ]


def _crew_lines(values: Mapping[str, Any]) -> list[str]:
    if "machines" not in values:
        return []
    lines = [
        f"{one['machine']:<12} {one['cycles']} buckets, {one['tonnes']:.1f} t, {one['distance_m']:.0f} m, {one['reason']}"
        for one in values["machines"]
    ]
    return [*lines, f"sections     {len(values['sections_shared'])} times shared by two machines"]


def _grizzly_lines(values: Mapping[str, Any]) -> list[str]:
    from lhdmap.report.text import duration

    over = "" if values["over_best"] is None else f", {100.0 * (values['over_best'] - 1.0):.1f} % over the best order"
    return [
        f"verdict      {'ok' if values['ok'] else 'not ok'}: {values['reason']}",
        f"run          {values['run']}",
        f"report       {Path(values['run']) / 'report.html'}",
        f"rocks        {values['rocks']} too large at first, {values['rocks_left']} left, {values['blows']} blows",
        f"time         {duration(values['duration_s'])}{over}",
        f"plans        {values['plans']}, {values['plans_invalid']} not valid, {len(values['contacts'])} contacts",
        f"journal      {values['journal_sha256'][:16]}…, {values['realtime_factor']:.1f} x real time",
    ]


def progress_of(console: Console) -> Any:
    """Return a wrapper that shows progress by simulated time."""

    def wrap(moments: Iterable[int], duration_s: float) -> Iterable[int]:
        """Return the simulated times, shown as they go by."""
        from lhdmap.simulation.history import START_NS

        def position(now_ns: int) -> float:
            return (now_ns - START_NS) * 1e-9

        return console.progress(moments, total=duration_s, label="replay", position=position)

    return wrap

"""`lhdmap pile LOG|CLOUD`: pile identification alone."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_output, add_poses, add_settings, add_topics, topic_overrides
from lhdmap.names import beside, name_of
from lhdmap.outputs import free_folder
from lhdmap.provenance import file_entry

if TYPE_CHECKING:
    from lhdmap.config import Settings

CLOUD_SUFFIXES = (".ply", ".pcd", ".laz", ".las")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap pile`."""
    parser.add_argument(
        "input", type=Path, metavar="LOG|CLOUD", help="log or bag folder, or a cloud (.ply, .pcd, .las, .laz)"
    )
    add_output(parser, "folder to make (default: LOG_pile beside the log; of a cloud, none)")
    add_settings(parser)
    add_topics(parser)
    add_poses(parser)
    parser.add_argument("--machine", type=Path, metavar="FILE.toml", help="machine description")
    parser.add_argument(
        "--up", default="z", choices=("x", "y", "z", "-x", "-y", "-z"), help="of a cloud: the axis that points up"
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Find and measure the pile, write `pile.json`, print what was found."""
    if arguments.input.suffix.lower() in CLOUD_SUFFIXES:
        return _run_cloud(arguments, console)
    from lhdmap.config import load_settings
    from lhdmap.machine import load_machine
    from lhdmap.pipeline.identify import identify
    from lhdmap.report.pile_page import write_pile_report
    from lhdmap.report.pile_recording import write_pile_recording
    from lhdmap.runfolder import RunFolderWriter, RunInfo

    settings = load_settings(arguments.config, arguments.set)
    machine = load_machine(arguments.machine) if arguments.machine else None
    topics = topic_overrides(arguments.topic)
    target = arguments.output or beside(arguments.input, "pile")
    with RunFolderWriter("pile", target, force=arguments.force, inputs=[arguments.input]) as folder:
        report = identify(arguments.input, settings, arguments.poses, machine, topics)
        values = report.to_json()
        folder.write_json("pile.json", values)
        write_pile_report(report, folder.path / "report.html", f"Ore pile, {name_of(arguments.input)}")
        write_pile_recording(report, folder.path / "pile.rrd", name_of(arguments.input))
        folder.finished(folder.path / "report.html")
        path = folder.complete(RunInfo([arguments.input], _options(arguments, settings), warnings=values["warnings"]))
    for text in values["warnings"]:
        console.warn(text)
    console.result(values | {"folder": str(path)}, _text(values, path))
    return 0


def _options(arguments: argparse.Namespace, settings: Settings) -> dict[str, Any]:
    """Return the settings, and what else was asked for."""
    from lhdmap.config import settings_table

    request = {
        "poses": arguments.poses or None,
        "topics": topic_overrides(arguments.topic),
        "machine": arguments.machine and file_entry(arguments.machine) | {"path": str(arguments.machine)},
    }
    return {**settings_table(settings), "request": request}


def _run_cloud(arguments: argparse.Namespace, console: Console) -> int:
    from lhdmap.errors import UsageError
    from lhdmap.pile.clouds.heap import run_cloud
    from lhdmap.pile.result import estimate_json
    from lhdmap.runfolder import RunFolderWriter, RunInfo

    given = [f"--{name}" for name in ("config", "set", "topic", "poses", "machine") if getattr(arguments, name)]
    if given:
        raise UsageError(f"{arguments.input}: {', '.join(given)} concern logs; a cloud takes --up and -o")
    if arguments.output is not None:
        free_folder(arguments.output, force=arguments.force, inputs=[arguments.input])
    estimate, more = run_cloud(arguments.input, arguments.up)
    values = estimate_json(estimate) | more
    values["reason"] = values["reason"] or None
    if arguments.output is not None:
        with RunFolderWriter("pile", arguments.output, force=arguments.force, inputs=[arguments.input]) as folder:
            folder.write_json("pile.json", values)
            path = folder.complete(RunInfo([arguments.input], {"up": arguments.up}, warnings=estimate.warnings))
        values |= {"folder": str(path)}
    for text in estimate.warnings:
        console.warn(text)
    console.result(values, _cloud_text(values))
    return 0


def _text(values: dict[str, Any], folder: Path) -> str:
    """Return the result in words."""
    lines = [f"folder       {folder}", *_measures(values)]
    distance_m = values["distance_at_decision_m"]
    if distance_m is not None:
        lines.append(f"decided      {distance_m:.1f} m before the toe (the foot of the pile)")
    elif values["status"] not in (None, "none"):
        lines.append(f"decided      no: it was never sure enough that it is {values['status']}")
    if len(values["piles"]) > 1:
        statuses = ", ".join(one["status"] for one in values["piles"])
        lines.append(f"on the drive {statuses}: in pile.json, piles")
    return "\n".join(lines)


def _measures(values: dict[str, Any]) -> list[str]:
    lines = [f"status       {_status(values)}"]
    if values["width_m"] is not None:
        lines.append(f"width        {values['width_m']:.2f} m{_deviation(values['width_std_m'], 2)}")
    if values["inclination_deg"] is not None:
        lines.append(
            f"inclination  {values['inclination_deg']:.1f}°{_deviation(values['inclination_std_deg'], 1)}{_over(values)}"
        )
    if values["volume_m3"] is not None:
        lines.append(f"volume seen  {values['volume_m3']:.1f} m³{_deviation(values['volume_std_m3'], 1)}")
    lines.extend(f"boulder      {one['size_m']:.1f} m" for one in values["boulders"])
    return lines


def _status(values: dict[str, Any]) -> str:
    """Return the status with what is known of it: its probability, or why there is none."""
    status, shares = values["status"], values["probabilities"]
    if status is None:
        return f"unknown: {values['reason']}"
    if status == "none" and shares[status] < max(shares.values()):
        return "none: what lies ahead is not known well enough to be called anything"
    words = "none: nothing closes the drift" if status == "none" and "piles" in values else status
    return f"{words} ({100 * shares[status]:.0f} %)"


def _over(values: dict[str, Any]) -> str:
    """Return the heights that the inclination is of, in words."""
    heights = values.get("inclination_heights_m")
    return f" (from {max(heights[0], 0.0):.1f} to {heights[1]:.1f} m over the floor)" if heights else ""


def _deviation(value: float | None, digits: int) -> str:
    """Return the standard deviation in words; the paper's method states none."""
    return "" if value is None else f" ± {value:.{digits}f}"


def _cloud_text(values: dict[str, Any]) -> str:
    plain = [
        f"{key:<12} {value}" for key, value in values.items() if isinstance(value, (int, float)) and "m" not in key
    ]
    return "\n".join(_measures(values) if "probabilities" in values else plain)

"""`lhdmap export MAP --format NAME`: a map in a format that other tools read."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_output, suggest
from lhdmap.exports.formats import FORMATS


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap export`."""
    parser.add_argument("map", type=Path, metavar="MAP", help="map folder")
    what = "; ".join(f"{name}: {form.summary}" for name, form in FORMATS.items())
    parser.add_argument("--format", required=True, choices=tuple(FORMATS), help=what)
    add_output(parser, "file to write (default: beside the map, with its name)", "FILE")
    suggest(
        parser.add_argument(
            "--control-points",
            type=Path,
            metavar="FILE",
            help="CSV or TOML of 3 or more points known in the map and in the mine's grid: name, x, y, z, E, N, Z",
        ),
        "files",
    )
    parser.add_argument(
        "--tolerance", type=float, metavar="M", help="largest residual and leave-one-out error (default: 0.10)"
    )
    parser.add_argument(
        "--frame",
        choices=("map", "mine_grid"),
        default="",
        help="of the coordinates (default: the grid where it is known; formats for machines stay in map without --control-points)",
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Write the files, print which."""
    from lhdmap.errors import UsageError
    from lhdmap.exports.export import ExportRequest, export
    from lhdmap.exports.judgement import Misfit
    from lhdmap.exports.registration import TOLERANCE_M

    tolerance_m = TOLERANCE_M if arguments.tolerance is None else arguments.tolerance
    if not (math.isfinite(tolerance_m) and tolerance_m > 0.0):
        raise UsageError(f"--tolerance {arguments.tolerance}: more than 0 m was wanted")
    if arguments.tolerance is not None and arguments.control_points is None:
        raise UsageError("--tolerance is about --control-points, which was not given")
    request = ExportRequest(
        arguments.map,
        arguments.format,
        arguments.output,
        arguments.control_points,
        tolerance_m,
        arguments.frame,
        arguments.force,
    )
    try:
        values = export(request)
    except Misfit as misfit:
        member = misfit.registration.to_json()
        values = {"format": request.format, "files": [], "registration": member}
        console.result(values, "\n".join([*_points(member), f"not written: {misfit}"]), failure=misfit)
        return misfit.exit_code
    console.result(values, _text(values))
    return 0


def _text(values: dict[str, Any]) -> str:
    """Return the result in words."""
    lines = [f"{'file':<14} {path}" for path in values["files"]]
    lines.append(f"{'frame':<14} {values['frame']}")
    lines += [f"{name:<14} {count}" for name, count in values["counts"].items()]
    member = values["registration"]
    return "\n".join([*lines, *(_points(member) if member else ())])


def _points(member: Mapping[str, Any]) -> list[str]:
    """Return in words how well a registration fits, and each of its points."""
    rms_m, worst_m = (member.get(key) for key in ("rms_m", "max_leave_one_out_m"))
    fit = "" if rms_m is None or worst_m is None else f", RMS {rms_m:.3f} m, leave-one-out at most {worst_m:.3f} m"
    return [
        f"{'registration':<14} turned by {member['rotation_deg']:.4f} deg to the left{fit}",
        *(
            f"  {one['name']:<12} residual {one['miss_m']:.3f} m, leave-one-out {one['leave_one_out_m']:.3f} m"
            for one in member.get("control_points", ())
            if {"miss_m", "leave_one_out_m"} <= one.keys()
        ),
    ]

"""`lhdmap loading calibrate CSV`: the weighing model of a machine from weighed buckets."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_common

if TYPE_CHECKING:
    from lhdmap.loading.calibrate import WeightModel


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands."""
    subjects = parser.add_subparsers(dest="subject", metavar="SUBJECT", title="subjects", required=True)
    text = "fit m and n of the weighing model, fill = m P - n, to weighed buckets"
    sub = subjects.add_parser("calibrate", help=text, description=text[0].upper() + text[1:] + ".")
    sub.add_argument(
        "table", type=Path, metavar="CSV", help="columns pressure_bar, and fill or mass_t: a line a bucket"
    )
    sub.add_argument("--full", type=float, default=11.0, metavar="T", help="mass of a full bucket, t (default: 11)")
    add_common(sub, again=True)


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Fit, print; raises where the table cannot be used (exit code 3)."""
    from lhdmap.errors import InputError, UsageError
    from lhdmap.loading.calibrate import fit_weights, read_weighings

    if not arguments.full > 0.0:
        raise UsageError(f"--full {arguments.full:g}: the mass of a full bucket in tonnes was wanted")
    pressure_bar, fill = read_weighings(arguments.table, arguments.full)
    try:
        model = fit_weights(pressure_bar, fill)
    except InputError as error:
        raise InputError(f"{arguments.table}: {error}") from error
    console.result(model.to_json(), "\n".join(_lines(model)))
    return 0


def _lines(model: WeightModel) -> list[str]:
    """Return the model as settings, and what is to be known of it."""
    return [
        "[weighing]",
        f"fill_per_bar = {model.m:.6g}  # m, 95 %: {model.m - model.m_95:.6g} to {model.m + model.m_95:.6g}",
        f"fill_offset = {model.n:.6g}  # n, 95 %: {model.n - model.n_95:.6g} to {model.n + model.n_95:.6g}",
        f"# {model.points} buckets; a single weighing deviates by {model.fill_std:.3f} of a fill (1 sigma)",
    ]

"""`lhdmap eval SUBJECT …`: compares results with ground truth, one module `lhdmap.cli.eval_SUBJECT` for each subject.

A subject has `add_arguments(parser)` and `run(arguments, console) -> int`, like a command, and imports what
is heavy only when it runs.
"""

from __future__ import annotations

import argparse
import importlib

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_common

SUBJECTS = {
    "loading": "attempts, fills and durations of loadings, as in Tables 3 to 5 of the autonomous loading paper",
    "localization": "where a machine was on a map, against the truth of the drive and of the teaching drive",
    "navigation": "speeds, times, distances, smoothness and walls of drives, as in Tables 3 and 4 of the navigation paper",
    "pile": "width, inclination and status of piles, as in Table 6 of the autonomous loading paper",
    "rockbreaker": "durations of rockbreaker trajectories, as in Table 3 of the rockbreaker paper",
    "trajectory": "absolute, relative and segment errors of a trajectory, and relations",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subjects with their options (their modules import nothing heavy until they run)."""
    subjects = parser.add_subparsers(dest="subject", metavar="SUBJECT", title="subjects", required=True)
    for name, summary in SUBJECTS.items():
        sub = subjects.add_parser(name, help=summary, description=summary[0].upper() + summary[1:] + ".")
        _module(name).add_arguments(sub)
        add_common(sub, again=True)


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Run the chosen subject and return its exit code."""
    return int(_module(arguments.subject).run(arguments, console))


def _module(name: str):  # type: ignore[no-untyped-def]  # a module has no type of its own
    return importlib.import_module("lhdmap.cli.eval_" + name)

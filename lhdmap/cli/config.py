"""`lhdmap config`: print the settings with unit and source."""

from __future__ import annotations

import argparse
from pathlib import Path

from lhdmap.cli.console import Console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap config`."""
    parser.add_argument("--config", type=Path, metavar="FILE.toml", help="settings over the defaults")
    parser.add_argument(
        "--set", action="append", default=[], metavar="section.key=value", help="one setting; repeatable"
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Print the settings as TOML that `--config` reads back."""
    from lhdmap.config import load_settings, settings_table, settings_toml

    settings = load_settings(arguments.config, arguments.set)
    console.result(settings_table(settings), settings_toml(settings).rstrip())
    return 0

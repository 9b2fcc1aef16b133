"""`lhdmap config [SECTION…]`: print the settings with unit and source."""

from __future__ import annotations

import argparse

from lhdmap.cli.console import Console
from lhdmap.cli.options import add_settings, suggest


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap config`."""
    suggest(
        parser.add_argument("sections", nargs="*", metavar="SECTION", help="print only this one (default: all)"),
        "sections",
    )
    add_settings(parser)


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Print the settings as TOML that `--config` reads back."""
    from lhdmap.config import load_settings, section_names, settings_table, settings_toml

    sections = section_names(arguments.sections)
    settings = load_settings(arguments.config, arguments.set)
    table = settings_table(settings)
    values = {name: table[name] for name in sections or table}
    console.result(values, settings_toml(settings, sections).rstrip())
    return 0

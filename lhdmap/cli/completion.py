"""`lhdmap completion SHELL`: tab completion for bash, zsh and fish, made from the parsers of the commands."""

from __future__ import annotations

import argparse

from lhdmap.cli.console import Console

SHELLS = ("bash", "zsh", "fish")
EPILOG = (
    "For this shell: source <(lhdmap completion bash), the same for zsh after compinit; fish: lhdmap completion fish | source. "
    "docs/commands.md tells where the script goes to stay."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `lhdmap completion`."""
    parser.epilog = EPILOG
    parser.add_argument("shell", metavar="SHELL", choices=SHELLS, help="bash, zsh or fish")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Print the script; it asks nothing of lhdmap when it is used."""
    from lhdmap.cli import completion_scripts
    from lhdmap.cli.completion_tree import all_nodes

    nodes = all_nodes()
    write = {
        "bash": completion_scripts.bash,
        "zsh": completion_scripts.zsh,
        "fish": completion_scripts.fish,
    }[arguments.shell]
    script = write(nodes)
    console.result({"shell": arguments.shell, "script": script}, script.rstrip())
    return 0

"""Options that commands share: each is declared and read in one place."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lhdmap.errors import UsageError

FORCE = "replace what is there: a folder of lhdmap or the file, once the new one is complete"
SUFFIX_OF_PACKED = (".gz", ".bz2", ".zstd", ".zst")


def add_common(parser: argparse.ArgumentParser, *, again: bool = False) -> None:
    """Declare what every command takes; `again` for a sub-command, so that those before it are kept."""
    group = parser.add_argument_group("common options")
    for flag, text in (
        ("--json", "one JSON object on standard output, also of a failure; all else on standard error"),
        ("--quiet", "no progress and no notes; warnings and errors stay"),
        ("--debug", "show the traceback of an error"),
    ):
        default = argparse.SUPPRESS if again else False
        group.add_argument(flag, action="store_true", default=default, help=text)


def add_output(parser: Any, text: str, metavar: str = "DIR") -> None:
    """Declare `-o` and `--force`."""
    parser.add_argument("-o", "--output", type=Path, metavar=metavar, help=text)
    add_force(parser)


def add_force(parser: Any) -> None:
    """Declare `--force`."""
    parser.add_argument("--force", action="store_true", help=FORCE)


def add_settings(parser: Any, sections: Iterable[str] = ()) -> None:
    """Declare `--config` and `--set`; `sections` are those that count, if not all do."""
    named = list(sections)
    only = f", section [{named[0]}]" if named else " (lhdmap config prints them)"
    parser.add_argument("--config", type=Path, metavar="FILE.toml", help=f"settings over the defaults{only}")
    suggest(
        parser.add_argument(
            "--set",
            action="append",
            default=[],
            metavar=f"{named[0] if named else 'section'}.key=value",
            help="one setting; repeatable",
        ),
        "settings",
    )


def add_topics(parser: Any, text: str = "topic of a role, e.g. front=/scan; repeatable") -> None:
    """Declare `--topic`."""
    suggest(parser.add_argument("--topic", action="append", default=[], metavar="role=/topic", help=text), "roles")


def add_poses(parser: Any) -> None:
    """Declare `--poses`."""
    suggest(
        parser.add_argument(
            "--poses",
            default="",
            metavar="FILE.tum",
            help="given poses instead of the odometry's: a TUM file, or ground-truth for those in the log",
        ),
        "files",
        "ground-truth",
    )


def suggest(action: argparse.Action, *names: str) -> argparse.Action:
    """Note what the shell may complete: words, or `files`, `settings`, `sections`, `roles`."""
    action.suggested = names  # type: ignore[attr-defined]
    return action


def topic_overrides(words: Iterable[str]) -> dict[str, str]:
    """Return topics by role from `role=/topic` words.

    Raises:
        UsageError: a word has no `=`.
    """
    found = {}
    for word in words:
        role, equals, topic = word.partition("=")
        if not (role and equals and topic):
            raise UsageError(f"--topic {word}: role=/topic was wanted, e.g. --topic front=/scan")
        found[role] = topic
    return found

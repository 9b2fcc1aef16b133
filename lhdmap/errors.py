"""The one exception family of lhdmap: raised anywhere, caught once, in `lhdmap.cli.main`.

The text of each is one or two lines for a person: which file and topic, what was found, what was wanted, what to do.
"""

from __future__ import annotations

from pathlib import Path


class LhdmapError(Exception):
    """Base of all errors that lhdmap raises on purpose; `exit_code` is what the command line returns for it.

    `kind` is the word for it in the object that `--json` prints of a failure.
    """

    exit_code = 3
    kind = "input"


class UsageError(LhdmapError):
    """The request itself is wrong: an unknown option, setting or name (exit code 2)."""

    exit_code = 2
    kind = "usage"


class ConfigError(UsageError):
    """A settings file or `--set` holds an unknown key or a value of the wrong type or range (exit code 2)."""

    kind = "settings"


class InputError(LhdmapError):
    """The input cannot be used: missing, empty, of an unknown format, without the needed topic (exit code 3)."""


class InstallationError(LhdmapError):
    """A library that the request needs is not installed, or cannot be loaded (exit code 3); the text has its install line."""

    kind = "installation"


class EvaluationShortfall(LhdmapError):
    """A check or an evaluation fell short of its target (exit code 1)."""

    exit_code = 1
    kind = "shortfall"


class LhdmapWarning(UserWarning):
    """Category of warnings that concern the input; commands collect them and print each once."""


def mark_kept(error: BaseException, path: Path) -> None:
    """Note on an error that what was finished before it is kept at `path`."""
    error.__dict__.setdefault("kept", []).append(path)


def unmark_kept(error: BaseException, folder: Path) -> None:
    """Take back what was noted of places in a folder that will be gone."""
    if "kept" in error.__dict__:
        error.__dict__["kept"] = [path for path in kept_with(error) if folder not in path.parents]


def kept_with(error: BaseException) -> list[Path]:
    """Return where what was finished before the error is kept; nowhere, if nothing was."""
    return list(error.__dict__.get("kept", []))

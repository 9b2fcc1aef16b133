"""The one exception family of lhdmap: raised anywhere, caught once, in `lhdmap.cli.main`.

The text of each is one or two lines for a person: which file and topic, what was found, what was wanted, what to do.
"""


class LhdmapError(Exception):
    """Base of all errors that lhdmap raises on purpose; `exit_code` is what the command line returns for it."""

    exit_code = 3


class UsageError(LhdmapError):
    """The request itself is wrong: an unknown option, setting or name (exit code 2)."""

    exit_code = 2


class ConfigError(UsageError):
    """A settings file or `--set` holds an unknown key or a value of the wrong type or range (exit code 2)."""


class InputError(LhdmapError):
    """The input cannot be used: missing, empty, of an unknown format, without the needed topic (exit code 3)."""


class EvaluationShortfall(LhdmapError):
    """A check or an evaluation fell short of its target (exit code 1)."""

    exit_code = 1


class LhdmapWarning(UserWarning):
    """Category of warnings that concern the input; commands collect them and print each once."""

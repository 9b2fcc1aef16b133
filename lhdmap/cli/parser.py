"""The parser of the command line: what is refused is told with the nearest name and the usage of the command it concerns."""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from typing import Any, NoReturn

from lhdmap.errors import UsageError
from lhdmap.settings import nearest


class CommandLineError(UsageError):
    """The words do not fit the command; `usage` is that of the command or sub-command that they were for."""

    def __init__(self, text: str, usage: str = "") -> None:
        super().__init__(text)
        self.usage = usage


class Parser(argparse.ArgumentParser):
    """Raises `CommandLineError` where argparse would print and exit; the parsers of its commands are of this kind, too."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; words that are left over are told by the innermost parser, which knows what they may have meant."""
        if self._subparsers is None:
            self._check_options(args or ())
        found, left_over = super().parse_known_args(args, namespace)
        if left_over:
            self.error(self._unknown(left_over))
        return found, left_over

    def error(self, message: str) -> NoReturn:
        """Raise what is wrong, with the usage."""
        raise CommandLineError(message, self.format_usage().rstrip())

    def _check_options(self, words: Sequence[str]) -> None:
        """Refuse an unknown option before something that it should have given is missed."""
        for word in itertools.takewhile(lambda word: word != "--", words):
            name = word.partition("=")[0]
            if name.startswith("--") and not any(one.startswith(name) for one in self._option_string_actions):
                self.error(self._unknown([word]))

    def _unknown(self, words: Sequence[str]) -> str:
        option = next((word for word in words if word.startswith("-")), None)
        if option is None:
            return f"one word too many: {words[0]}"
        name = option.partition("=")[0]
        known = [text for action in self._actions for text in action.option_strings if action.help != argparse.SUPPRESS]
        return f"unknown option {name}{nearest(name, known if name.startswith('--') else sorted(known, key=len))}"

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse what is none of the choices, with the nearest of them."""
        if action.choices is None or value in action.choices:
            return
        choices = [str(one) for one in action.choices]
        if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001  # it has no other name
            self.error(f"unknown {str(action.metavar).lower()} '{value}'{nearest(str(value), choices)}")
        raise argparse.ArgumentError(action, f"'{value}' is none of {', '.join(choices)}")

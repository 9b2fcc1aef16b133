"""Commands, options and what may follow them, read from the parsers for the scripts of the shells."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Values:
    """What may be typed in one place: words (with `=` at the end: more follows), and whether paths, too."""

    words: tuple[str, ...] = ()
    files: bool = False


@dataclass(frozen=True, slots=True)
class Option:
    """An option: its spellings, its help, and what its value may be; None: it takes none."""

    names: tuple[str, ...]
    text: str
    values: Values | None


@dataclass(frozen=True, slots=True)
class CompletionNode:
    """A command or sub-command by its `path` (`eval/trajectory`; empty: `lhdmap` itself)."""

    path: str
    options: tuple[Option, ...]
    commands: dict[str, str] = field(default_factory=dict)
    arguments: Values = field(default_factory=Values)


def all_nodes() -> list[CompletionNode]:
    """Return the nodes of all commands; their modules are imported for it."""
    from lhdmap.cli.main import COMMANDS, command_parser

    return list(_nodes(command_parser(list(COMMANDS)), ""))


def _nodes(parser: argparse.ArgumentParser, path: str) -> list[CompletionNode]:
    options, commands, inner = [], {}, []
    arguments = Values()
    for action in parser._actions:  # noqa: SLF001  # argparse has no other way to ask
        if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001
            commands = {choice.dest: choice.help or "" for choice in action._choices_actions}  # noqa: SLF001
            for name, sub in action.choices.items():
                inner += _nodes(sub, f"{path}/{name}".strip("/"))
        elif not action.option_strings:
            values = _values(action)
            arguments = Values((*arguments.words, *values.words), arguments.files or values.files)
        elif action.help != argparse.SUPPRESS:
            text = " ".join((action.help or "").replace("%%", "%").split())
            options.append(Option(tuple(action.option_strings), text, None if action.nargs == 0 else _values(action)))
    return [CompletionNode(path, tuple(options), commands, arguments), *inner]


def _values(action: argparse.Action) -> Values:
    if action.choices is not None:
        return Values(tuple(str(one) for one in action.choices))
    words: list[str] = []
    names = getattr(action, "suggested", ())
    for name in names:
        words += _words(name)
    return Values(tuple(words), "files" in names or action.type is Path)


def _words(name: str) -> list[str]:
    """Return the words that a note of `options.suggest` stands for."""
    if name == "files":
        return []
    if name == "settings":
        from lhdmap.config import setting_names

        return [f"{one}=" for one in setting_names()]
    if name == "sections":
        from lhdmap.config import SECTIONS

        return list(SECTIONS)
    if name == "roles":
        from lhdmap.roles import ROLES

        return [f"{one}=" for one in ROLES]
    return [name]

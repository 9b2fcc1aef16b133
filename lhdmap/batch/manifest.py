"""The manifest: a CSV with a row for each log."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from lhdmap.batch.store import is_url
from lhdmap.errors import InputError, UsageError
from lhdmap.names import beside
from lhdmap.settings import nearest

LOG, COMMAND, NAME, SHIFT = "log", "command", "name", "shift"
OPTIONS = ("map", "machine", "config")
COLUMNS = (LOG, *OPTIONS, COMMAND, NAME, SHIFT)
DEFAULT = "build-map"
RESERVED = ("rows", "batch.parquet", "report.html", "run.json")


class Kind(NamedTuple):
    """A command that can be in a manifest: what its result is called, which options it takes and must have, words besides."""

    what: str
    takes: frozenset[str]
    wants: frozenset[str] = frozenset()
    words: tuple[str, ...] = ()
    writes: bool = True


KINDS: Mapping[str, Kind] = {
    "build-map": Kind("map", frozenset({"machine", "config"}), words=("--one-process",)),
    "localize": Kind("localization", frozenset(OPTIONS), frozenset({"map"})),
    "pile": Kind("pile", frozenset({"machine", "config"})),
    "doctor": Kind("doctor", frozenset(), writes=False),
    "replay": Kind("run", frozenset()),
}


class Task(NamedTuple):
    """A row: the log as it is named and where it is, the command, its options (files), the name of its result, its shift.

    Logs and files are paths, or URLs as they are named.
    """

    log: str
    path: Path
    command: str
    options: tuple[tuple[str, str], ...]
    name: str
    shift: str = ""

    @property
    def kind(self) -> Kind:
        """What is known of the command."""
        return KINDS[self.command]

    @property
    def place(self) -> str:
        """The log as its command is given it."""
        return self.log if is_url(self.log) else str(self.path)

    @property
    def machine(self) -> str:
        """What the machine is called: the name of its file without the ending, empty for the default one."""
        path = dict(self.options).get("machine")
        return "" if path is None else Path(path).stem

    @property
    def asked(self) -> list[str]:
        """What is asked for, whatever it is called and wherever it goes."""
        return [self.command, self.place, *(f"{name}={path}" for name, path in self.options)]

    def words(self, folder: Path | str, *, force: bool = False) -> list[str]:
        """Return the words of the command line whose result goes into `folder`, a path or a URL."""
        words = [self.command, self.place, "--json", *self.kind.words]
        for name, path in self.options:
            words += [f"--{name}", path]
        if self.kind.writes:
            words += ["-o", f"{folder}/{self.name}", *(["--force"] if force else [])]
        return words


def read_manifest(path: Path) -> list[Task]:
    """Return the rows of a manifest; paths in it are relative to it.

    Raises:
        InputError: it cannot be read or has no rows.
        UsageError: a column, a command or what a row asks for is not known.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            columns, rows = [one.strip() for one in reader.fieldnames or ()], list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            f"{path}: not readable as a manifest: {error}; a CSV with the column log was wanted"
        ) from error
    _check_columns(path, columns)
    told = [(number, _plain(row)) for number, row in enumerate(rows, start=2)]
    tasks = [_task(path, number, row) for number, row in told if any(row.values())]
    if not tasks:
        raise InputError(f"{path}: no rows in it; a line for each log was wanted")
    return _named(tasks)


def _check_columns(path: Path, columns: Sequence[str]) -> None:
    for column in columns:
        if column not in COLUMNS:
            raise UsageError(f"{path}: unknown column '{column}'{nearest(column, COLUMNS)}")
    if LOG not in columns:
        raise UsageError(f"{path}: no column log; known columns: {', '.join(COLUMNS)}")


def _plain(row: Mapping[str | None, str | list[str] | None]) -> dict[str, str]:
    """Return the cells of a row without spaces around; what is left out is empty."""
    return {str(key).strip(): cell.strip() if isinstance(cell, str) else "" for key, cell in row.items()}


def _task(path: Path, number: int, row: Mapping[str, str]) -> Task:
    where, command = f"{path}, line {number}", row.get(COMMAND) or DEFAULT
    if "None" in row:
        raise UsageError(f"{where}: more cells than columns")
    if not row[LOG]:
        raise UsageError(f"{where}: log is empty")
    if command not in KINDS:
        raise UsageError(f"{where}: unknown command '{command}'{nearest(command, KINDS)}")
    kind = KINDS[command]
    options = {name: _placed(path, row[name]) for name in OPTIONS if row.get(name)}
    for name in sorted(set(options) - kind.takes):
        raise UsageError(f"{where}: '{command}' takes no {name}; leave the cell empty")
    for name in sorted(kind.wants - set(options)):
        raise UsageError(f"{where}: '{command}' wants a {name}")
    log, name = Path(_placed(path, row[LOG])), row.get(NAME, "")
    if name and (Path(name).name != name or name.startswith(".") or name in RESERVED):
        raise UsageError(
            f"{where}: name = '{name}': a name for a folder was wanted, without a path, none of {RESERVED}"
        )
    return Task(row[LOG], log, command, tuple(options.items()), name or beside(log, kind.what).name, row.get(SHIFT, ""))


def _placed(manifest: Path, cell: str) -> str:
    """Return a URL as it is, a path relative to the manifest as an absolute one."""
    return cell if is_url(cell) else str((manifest.parent / cell).absolute())


def _named(tasks: Sequence[Task]) -> list[Task]:
    """Return the tasks with a name each: of the same ones the second has `_2` behind it."""
    used: Counter[str] = Counter()
    taken = {task.name for task in tasks}
    named = []
    for task in tasks:
        name = task.name
        used[name] += 1
        number = used[name]
        while number > 1 and (name := f"{task.name}_{number}") in taken:
            number += 1
        used[task.name] = max(used[task.name], number)
        taken.add(name)
        named.append(task._replace(name=name))
    return named

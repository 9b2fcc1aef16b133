"""Which files belong to a ROS 2 bag folder: those that `metadata.yaml` names, else all that are there."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path
from typing import NamedTuple

from lhdmap.errors import InputError
from lhdmap.logs.findings import Findings
from lhdmap.logs.packed import SUFFIXES

NAME = "metadata.yaml"
_STORAGES = (".mcap", ".db3")
_MAX_BYTES = 16 << 20
_LIST = re.compile(
    r"^([ \t]*)relative_file_paths[ \t]*:[^\n]*\n(?:[ \t]*\n|\1[ \t]+[^\n]*(?:\n|\Z)|\1-[^\n]*(?:\n|\Z))*", re.MULTILINE
)
_NUMBERED = re.compile(r"(.*_)(\d+)")


class _Choice(NamedTuple):
    """Files to read, and the names of files that are missing."""

    files: list[Path]
    missing: list[str]


def files_of(folder: Path, remarks: Findings) -> tuple[list[Path], list[str]]:
    """Return the files of a bag folder to read, and the names of those that belong to it and are not there.

    Raises:
        InputError: there is no file to read.
    """
    there = {file.name: file for file in sorted(folder.iterdir()) if storage(file.name) and file.is_file()}
    named = _named(folder / NAME, remarks)
    if not there:
        missing = f"; {NAME} names {', '.join(named[:5])}" if named else ""
        raise InputError(f"{folder}: no .mcap or .db3 file in this folder{missing}; a ROS 2 bag folder was wanted")
    found, missing_names = _found(named, there)
    if not found:
        return _all(there, remarks), _renamed(missing_names, there, remarks)
    return found + _others(found, there, remarks), missing_names


def storage(name: str) -> str:
    """Return the suffix that tells how a file of a bag is stored, empty where it is no such file."""
    return next((suffix for suffix in _STORAGES if bare(name).lower().endswith(suffix)), "")


def bare(name: str) -> str:
    """Return the name of a file without the suffix of a compression."""
    return next((name[: -len(suffix)] for suffix in SUFFIXES if name.lower().endswith(suffix)), name)


def _named(file: Path, remarks: Findings) -> list[str]:
    """Return the names of files in `metadata.yaml`; empty where there is none, or none that can be read."""
    try:
        with file.open("rb") as stream:
            text = stream.read(_MAX_BYTES).decode("utf-8", "replace")
    except FileNotFoundError:
        return []
    except OSError as error:
        remarks.add(f"{NAME} cannot be read ({error.strerror}): all files of the folder are")
        return []
    names = _listed(text)
    if not names:
        remarks.add(f"{NAME} is empty or broken, it names no file: all files of the folder are read")
    return names


def _listed(text: str) -> list[str]:
    """Return the file names of the list in question; the rest of the text need not be whole."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    part = _LIST.search(text.replace("\r\n", "\n"))
    if part is None:
        return []
    try:
        (listed,) = YAML(typ="safe", pure=True).load(textwrap.dedent(part.group())).values()
    except (YAMLError, ValueError, AttributeError, RecursionError):
        return []
    names = [re.split(r"[/\\]", str(one))[-1] for one in listed] if isinstance(listed, list) else []
    return [name for name in dict.fromkeys(names) if name]


def _found(named: list[str], there: dict[str, Path]) -> tuple[list[Path], list[str]]:
    """Return the named files, packed or unpacked since, and the names of those that are not there."""
    by_bare = {bare(name): file for name, file in reversed(there.items())}
    found, missing = [], []
    for name in named:
        file = there.get(name) or by_bare.get(bare(name))
        if file is None:
            missing.append(name)
        else:
            found.append(file)
    return list(dict.fromkeys(found)), missing


def _renamed(missing: list[str], there: dict[str, Path], remarks: Findings) -> list[str]:
    """Return what is missing where none of the named files is there: nothing if others may be the same under new names."""
    if not missing or len(there) < len(missing):
        return missing
    remarks.add(f"{NAME} names {', '.join(missing[:5])}, not there: the files that are in the folder are read instead")
    return []


def _all(there: dict[str, Path], remarks: Findings) -> list[Path]:
    """Return all files, of those that differ in their suffix alone the first one."""
    kept: dict[str, Path] = {}
    for name, file in sorted(there.items(), key=lambda one: (bare(one[0]) != one[0], one[0])):
        stem = bare(name)[: -len(storage(name))]
        if stem in kept:
            remarks.add(f"{name} is not read: it seems to be the same as {kept[stem].name}")
        else:
            kept[stem] = file
    return sorted(kept.values())


def _others(found: list[Path], there: dict[str, Path], remarks: Findings) -> list[Path]:
    """Return the files that are not named and go on where the named ones end: the recorder died before it named them."""
    more: list[Path] = []
    last = max((_number(file.name) for file in found), key=lambda one: one[1])
    for name, file in sorted(there.items(), key=lambda one: _number(one[0])[1]):
        series, number = _number(name)
        if file in found:
            continue
        if series and series == last[0] and number == last[1] + 1:
            remarks.add(f"{name} is not named in {NAME}, and goes on where the named files end: read with them")
            more.append(file)
            last = series, number
        else:
            remarks.add(f"{name} is not named in {NAME}: not read; to read it, give it by its name")
    return more


def _number(name: str) -> tuple[str, int]:
    """Return the name of a series of files and the number in it, as in `drive_12.mcap`; empty and -1 for another name."""
    match = _NUMBERED.fullmatch(bare(name)[: -len(storage(name))])
    return (match[1] + storage(name), int(match[2][:9])) if match else ("", -1)

"""What says of a folder that lhdmap has made it, and what it is: `map.json` in a map, `run.json` in any other run."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lhdmap import __version__

SOFTWARE = {"name": "lhdmap", "version": __version__}
MAP = "map"
DESCRIPTIONS = ("map.json", "run.json")
LOG_SUFFIXES = (".mcap", ".bag", ".db3", ".clf")
# Runs of before `run.json` had map.json without a kind: what they are, by a file of each.
_BY_FILE = {MAP: "trajectory.tum", "pile": "pile.json", "plan": "plan.json", "workspace": "workspace.json"}


def description_name(kind: str) -> str:
    """Return the name of the file that describes a run of this kind."""
    return DESCRIPTIONS[0] if kind == MAP else DESCRIPTIONS[1]


def is_own(found: object) -> bool:
    """Return whether the content of a description says that lhdmap has written it."""
    software = found.get("software") if isinstance(found, dict) else None
    return isinstance(software, dict) and software.get("name") == SOFTWARE["name"]


def described(folder: Path) -> Mapping[str, Any] | None:
    """Return the description of a folder that lhdmap has made (`map.json` or `run.json`), None for any other folder."""
    for name in DESCRIPTIONS:
        with contextlib.suppress(OSError, ValueError):
            found = json.loads((folder / name).read_text(encoding="utf-8"))
            if is_own(found):
                return dict(found)
    return None


def kind_of(folder: Path) -> str | None:
    """Return what a folder of lhdmap is: `map`, `pile`, `plan`, `workspace`, `demo`, `suite` …; None for any other."""
    found = described(folder)
    return None if found is None else kind_in(folder, found)


def kind_in(folder: Path, info: Mapping[str, Any]) -> str:
    """Return what a folder is that has this description; one of before kinds were written is known by its files."""
    if "kind" in info:
        return str(info["kind"])
    return next((kind for kind, file in _BY_FILE.items() if (folder / file).is_file()), "run")


def looks_like_log(path: Path) -> bool:
    """Return whether a path is that of a log, by its name, or by what is in the folder."""
    if path.is_dir():
        return (path / "metadata.yaml").is_file() or any(path.glob("*.mcap")) or any(path.glob("*.db3"))
    return path.name.lower().removesuffix(".gz").removesuffix(".bz2").endswith(LOG_SUFFIXES)

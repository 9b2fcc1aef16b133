"""What a map is made of, and which roles of a log it reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from lhdmap.config import Settings
from lhdmap.roles import BUILD_MAP, GIVEN_POSES, read_by
from lhdmap.topology.edits import NO_EDITS, TopologyEdits

ROLES_READ = read_by(BUILD_MAP)
ROLES_PLACED = read_by(GIVEN_POSES)


class Inputs(NamedTuple):
    """What a map is made of: logs, settings, topics by role, title of the map, given poses; whether bad logs are tried.

    `window_ns`: only what was logged between these times.
    """

    logs: Sequence[Path]
    settings: Settings
    topics: Mapping[str, str]
    title: str
    poses: str = ""
    force: bool = False
    edits: TopologyEdits = NO_EDITS
    window_ns: tuple[int, int] | None = None

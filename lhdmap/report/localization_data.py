"""What the report and the recording of a localization show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from lhdmap.localization.changes import Change
from lhdmap.localization.episodes import Episode
from lhdmap.localization.rows import LocalizationRow
from lhdmap.localization.search import Search
from lhdmap.messages import FloatArray
from lhdmap.report.data import AngleSeries
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import Sheet


class LocalizationData(NamedTuple):
    """A run: title, the map (topology, levels, walls (M, 3)), rows, searches, what has changed, where it was weak or lost.

    `update`: the command that takes the changes over, empty where there are none.
    """

    title: str
    topology: TopologicalMap
    sheets: Sequence[Sheet]
    walls: FloatArray
    rows: Sequence[LocalizationRow]
    searches: Sequence[Search]
    changes: Sequence[Change]
    episodes: Sequence[Episode]
    summary: Mapping[str, Any]
    warnings: Sequence[str]
    articulation: AngleSeries | None = None
    update: str = ""

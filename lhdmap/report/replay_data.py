"""What the page and the recording of a replay are made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from lhdmap.messages import FloatArray

COLUMNS = ("time_s", "x_m", "y_m", "z_m", "yaw_rad", "articulation_rad", "speed_mps", "wanted_mps", "clearance_m")


class Change(NamedTuple):
    """A change of state: when, to which state, why."""

    t_ns: int
    state: str
    cause: str


@dataclass(frozen=True, slots=True)
class ReplayData:
    """A run: its verdict, `rows` (N, 9) of `COLUMNS`, its states, its lines (walls, N × 3) and what perception believed.

    `believed_m` (M, 3): path by perception, placed at the true start. `settings_text`: the scenario as a file.
    """

    title: str
    verdict: Mapping[str, Any]
    rows: FloatArray
    start_ns: int
    changes: Mapping[str, Sequence[Change]] = field(default_factory=dict)
    lines_m: Sequence[FloatArray] = ()
    believed_m: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    goal_m: tuple[float, float, float] | None = None
    provenance: Mapping[str, str] = field(default_factory=dict)
    settings_text: str = ""
    warnings: Sequence[str] = ()

    def column(self, name: str) -> FloatArray:
        """Return a column of `rows` by its name, shape (N,)."""
        values: FloatArray = self.rows[:, COLUMNS.index(name)]
        return values

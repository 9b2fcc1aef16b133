"""What the page and the recording of a replay are made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.report.loading_data import LoadData
from lhdmap.report.route_legs import Leg
from lhdmap.topology.model import TopologicalMap

COLUMNS = (
    "time_s", "x_m", "y_m", "z_m", "yaw_rad", "articulation_rad", "speed_mps", "wanted_mps", "clearance_m", "steering_rps",
)  # fmt: skip
PLAN_COLUMNS = ("time_s", "planned_mps", "clearance_m", "sight_m", "limit")
PLACE_COLUMNS = ("time_s", "along_m", "across_m", "heading_rad", "deviation_m")


class Change(NamedTuple):
    """A change of state: when, to which state, why."""

    t_ns: int
    state: str
    cause: str


class StopRow(NamedTuple):
    """A stop: from when to when (s; None: to the end), how fast before it, why, and what watchdog and guard said."""

    from_s: float
    to_s: float | None
    speed_kmh: float
    cause: str
    said: str


@dataclass(frozen=True, slots=True)
class DriveData:
    """What a machine that drives itself planned and believed, in the frame of the truth.

    `plans` (N, 5) of `PLAN_COLUMNS`, of which the last is an index of `limits`: what limits the speed; `horizons`: predicted
    ways (K, 3) of the leading axle; `places` (M, 5) of `PLACE_COLUMNS`: place by localization less the true one, in the axes of
    the machine, and the standard deviation that it tells. `topology` None: the place was never known. `bodies`: lines (5, 2)
    around both bodies on the way.
    """

    topology: TopologicalMap | None
    legs: Sequence[Leg]
    plans: FloatArray
    limits: Sequence[str]
    horizons: Sequence[FloatArray]
    places: FloatArray
    bodies: Sequence[FloatArray] = ()

    def plan(self, name: str) -> FloatArray:
        """Return a column of `plans` by its name, shape (N,)."""
        values: FloatArray = self.plans[:, PLAN_COLUMNS.index(name)]
        return values

    def place(self, name: str) -> FloatArray:
        """Return a column of `places` by its name, shape (M,)."""
        values: FloatArray = self.places[:, PLACE_COLUMNS.index(name)]
        return values


@dataclass(frozen=True, slots=True)
class ReplayData:
    """A run: its verdict, `rows` (N, 10) of `COLUMNS`, its states, its lines (walls, N × 3) and what perception believed.

    `believed_m` (M, 3): path by perception, placed at the true start. `settings_text`: the scenario as a file.
    `others`: rows of the other machines of a crew, by name.
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
    drive: DriveData | None = None
    stops: Sequence[StopRow] = ()
    load: LoadData | None = None
    others: Mapping[str, FloatArray] = field(default_factory=dict)

    def column(self, name: str) -> FloatArray:
        """Return a column of `rows` by its name, shape (N,)."""
        values: FloatArray = self.rows[:, COLUMNS.index(name)]
        return values

"""What is kept of the work at a grizzly, for page, recording and log."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.rockbreaker.rocks import Rock, Scene
from lhdmap.rockbreaker.table import COLUMNS, joined


class Stop(NamedTuple):
    """A blow: when, seconds from the start, at which rock, as seen, and what it did."""

    at_s: float
    rock: Rock
    outcome: str


class Look(NamedTuple):
    """What was seen at a time, seconds from the start: the scene, which rocks are to be broken, some of the points (N, 3)."""

    at_s: float
    scene: Scene
    oversize: tuple[Rock, ...]
    points_m: FloatArray


class Move(NamedTuple):
    """A move: when it began, its duration, seconds, and the way of the tip (N, 3); `level` on the work plane."""

    at_s: float
    duration_s: float
    way_m: FloatArray
    level: bool


@dataclass
class Story:
    """Rows as `table.COLUMNS` from `began_s` on, looks, blows and moves; times in seconds from the start."""

    began_s: float = 0.0
    rows: list[FloatArray] = field(default_factory=list)
    looks: list[Look] = field(default_factory=list)
    stops: list[Stop] = field(default_factory=list)
    moves: list[Move] = field(default_factory=list)

    def table(self) -> FloatArray:
        """Return all rows (N, 26), time going on."""
        return joined(self.rows)

    def rests(self, duration_s: float) -> None:
        """Note that the arm stands for a while."""
        if self.rows:
            rest = np.repeat(self.rows[-1][-1:], 2, axis=0)
            rest[:, 0] = 0.0, duration_s
            rest[:, COLUMNS.index("sigma_dot")] = rest[:, COLUMNS.index("q1") :] = 0.0
            self.rows.append(rest)
        else:
            self.began_s += duration_s

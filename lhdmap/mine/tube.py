"""Tubes: all that is hollow in a mine, each a centre line with width and height along it: drifts, places, turns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.mine.centre_line import CentreLine
from lhdmap.mine.plan import PlacePlan
from lhdmap.settings import Profile

Kind = Literal["drift", "place", "turn"]


@dataclass(frozen=True, slots=True, eq=False)
class Tube:
    """A drift, the short drift of a place beside one, or the turn that cuts the corner between two branches of a junction.

    `widths_m` and `heights_m` are rows (at, value), shape (N, 2). `roughness_m` is that of walls and roof.
    """

    name: str
    kind: Kind
    line: CentreLine
    widths_m: FloatArray
    heights_m: FloatArray
    roughness_m: float
    place: PlacePlan | None = None

    @property
    def length_m(self) -> float:
        """Length of the centre line in plan, metres."""
        return self.line.length_m

    def half_width_m(self, s_m: float) -> float:
        """Return half of the width at a place on the centre line."""
        return 0.5 * float(np.interp(s_m, *self.widths_m.T))

    def height_m(self, s_m: float) -> float:
        """Return the height at a place on the centre line."""
        return float(np.interp(s_m, *self.heights_m.T))

    def pose(self, s_m: float, direction: int = 1) -> FloatArray:
        """Return x, y, z and heading, shape (4,), at a place on the centre line, looking along it (1) or back (-1)."""
        pose: FloatArray = self.line.at(np.array([s_m]))[0].copy()
        if direction < 0:
            pose[3] += np.pi
        return pose


def rows_of(profile: Profile) -> FloatArray:
    """Return a profile as rows (at, value), shape (N, 2)."""
    if isinstance(profile, tuple):
        return np.array(profile, dtype=float)
    return np.array([[0.0, profile]])

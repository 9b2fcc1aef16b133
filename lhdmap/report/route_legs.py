"""The way of a route on the map: its legs, each in one gear."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.topology.model import TopologicalMap

if TYPE_CHECKING:
    from lhdmap.movement.route import Step


class Leg(NamedTuple):
    """A part of a route in one `gear` (`forward`, `reverse`): the path `line_m` (N, 3) of base_link, in driving order."""

    gear: str
    line_m: FloatArray


def legs_of(topology: TopologicalMap, steps: Sequence[Step]) -> list[Leg]:
    """Return the legs of a route: along the connections within nodes, straight from a node into the next."""
    lines = {(one.start, one.end): one.line_m for one in topology.connections}
    parts: list[tuple[str, FloatArray]] = []
    for here, there in pairwise(steps):
        if here.point == there.point:
            continue
        ends = np.array([topology.points[one.point].pose[:3] for one in (here, there)])
        along, back = lines.get((here.point, there.point)), lines.get((there.point, here.point))
        parts.append((here.gear, along if along is not None else ends if back is None else back[::-1]))
    return [Leg(gear, np.vstack([line for _, line in own])) for gear, own in groupby(parts, key=lambda part: part[0])]

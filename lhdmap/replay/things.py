"""What comes into the way: obstacles and persons as boxes that scanners see and bodies touch."""

from __future__ import annotations

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.replay.faults import Position
from lhdmap.simulation.drift import Mesh
from lhdmap.simulation.sensing.faults import FaultSettings

_OBSTACLE_M, _PERSON_M = 0.8, (0.5, 0.5, 1.8)
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
_TRIANGLES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ],
    dtype=np.uint32,
)  # fmt: skip


def thing_at(fault: FaultSettings, place_m: Position) -> Mesh:
    """Return an obstacle (a box with edges of `size`) or a person (a narrow one) that stands at a point."""
    edge = fault.size or _OBSTACLE_M
    size = _PERSON_M if fault.kind == "person" else (edge, edge, edge)
    corners: FloatArray = _CORNERS * np.array(size) + np.array(place_m)
    return Mesh(corners, _TRIANGLES)

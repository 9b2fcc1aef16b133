"""What a simulated machine and its sensors ask of the world that they are in."""

from __future__ import annotations

from typing import Protocol

from lhdmap.messages import FloatArray
from lhdmap.simulation.raycast import Surface


class Ground(Protocol):
    """What wheels stand on."""

    def floor_height(self, points_m: FloatArray) -> FloatArray:
        """Return the floor's height in `map`, shape (N,), metres, under (or over) points (N, 3) near it: z says which level."""
        ...

    def friction(self, position_m: FloatArray) -> float:
        """Return the friction coefficient between tyre and floor at a point (3,)."""
        ...


class View(Protocol):
    """What scanners look at."""

    def near(self, position_m: FloatArray) -> Surface:
        """Return the surface that rays from a point (3,) of `map` meet, to cast them against."""
        ...


class Surroundings(Ground, View, Protocol):
    """A world to drive and look around in."""

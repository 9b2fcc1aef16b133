"""What a simulated machine and its sensors ask of the world that they are in."""

from __future__ import annotations

from typing import Protocol

from lhdmap.messages import Float32Array, FloatArray


class Rays(Protocol):
    """What rays meet around a place."""

    @property
    def origin_m(self) -> FloatArray:
        """A point (3,) of `map` near by, from which rays' origins are counted."""
        ...

    def cast(self, rays: Float32Array) -> Float32Array:
        """Return the range of each ray, shape (N,), metres, inf for none; `rays` (N, 6): origin less `origin_m`, direction."""
        ...


class Ground(Protocol):
    """What wheels stand on."""

    def floor_height(self, points_m: FloatArray) -> FloatArray:
        """Return the floor's height in `map`, shape (N,), metres, under (or over) points (N, 3) near it: z says which level."""
        ...

    def friction(self, position_m: FloatArray) -> float:
        """Return the friction coefficient between tyre and floor at a point (3,)."""
        ...


class SurroundingsView(Protocol):
    """What scanners look at."""

    def near(self, position_m: FloatArray) -> Rays:
        """Return what rays from a point (3,) of `map` meet, to cast them against."""
        ...

    def dust(self, position_m: FloatArray) -> float:
        """Return the share of beams (0 to 1) that dust returns to a scanner at a point (3,)."""
        ...


class Surroundings(Ground, SurroundingsView, Protocol):
    """A world to drive and look around in."""

"""Several machines in one mine: scanners of one see the bodies of the others, and bodies can touch.

The others are where they were stepped to last. A scan that is complete now was swept in the last hundredths of a second: at
20 km/h another machine is drawn up to 0.3 m from where it was.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from lhdmap.machine import Machine
from lhdmap.messages import Float32Array, FloatArray
from lhdmap.simulation.surroundings import Rays, SurroundingsView
from lhdmap.simulation.vehicle.bodies import Bodies, Boxes
from lhdmap.simulation.vehicle.state import VehicleState

_SEEN_M = 90.0  # other machines farther than scanners see are left out
_TOUCH_M = 25.0  # between `base_link`s: two machines that are farther apart do not touch
_PARALLEL = 1e-6


class Touched(NamedTuple):
    """Two bodies in each other: own body, the other machine and its body, about where (3,), how deep (m)."""

    body: str
    other: str
    point_m: FloatArray
    depth_m: float


class Company:
    """Where all machines of a mine are, by name."""

    def __init__(self, machines: Mapping[str, Machine]) -> None:
        self._bodies = {name: Bodies(machine) for name, machine in machines.items()}
        self.states: dict[str, VehicleState] = {}
        self._boxes: dict[str, Boxes] = {}

    def at(self, name: str, state: VehicleState) -> None:
        """Take where a machine is now."""
        self.states[name] = state
        self._boxes[name] = self._bodies[name].boxes(state)

    def others(self, name: str, position_m: FloatArray, within_m: float = _SEEN_M) -> Iterator[tuple[str, Boxes]]:
        """Yield the boxes of all other machines near a point (3,)."""
        for other, state in self.states.items():
            if other != name and np.hypot(state.x_m - position_m[0], state.y_m - position_m[1]) < within_m:
                yield other, self._boxes[other]

    def touching(self, name: str) -> list[Touched]:
        """Return which bodies of a machine are in bodies of others, each with the deepest."""
        own, state = self._boxes[name], self.states[name]
        near = list(self.others(name, np.array([state.x_m, state.y_m, state.z_m]), _TOUCH_M))
        found = []
        for k, body in enumerate(own.names):
            met = [
                (depth_m(own, k, boxes, j), f"{other} {boxes.names[j]}", boxes.centre_m[j])
                for other, boxes in near
                for j in range(len(boxes.names))
            ]
            depth, other, centre_m = max(met, key=lambda one: one[0], default=(0.0, "", np.zeros(3)))
            if depth > 0.0:
                found.append(Touched(body, other, 0.5 * (own.centre_m[k] + centre_m), depth))
        return found


class Among:
    """The view of one machine: the mine, and the bodies of the others in it."""

    def __init__(self, world: SurroundingsView, company: Company, name: str) -> None:
        self._world, self._company, self._name = world, company, name

    def near(self, position_m: FloatArray) -> Rays:
        """Return what rays from a point (3,) of `map` meet."""
        rays = self._world.near(position_m)
        boxes = [one for _, one in self._company.others(self._name, position_m)]
        return _WithBoxes(rays, boxes) if boxes else rays

    def dust(self, position_m: FloatArray) -> float:
        """Return the share of beams that dust returns to a scanner at a point (3,)."""
        return self._world.dust(position_m)


class _WithBoxes:
    def __init__(self, rays: Rays, boxes: list[Boxes]) -> None:
        self._rays, self.origin_m = rays, rays.origin_m
        self._centre_m = np.concatenate([one.centre_m for one in boxes]) - self.origin_m
        self._axes, self._half_m = (
            np.concatenate([one.axes for one in boxes]),
            np.concatenate([one.half_m for one in boxes]),
        )

    def cast(self, rays: Float32Array) -> Float32Array:
        """Return the range of each ray (N,), as `Rays.cast`."""
        ranges = self._rays.cast(rays)
        for centre, axes, half in zip(self._centre_m, self._axes, self._half_m, strict=True):
            ranges = np.minimum(ranges, ranges_to_box(rays, centre, axes, half))
        return ranges


def ranges_to_box(rays: Float32Array, centre_m: FloatArray, axes: FloatArray, half_m: FloatArray) -> Float32Array:
    """Return the range of each ray (N, 6) to the outside of a box (axes as columns), inf where it misses or begins inside.

    Slabs (Kay and Kajiya 1986).
    """
    begin, way = (rays[:, :3] - centre_m) @ axes, rays[:, 3:] @ axes
    way = np.where(np.abs(way) < _PARALLEL, _PARALLEL, way)
    one, two = (-half_m - begin) / way, (half_m - begin) / way
    enters, leaves = np.minimum(one, two).max(axis=1), np.maximum(one, two).min(axis=1)
    found: Float32Array = np.where((enters > 0.0) & (enters <= leaves), enters, np.inf).astype(np.float32)
    return found


def depth_m(a: Boxes, i: int, b: Boxes, j: int) -> float:
    """Return how deep a box is in another one, the least way out of it, m; 0: they do not overlap (15 separating axes)."""
    apart, own, other = b.centre_m[j] - a.centre_m[i], a.axes[i], b.axes[j]
    crossed = np.cross(own.T[:, None, :], other.T[None, :, :]).reshape(-1, 3)
    length = np.linalg.norm(crossed, axis=1)
    axes = np.concatenate([own.T, other.T, crossed[length > _PARALLEL] / length[length > _PARALLEL, None]])
    reach = np.abs(axes @ own) @ a.half_m[i] + np.abs(axes @ other) @ b.half_m[j]
    return max(float((reach - np.abs(axes @ apart)).min()), 0.0)


class Stepped:
    """A machine of a company: each step is told to it."""

    def __init__(self, vehicle: Any, company: Company, name: str) -> None:
        self._vehicle, self._company, self._name = vehicle, company, name

    def step(self, state: VehicleState, command: Any, dt_s: float) -> VehicleState:
        """Return the state a moment later."""
        after: VehicleState = self._vehicle.step(state, command, dt_s)
        self._company.at(self._name, after)
        return after

"""What the bodies of a machine touch in a mine, and how near they are to its walls; never taken from a map."""

from __future__ import annotations

from collections import OrderedDict

import numpy as np

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.mine_world.world import MineWorld
from lhdmap.simulation.vehicle.bodies import Bodies, Boxes, moved_at_most_m
from lhdmap.simulation.vehicle.contact import BodyContact, ContactPiece, Contacts
from lhdmap.simulation.vehicle.state import VehicleState

_KEPT = 128  # pieces of the surface that are ready to be touched
_LIMIT_M = 2.0  # clearances are told up to this
_SURELY_M = 1e-6  # what clearances are exact to
_STAYS_M = 2.0  # pieces are looked for anew when a body has moved so far


class Bumper:
    """The bodies of a machine in a mine."""

    def __init__(self, machine: Machine, world: MineWorld) -> None:
        self._bodies, self._world = Bodies(machine), world
        self._pieces: OrderedDict[int | str, ContactPiece] = OrderedDict()
        self._here: tuple[FloatArray, int, Contacts] | None = None
        self._clear: tuple[Boxes, int, float] | None = (
            None  # where the clearance was taken last, in which world, and what it was
        )

    def touching(self, state: VehicleState) -> list[BodyContact]:
        """Return the bodies that are in a wall or a thing, each with its deepest place.

        Bodies that have moved by less than the room that they had last touch nothing: nothing needs to be looked at.
        """
        boxes, clear = self._bodies.boxes(state), self._clear
        if (
            clear is not None
            and clear[1] == self._world.version
            and moved_at_most_m(clear[0], boxes) < clear[2] - _SURELY_M
        ):
            return []
        return self._near(boxes).touching(boxes)

    def clearance_m(self, state: VehicleState, limit_m: float = 1.0) -> float:
        """Return the least distance of any body from anything, at most `limit_m` (and 2 m), metres."""
        boxes = self._bodies.boxes(state)
        clear_m = self._near(boxes).clearance_m(boxes, min(limit_m, _LIMIT_M))
        self._clear = boxes, self._world.version, clear_m
        return clear_m

    def _near(self, boxes: Boxes) -> Contacts:
        """Return what is around; a little more than that, so that it holds for the next metres."""
        here = self._here
        if here is None or here[1] != self._world.version or _moved_m(here[0], boxes) > _STAYS_M:
            keys = self._world.keys_in(_around(boxes, _LIMIT_M + _STAYS_M))
            self._here = here = (
                boxes.centre_m, self._world.version, Contacts([self._piece(key) for key in keys])
            )  # fmt: skip
        return here[2]

    def _piece(self, key: int | str) -> ContactPiece:
        piece = self._pieces.get(key)
        if piece is None:
            mesh, floor = self._world.solid(key)
            triangles = mesh.triangles
            if floor is not None and self._world.surveyed:  # its floor has noise: there steep sides of it are no walls
                triangles = triangles[~floor]
            piece = self._pieces[key] = ContactPiece(
                mesh.vertices_m, triangles, None if self._world.surveyed else floor
            )
            if len(self._pieces) > _KEPT:
                self._pieces.popitem(last=False)
        self._pieces.move_to_end(key)
        return piece


def _moved_m(before: FloatArray, boxes: Boxes) -> float:
    """Return how far the body that has moved farthest is from where it was, about."""
    return float(np.abs(boxes.centre_m - before).max())


def _around(boxes: Boxes, more_m: float) -> FloatArray:
    """Return the box (2, 3) around boxes and `more_m`."""
    reach = (np.abs(boxes.axes) * boxes.half_m[:, None, :]).sum(axis=2)
    return np.stack([(boxes.centre_m - reach).min(axis=0) - more_m, (boxes.centre_m + reach).max(axis=0) + more_m])

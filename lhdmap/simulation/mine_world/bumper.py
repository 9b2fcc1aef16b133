"""What the bodies of a machine touch in a mine, and how near they are to its walls; never taken from a map."""

from __future__ import annotations

from collections import OrderedDict

import numpy as np

from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.mine_world.world import MineWorld
from lhdmap.simulation.vehicle.bodies import Bodies, Boxes
from lhdmap.simulation.vehicle.contact import BodyContact, ContactPiece, Contacts
from lhdmap.simulation.vehicle.state import VehicleState

_KEPT = 128  # pieces of the surface that are ready to be touched
_ROUND_M = 4.0  # pieces are looked for in boxes of this raster, so that most moments have those of the one before


class Bumper:
    """The bodies of a machine in a mine."""

    def __init__(self, machine: Machine, world: MineWorld) -> None:
        self._bodies, self._world = Bodies(machine), world
        self._pieces: OrderedDict[int | str, ContactPiece] = OrderedDict()
        self._here: tuple[tuple[float, ...], Contacts] | None = None

    def touching(self, state: VehicleState) -> list[BodyContact]:
        """Return the bodies that are in a wall or a thing, each with its deepest place."""
        boxes = self._bodies.boxes(state)
        return self._near(boxes, 0.0).touching(boxes)

    def clearance_m(self, state: VehicleState, limit_m: float = 1.0) -> float:
        """Return the least distance of any body from anything, at most `limit_m`, metres."""
        boxes = self._bodies.boxes(state)
        return self._near(boxes, limit_m).clearance_m(boxes, limit_m)

    def _near(self, boxes: Boxes, more_m: float) -> Contacts:
        box = _around(boxes, more_m)
        key = (*box.ravel().tolist(), float(self._world.version))
        if self._here is None or self._here[0] != key:
            self._here = (key, Contacts([self._piece(name) for name in self._world.keys_in(box)]))
        return self._here[1]

    def _piece(self, key: int | str) -> ContactPiece:
        piece = self._pieces.get(key)
        if piece is None:
            mesh, floor = self._world.solid(key)
            piece = self._pieces[key] = ContactPiece(mesh.vertices_m, mesh.triangles, floor)
            if len(self._pieces) > _KEPT:
                self._pieces.popitem(last=False)
        self._pieces.move_to_end(key)
        return piece


def _around(boxes: Boxes, more_m: float) -> FloatArray:
    """Return the box (2, 3) around boxes and `more_m`, rounded outwards to a raster."""
    reach = (np.abs(boxes.axes) * boxes.half_m[:, None, :]).sum(axis=2)
    low, high = (boxes.centre_m - reach).min(axis=0) - more_m, (boxes.centre_m + reach).max(axis=0) + more_m
    return np.stack([np.floor(low / _ROUND_M), np.ceil(high / _ROUND_M)]) * _ROUND_M

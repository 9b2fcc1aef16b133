"""The machine's bodies as boxes in space: those of both frames, and boom and bucket where their joints have moved them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.geometry import se3
from lhdmap.kinematics import T_base_rear
from lhdmap.machine import BodyBox, Machine
from lhdmap.messages import FloatArray
from lhdmap.simulation.vehicle.state import BOOM_LIFT_RAD, BUCKET_TILT_RAD, VehicleState

_FLOOR_M = 0.15  # what of a body is lower is not tested: it stands on the floor, and small stones pass under it


class Boxes(NamedTuple):
    """Boxes in `map`: names, middles (B, 3), axes as rows (B, 3, 3), half sizes (B, 3); metres."""

    names: tuple[str, ...]
    middle_m: FloatArray
    axes: FloatArray
    half_m: FloatArray

    @property
    def around_m(self) -> FloatArray:
        """The box around all, along the axes of `map`, shape (2, 3)."""
        reach = np.abs(self.axes * self.half_m[:, :, None]).sum(axis=1)
        return np.stack([(self.middle_m - reach).min(axis=0), (self.middle_m + reach).max(axis=0)])


class Bodies:
    """The boxes of a machine in any state."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._parts = [(name, body) for name, body in machine.bodies.items()]
        low_high = np.array([[_raised(body), body.max_m] for _, body in self._parts], dtype=float)
        self._middle_m, self._half_m = low_high.mean(axis=1), 0.5 * (low_high[:, 1] - low_high[:, 0])

    def at(self, state: VehicleState) -> Boxes:
        """Return the boxes in `map`."""
        T_map_base = se3.from_rpy(state.roll_rad, state.pitch_rad, state.yaw_rad, (state.x_m, state.y_m, state.z_m))
        T_of = {"base_link": T_map_base, "rear_link": T_map_base @ T_base_rear(state.articulation_rad, self._machine)}
        middles, axes = np.empty((len(self._parts), 3)), np.empty((len(self._parts), 3, 3))
        for k, (name, body) in enumerate(self._parts):
            T = T_of[body.frame]
            if name == self._machine.linkage.body:
                T = T @ self._T_base_bucket(state)
            middles[k], axes[k] = T[:3, :3] @ self._middle_m[k] + T[:3, 3], T[:3, :3].T
        return Boxes(tuple(name for name, _ in self._parts), middles, axes, self._half_m)

    def _T_base_bucket(self, state: VehicleState) -> FloatArray:  # noqa: N802  # frames in the name
        """Return how boom and bucket have moved from the tramming posture: with the pin, and turned about it."""
        arm = self._machine.linkage
        x, z = arm.pivot_m
        tramming, now = BOOM_LIFT_RAD - 0.472, state.boom_rad - 0.472  # the boom's own angle, loading prototype
        pin = np.array([x + arm.boom_m * math.cos(tramming), 0.0, z + arm.boom_m * math.sin(tramming)])
        moved = np.array([x + arm.boom_m * math.cos(now), 0.0, z + arm.boom_m * math.sin(now)])
        turn = (state.bucket_rad - BUCKET_TILT_RAD) + 0.5 * (state.boom_rad - BOOM_LIFT_RAD)
        T = se3.from_rpy(0.0, -turn, 0.0, (0.0, 0.0, 0.0))
        T[:3, 3] = moved - T[:3, :3] @ pin
        return T


def _raised(body: BodyBox) -> tuple[float, float, float]:
    x, y, z = body.min_m
    return x, y, max(z, _FLOOR_M)

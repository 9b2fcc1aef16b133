"""What is true of a simulated pile: the fitted face, boulders, and all of it as one record."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray

_FEWEST = 60  # hits on the face below which it has no inclination
_HUBER, _TUKEY = 1.345, 4.685  # standard deviations; 95 % efficient for normal residuals
_STEPS, _HUBER_STEPS = 40, 10


class FacePlane(NamedTuple):
    """The fitted face x = offset + by_y·y + by_z·z in the frame of the foot, metres."""

    offset_m: float
    by_y: float
    by_z: float

    def x_m(self, y_m: FloatArray, z_m: FloatArray) -> FloatArray:
        """Return where the plane is along the drift."""
        return self.offset_m + self.by_y * y_m + self.by_z * z_m

    @property
    def inclination_deg(self) -> float:
        """Inclination in the sign of Table 6: -45 for a pile of 45°, -90 for a wall."""
        return -math.degrees(math.atan2(1.0, self.by_z))


class BoulderTruth(NamedTuple):
    """A boulder: its middle and the middle of what stands out of the face, both (3,) in `map`; largest extent (m)."""

    center_m: FloatArray
    visible_center_m: FloatArray
    size_m: float
    visible_size_m: float


class PileTruth(NamedTuple):
    """What a perfect observer knows; points in `map`. NaN or empty where the scene has no such thing.

    `left_m`, `right_m` are the two medians whose sum is the width; `toe_m` (K, 3) runs from left to right; `center_m` (3,) is
    the middle of the toe, or where the obstacle or opening is. `volumes_m3` maps a height over the floor at the toe to the
    volume between floor and face as far as the fitted face rises to that height.
    """

    variant: str
    status: str
    width_m: float
    inclination_deg: float
    left_m: float
    right_m: float
    center_m: FloatArray
    toe_m: FloatArray
    plane: FacePlane | None
    end_heading_rad: float
    floor_m: float
    boulders: tuple[BoulderTruth, ...]
    volumes_m3: dict[float, float]

    def distances_m(self, positions_m: FloatArray) -> FloatArray:
        """Return the level distance from each position of base_link, (N, 3), to the nearest point of the toe, (N,)."""
        toe = self.toe_m if len(self.toe_m) else self.center_m[None]
        difference = positions_m[:, None, :2] - toe[None, :, :2]
        nearest: FloatArray = np.sqrt((difference**2).sum(axis=2)).min(axis=1)
        return nearest


def fit_face(x_m: FloatArray, at_m: FloatArray) -> FacePlane | None:
    """Return the robust regression of x (N,) on (y, z) (N, 2), by Tukey's weights; None where there is too little."""
    if len(x_m) < _FEWEST or np.ptp(at_m[:, 1]) < 0.2:
        return None
    matrix = np.column_stack([np.ones(len(x_m)), at_m])
    weights = np.ones(len(x_m))
    solution = np.zeros(3)
    for step in range(_STEPS):
        root = np.sqrt(weights)
        solution = np.linalg.lstsq(matrix * root[:, None], x_m * root, rcond=None)[0]
        residual = np.abs(x_m - matrix @ solution)
        scale = max(1.4826 * float(np.median(residual)), 1e-4)
        if step < _HUBER_STEPS:  # Huber's weights lead to where Tukey's may begin
            weights = np.minimum(1.0, _HUBER * scale / np.maximum(residual, 1e-12))
        else:
            weights = np.maximum(1.0 - (residual / (_TUKEY * scale)) ** 2, 0.0) ** 2
    return FacePlane(*solution.tolist())

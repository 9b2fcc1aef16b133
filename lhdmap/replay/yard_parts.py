"""What sees and what touches things on open ground."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lhdmap.messages import FloatArray, PointCloud
from lhdmap.replay.parts import Touch
from lhdmap.replay.site_drive import SiteGround
from lhdmap.simulation.history import Column
from lhdmap.simulation.vehicle.kinematic import KinematicState
from lhdmap.simulation.yard import Yard

_RANGE_M, _NOISE_M, _FRAME = 60.0, 0.05, "base_link"
_FAR_M = 100.0


class Eyes:
    """A scanner of all around: points (N, 3) of things within 60 m in `base_link`, with noise; it knows no shadow."""

    def __init__(self, yard: Yard) -> None:
        self._yard = yard

    def __call__(self, stamp_ns: int, state: FloatArray, rng: np.random.Generator) -> PointCloud:
        """Return the points of now."""
        gap = self._yard.outlines_m - state[: Column.Z]
        gap = gap[np.hypot(*gap.T) < _RANGE_M]
        c, s = math.cos(state[Column.YAW]), math.sin(state[Column.YAW])
        own = gap @ np.array([[c, -s], [s, c]]) + _NOISE_M * rng.standard_normal(gap.shape)
        points = np.column_stack([own, np.ones(len(own))]).astype(np.float32)
        return PointCloud(stamp_ns, _FRAME, points, np.zeros(0, dtype=np.float32))


class YardBumper:
    """Tells which body is in a thing, and how far the nearest one is from a body's outline."""

    def __init__(self, ground: SiteGround, yard: Yard) -> None:
        self._ground, self._yard = ground, yard

    def touching(self, state: KinematicState) -> Sequence[Touch]:
        """Return the bodies that are in a thing."""
        if not len(self._yard.outlines_m):
            return ()
        touches = []
        for name, own, box in self._own(state):
            depth = np.minimum(own - box[0], box[1] - own).min(axis=1)
            worst = int(np.argmax(depth))
            if depth[worst] > 0.0:
                x, y = self._yard.outlines_m[worst].tolist()
                touches.append(Touch(name, (x, y, 0.0), float(depth[worst])))
        return touches

    def clearance_m(self, state: KinematicState) -> float:
        """Return the least distance of a body from a thing, metres; 100 where there is none."""
        if not len(self._yard.outlines_m):
            return _FAR_M
        gaps = [np.maximum(np.maximum(box[0] - own, own - box[1]), 0.0) for _, own, box in self._own(state)]
        return float(min(np.hypot(*gap.T).min() for gap in gaps))

    def _own(self, state: KinematicState) -> list[tuple[str, FloatArray, FloatArray]]:
        """Return name, outlines of things in its frame, box of each body."""
        x1, y1, back, _, _ = state.rear(self._ground.models[0])
        bodies, found = self._ground.bodies, []
        for name, x, y, heading, box in (
            ("front_body", state.x_m, state.y_m, state.yaw_rad, bodies.front_box_m),
            ("rear_body", x1, y1, back, bodies.rear_box_m),
        ):
            c, s = math.cos(heading), math.sin(heading)
            found.append((name, (self._yard.outlines_m - (x, y)) @ np.array([[c, -s], [s, c]]), box))
        return found

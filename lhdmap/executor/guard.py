"""The guard: sweeps both bodies along the braking path against raw points of the scanners. The second layer that stops.

A check on the plan is no check on the braking path (guidance findings, section 3). Points are raw: no map is between.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion
from lhdmap.executor.guard_kernel import Shape, braking_path, first_contact
from lhdmap.executor.settings import ExecutorSettings
from lhdmap.messages import FloatArray

_NO_PLAN = np.zeros((0, 2))
_FOR_EVER_S = 1e9
_BRAKE_SHARE = 0.9  # brakes that are so much weaker than the machine file's still stop before


class Swept(NamedTuple):
    """What the guard found: whether a contact is predicted, where in `base_link`, the way until it, the braking path's length.

    `contact`: a point comes within the margin; `hit`: into a body itself. `own`: points that are deep in a body where it stands,
    returns of the machine itself.
    """

    contact: bool
    hit: bool
    at_m: tuple[float, float] | None
    free_m: float
    stop_m: float
    own: int


class Guard:
    """Predicts contact on the braking path. `period_s`: how late a stop is asked for, such as at the next look."""

    def __init__(self, model: DriveModel, bodies: Bodies, settings: ExecutorSettings, period_s: float = 0.05) -> None:
        self._bodies, self._settings, self._period_s = bodies, settings, period_s
        corners = np.concatenate([_corners(bodies.front_box_m), _corners(bodies.rear_box_m)])
        self._far_m = float(np.hypot(corners[:, 0], corners[:, 1]).max())
        self.model = model

    def sweep(
        self,
        motion: Motion,
        points_m: FloatArray,
        *,
        commanded_mps: float | None = None,
        plan: FloatArray | None = None,
        age_s: float = 0.0,
        pull_mps2: float = 0.0,
    ) -> Swept:
        """Return what a brake that is asked for `period_s` from now meets.

        Args:
            motion: speed and joint of now.
            points_m: finite points (N, 2) of all scanners in `base_link`.
            commanded_mps: signed speed that is asked for; the drive may come that far before the brake does.
            plan: way and joint angle (K, 2) of the path from here, on which the executor brakes.
            age_s: of the points; the machine has moved on meanwhile.
            pull_mps2: gravity along x of the machine: positive where the nose is lower.
        """
        speed, late_s = self._speed(motion, commanded_mps, age_s), self._late_s(age_s)
        points = np.ascontiguousarray(points_m, dtype=float).reshape(-1, 2)
        settings, bodies = self._settings, self._bodies
        margins = settings.margin_m, settings.margin_growth, settings.own_body_m
        pull = max(math.copysign(1.0, speed) * pull_mps2, 0.0)
        timing = late_s, _BRAKE_SHARE * self.model.brake_mps2, self.model.brake_ramp_s, pull
        state = speed, motion.articulation_rad, motion.articulation_rate_rps
        worst = Swept(contact=False, hit=False, at_m=None, free_m=math.inf, stop_m=0.0, own=0)
        for ahead, held_s in self._assumed(plan, late_s):
            path = braking_path(state, self._shape(), timing, ahead, held_s)
            which, free_m, own = first_contact(path, points, bodies.front_box_m, bodies.rear_box_m, margins)
            worst = worst._replace(stop_m=max(worst.stop_m, float(path[-1, 0])), own=own)
            if which >= 0 and not worst.hit:
                inside = first_contact(path, points, bodies.front_box_m, bodies.rear_box_m, (0.0, 0.0, margins[2]))
                worst = worst._replace(hit=inside[0] >= 0)
            if free_m < worst.free_m:
                x, y = points[which].tolist()
                worst = worst._replace(contact=True, at_m=(x, y), free_m=free_m)
        return worst

    def _assumed(self, plan: FloatArray | None, late_s: float) -> tuple[tuple[FloatArray, float], ...]:
        """Return what the joint may do: plan, and for how long its rate is held before it follows the plan."""
        if plan is None or len(plan) == 0:  # held from when the brake comes, or on and on
            return (_NO_PLAN, late_s), (_NO_PLAN, _FOR_EVER_S)
        ahead = np.ascontiguousarray(plan, dtype=float)
        return (ahead, 0.0), (ahead, late_s)

    def _late_s(self, age_s: float) -> float:
        return self._period_s + age_s + self.model.dead_time_s

    def _speed(self, motion: Motion, commanded_mps: float | None, age_s: float) -> float:
        """Return the signed speed from which it must brake: what is asked for counts as far as the drive gets meanwhile."""
        speed = motion.speed_mps
        if commanded_mps is None or commanded_mps * speed < 0.0:
            return speed
        most = abs(speed) + self.model.acceleration_mps2 * self._late_s(age_s)
        return math.copysign(max(abs(speed), min(abs(commanded_mps), most)), commanded_mps if speed == 0.0 else speed)

    def _shape(self) -> Shape:
        model = self.model
        return model.front_m, model.rear_m, model.max_articulation_rad, model.max_rate_rps, self._far_m


def _corners(box: FloatArray) -> FloatArray:
    (x0, y0), (x1, y1) = box
    return np.array([(x0, y0), (x0, y1), (x1, y0), (x1, y1)])

"""The leading body: in reverse the rear one, seen from behind. Forward and reverse are one problem then, and both are stable.

In reverse the leading axle is the rear axle, its heading is turned by π, the joint's angle changes its sign, and the bodies are
exchanged (guidance findings, section 2).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.kernel import State
from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion
from lhdmap.geometry.articulated import rear_axle
from lhdmap.messages import FloatArray


class Lead(NamedTuple):
    """A direction of motion: `gear` 1 or -1, lengths from the joint to both axles, outline points (N, 2) of both bodies."""

    gear: int
    lead_m: float
    trail_m: float
    leading_m: FloatArray
    trailing_m: FloatArray

    def state(self, motion: Motion) -> State:
        """Return the leading axle's state of a motion."""
        bend = motion.articulation_rad
        if self.gear > 0:
            return motion.x_m, motion.y_m, motion.heading_rad, bend, motion.articulation_rate_rps
        x, y, rear = rear_axle(motion.x_m, motion.y_m, motion.heading_rad, bend, self.trail_m, self.lead_m)
        return x, y, rear + math.pi, -bend, -motion.articulation_rate_rps

    def speed_mps(self, motion: Motion) -> float:
        """Return the leading axle's speed in the direction of motion; the rear axle's is the front one's seen over the joint."""
        if self.gear > 0:
            return motion.speed_mps
        bend, rate = motion.articulation_rad, motion.articulation_rate_rps
        # v_r = v_f cos γ + L_f (dθ_f/dt) sin γ: the joint moves with one velocity
        turn = (motion.speed_mps * math.sin(bend) + self.lead_m * rate) / (self.trail_m * math.cos(bend) + self.lead_m)
        return -(motion.speed_mps * math.cos(bend) + self.trail_m * turn * math.sin(bend))

    def base(self, state: State) -> tuple[float, float, float]:
        """Return x, y, heading of `base_link` of a leading axle's state."""
        x, y, heading, bend, _ = state
        if self.gear > 0:
            return x, y, heading
        back = heading - bend
        return (
            x - self.lead_m * math.cos(heading) - self.trail_m * math.cos(back),
            y - self.lead_m * math.sin(heading) - self.trail_m * math.sin(back),
            back + math.pi,
        )


def lead_of(gear: int, model: DriveModel, bodies: Bodies) -> Lead:
    """Return the leading body of a gear."""
    if gear > 0:
        return Lead(1, model.front_m, model.rear_m, bodies.front_m, bodies.rear_m)
    return Lead(-1, model.rear_m, model.front_m, -bodies.rear_m, -bodies.front_m)

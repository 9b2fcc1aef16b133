"""How far a machine is: along its legs, from try to try where it is stuck, and what others allow it."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.lead import lead_of
from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion
from lhdmap.guidance.directive import WAY
from lhdmap.messages import FloatArray
from lhdmap.navigation.along import along_m
from lhdmap.navigation.hold import ROOM_M
from lhdmap.navigation.leg import Leg

_PAUSE_NS = 1_000_000_000  # ten turns: one that overruns is none


class Allowed:
    """What others say of the way: it is set from outside, and asked in each step.

    `may_move`: whether the machine is armed: one that is not does not move, and is not stuck; `free`: nodes (ids) that may be
    entered, None: all; `avoid`: nodes (ids) that routes touch only where they begin or end: others come there; `closed`: ways
    (names, or `A:B`) that are closed; `sight_m`: how far the path ahead is seen free, as guidance tells.
    """

    def __init__(self) -> None:
        self.may_move = True
        self.free: Collection[str] | None = None
        self.avoid: tuple[str, ...] = ()
        self.closed: tuple[str, ...] = ()
        self.sight_m = math.inf


class DrivenBody:
    """The machine as navigation sees it: the axle that leads in each gear, and how far the body reaches before and behind it."""

    def __init__(self, model: DriveModel, bodies: Bodies) -> None:
        self.wheelbase_m = model.wheelbase_m
        self.nose_m = float(bodies.front_m[:, 0].max())
        self.tail_m = model.wheelbase_m - float(bodies.rear_m[:, 0].min())
        self.leads = {gear: lead_of(gear, model, bodies) for gear in (1, -1)}

    def reach_m(self, gear: int) -> float:
        """Return how far the machine reaches before its leading axle, and the room kept before a node that is not free."""
        return (self.nose_m if gear > 0 else self.tail_m - self.wheelbase_m) + ROOM_M


class LegProgress:
    """The legs of a route, the one that is driven (`leg`), its next `target`, and where along its path the machine is (`at_m`).

    `begun_m`: where along its path the leg was begun; `driven_m`: way by the odometry since the target before.
    """

    def __init__(self) -> None:
        self.legs: list[Leg] = []
        self.leg = self.target = 0
        self.at_m = self.driven_m = self.speed_mps = 0.0
        self.begun_m: float | None = None
        self._of_leg = False  # `at_m`: not that of the leg before
        self._before: FloatArray | None = None
        self._asked_ns = 0

    def begin(self, legs: list[Leg]) -> None:
        """Begin a route."""
        self.legs, self.leg, self.target = legs, 0, 0
        self.driven_m, self.begun_m, self._of_leg = 0.0, None, False

    def place(self, path: FloatArray, x: float, y: float) -> None:
        """Take where the leading axle is, on the path (N, 6) of the leg in the same frame."""
        self.at_m = along_m(path, x, y, self.at_m if self._of_leg else None)
        self._of_leg = True
        self.begun_m = self.at_m if self.begun_m is None else self.begun_m

    @property
    def now(self) -> Leg:
        """The leg that is driven."""
        return self.legs[self.leg]

    def stopped(self) -> bool:
        """Take the end of a leg; return whether it was the last one."""
        self.leg += 1
        self.target, self.driven_m, self.begun_m, self._of_leg = 0, 0.0, None, False
        return self.leg == len(self.legs)

    def paused(self, now_ns: int) -> bool:
        """Take a turn; return whether nobody has asked for a while: what others have driven since is no way towards a target."""
        before_ns, self._asked_ns = self._asked_ns, now_ns
        paused = now_ns - before_ns > _PAUSE_NS
        if paused:
            self.driven_m, self._before = 0.0, None
        return paused

    def count(self, motion: Motion, *, backs: bool) -> None:
        """Count the way since the motion before; what is backed up is driven again."""
        self.speed_mps = motion.speed_mps
        place = np.array([motion.x_m, motion.y_m])
        if self._before is not None:
            step_m = float(np.linalg.norm(place - self._before))
            self.driven_m += -step_m if backs else step_m
        self._before = place

    @property
    def left_m(self) -> float:
        """Way to the end of the last leg."""
        rest_m = sum(leg.stop_m - float(leg.path[0, WAY]) for leg in self.legs[self.leg + 1 :])
        return self.now.stop_m - self.at_m + rest_m

    @property
    def length_m(self) -> float:
        """Length of the node of the target, as far as the leg goes through it."""
        leg = self.now
        before = leg.targets[self.target - 1].at_m if self.target > 0 else self.begun_m or 0.0
        end = leg.stop_m if self.target == len(leg.targets) - 1 else 0.0
        return max(leg.targets[self.target].at_m, end) - before


class BackUps:
    """How often, and where, a machine that was stuck has backed up; `leg`: the way back, while it does."""

    def __init__(self) -> None:
        self.tries = 0
        self.at_m = -math.inf
        self.leg: Leg | None = None

    def begin(self) -> None:
        """Forget those of another route."""
        self.tries, self.at_m = 0, -math.inf

    def back(self, leg: Leg, at_m: float, wheelbase_m: float, back_up_m: float) -> None:
        """Count a try at a place of a leg, and lay the way back."""
        self.tries += 1
        self.at_m = at_m
        back = leg.path[::-1].copy()
        back[:, 2] += math.pi
        back[:, 5] = leg.path[-1, 5] - leg.path[::-1, 5]
        begin = back[-1, 5] - at_m + wheelbase_m  # the other axle leads, a wheelbase behind
        self.leg = Leg(-leg.gear, back, begin + back_up_m, begin, (), True)

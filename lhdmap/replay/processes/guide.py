"""Guidance as a process."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Setpoint
from lhdmap.executor.limits import pull_mps2, speed_bound
from lhdmap.geometry.polygon import inside
from lhdmap.guidance.directive import SPEED, Directive
from lhdmap.guidance.ghosts import Eye
from lhdmap.guidance.local_walls import LocalWalls
from lhdmap.guidance.planner import Guidance
from lhdmap.messages import Command
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import DIRECTIVE, MILLISECOND_NS, ORDERS, PLAN, POSE, SEEN, Outgoing, Process, Received
from lhdmap.replay.processes.feed import MOTION_TOPICS, MotionFeed
from lhdmap.replay.processes.told import Asked, Idle, Seen
from lhdmap.roles import ROLES

GUIDANCE = "guidance"
_COMMAND = ROLES["command"].topic
_ASKED_NS = 500 * MILLISECOND_NS
_LATE_S = 0.05  # so old a plan gets, and so long until the executor's next look
_OF_BOUND = 0.8  # downhill the drive holds a machine at a speed that is somewhat above the one that it is asked for


class Guide(Process):
    """A plan each 50 ms while there is a fresh directive; its journal has what limits the speed.

    `jumps`: whether scan and pose are so far apart (m, rad) that hits of before and after do not go together.
    """

    name, period_ns, latency_ns, priority = GUIDANCE, 50 * MILLISECOND_NS, 10 * MILLISECOND_NS, 30
    reads = (*MOTION_TOPICS, SEEN, DIRECTIVE, ORDERS, _COMMAND)

    def __init__(
        self,
        guidance: Guidance,
        jumps: Callable[[float, float], bool],
        scribe: Scribe,
        *,
        models: tuple[DriveModel, DriveModel] | None = None,
    ) -> None:
        """`models`: of the empty and the loaded machine, where a mission says which it is."""
        self._models, self._loaded = models, False
        self._guidance, self._jumps, self._scribe = guidance, jumps, scribe
        self._feed, self._walls = MotionFeed(), LocalWalls(guidance.settings.memory_m)
        self._sent: deque[Setpoint] = deque(maxlen=100)
        self._asked: Asked | None = None
        self._seen_ns: int | None = None
        self._pull_mps2 = 0.0
        scribe.goes("waiting", "no directive")

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Take what has come and plan."""
        for received in inbox:
            self._take(received)
        motion, asked = self._feed.motion, self._asked
        if motion is None or asked is None or self._seen_ns is None or asked.directive is None:
            self._guidance.forget()
            self._scribe.goes("waiting", "no directive" if asked is None else asked.cause)
            yield Outgoing(PLAN, Idle(now_ns))
            return
        if now_ns - asked.stamp_ns > _ASKED_NS:
            self._scribe.goes("waiting", "directive too old")
            return
        walls = self._walls.points()
        for pile_m in (asked.touched_m, asked.pile_m):
            if pile_m is not None:
                walls = walls[~inside(walls, pile_m)]
        directive = within_brakes(asked.directive, self._guidance, self._pull_mps2)
        plan = self._guidance.plan(now_ns, motion, tuple(self._sent), walls, directive)
        gear = "forward" if plan.gear > 0 else "reverse"
        self._scribe.goes(gear, "directive", clearance_m=round(plan.clearance_m, 3), by=plan.speeds.by)
        yield Outgoing(PLAN, plan)

    def _take(self, received: Received) -> None:
        topic, _, message = received
        if topic == SEEN:
            if self._jumps(message.apart_m, message.apart_rad):
                self._walls.clear()
            self._walls.add(message.pose_odom, message.points_m, self._eyes(message))
            self._seen_ns = message.stamp_ns
        elif topic == DIRECTIVE:
            self._asked = message
        elif topic == ORDERS:
            if self._models is not None and message.loaded != self._loaded:
                self._loaded = message.loaded
                self._guidance.loaded(self._models[self._loaded])
        elif topic == _COMMAND:
            self._sent.append(self._as_setpoint(message, received.sent_ns))
        else:
            self._feed.take(received)
            if topic == POSE:
                self._pull_mps2 = pull_mps2(message.T_odom_base)

    def _eyes(self, seen: Seen) -> list[Eye]:
        """Return the scanners with their hits, in `base_link`."""
        motion = self._feed.motion
        if motion is None:
            return []
        front, rear = self._guidance.eyes_in_base(motion.articulation_rad)
        return [Eye(front, seen.points_m[: seen.front]), Eye(rear, seen.points_m[seen.front :])]

    def _as_setpoint(self, command: Command, sent_ns: int) -> Setpoint:
        speed = 0.0 if command.brake else command.propel * self._guidance.model.top_speed_mps
        return Setpoint(sent_ns, speed, command.steering_rate_rps)


def within_brakes(directive: Directive, guidance: Guidance, along_mps2: float) -> Directive:
    """Return a directive that is slow enough downhill: the executor's full brake has to end within a plan, Eq. (20).

    `along_mps2`: gravity along x of the machine (`pull_mps2`). Planned faster, it brakes fully each few seconds down a ramp.
    """
    plan_s = guidance.settings.stages * guidance.settings.stage_s - _LATE_S
    bound_mps = _OF_BOUND * speed_bound(guidance.model, plan_s, _LATE_S, directive.gear * along_mps2)
    if float(directive.path[:, SPEED].max(initial=0.0)) <= bound_mps:
        return directive
    path = directive.path.copy()
    path[:, SPEED] = np.minimum(path[:, SPEED], bound_mps)
    return directive._replace(path=path)

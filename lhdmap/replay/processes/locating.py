"""Perception on a map as a process: odometry and localization in one, fed with what comes over the bus and nothing else."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from lhdmap.config import Settings
from lhdmap.loading.states import ASSISTANCE, State
from lhdmap.localization.agreement import Agreement
from lhdmap.localization.rows import TRACKING
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.navigation.along import Located
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.pipeline.localize import Localizer, LocalizerOptions
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import LOADING, LOCATED, MILLISECOND_NS, PILE, POSE, SEEN, Outgoing, Process, Received
from lhdmap.replay.processes.perception import PERCEPTION
from lhdmap.replay.processes.scouting import PileAhead, live
from lhdmap.replay.processes.told import Seen
from lhdmap.roles import BUILD_MAP, ROLES, read_by

_ROLE_OF = {ROLES[name].topic: name for name in read_by(BUILD_MAP)}


# Before a pile that has been dug since the map was made, what is seen is not what the map has.
_DIGS = (
    State.POSITIONING,
    State.CHARGING,
    State.EXCAVATION,
    State.PULL_BACK,
    State.WEIGHING,
    State.HELD,
    *ASSISTANCE,
)


class Locating(Process):
    """Gives the pose of now in `odom`, the hits of each processed scan, and the place on the map."""

    name, period_ns, priority = PERCEPTION, 20 * MILLISECOND_NS, 10
    reads = (*_ROLE_OF, LOADING)

    def __init__(
        self,
        known: KnownMap,
        settings: Settings,
        machine: Machine,
        start: FloatArray | None,
        scribe: Scribe,
        *,
        pile: PileAhead | None = None,
    ) -> None:
        """`pile`: looks for piles on the way; each new estimate is told."""
        self._scribe, self._pile, self._told_ns = scribe, pile, 0
        self._seen: list[Seen] = []
        self.localizer = Localizer(
            known, live(settings), machine, start, LocalizerOptions(listener=self._listen, pile=pile, newest_only=True)
        )
        self._agreement = Agreement(self.localizer.pipeline.front_end.wheels.motion_between)
        scribe.goes("waiting", "no scan yet")

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Feed what has come; tell the pose of now, and what new scans have told."""
        self._feed(inbox)
        pose = self.localizer.pipeline.pose_at(now_ns)
        if pose is None:
            return
        yield Outgoing(POSE, pose)
        seen, self._seen = self._seen, []
        for one in seen:
            yield Outgoing(SEEN, one)
        newest = None if self._pile is None else self._pile.newest
        if newest is not None and newest.stamp_ns != self._told_ns:
            self._told_ns = newest.stamp_ns
            yield Outgoing(PILE, newest)
        fix = self.localizer.fix
        if seen and fix is not None:
            row = self.localizer.rows[-1]
            self._scribe.goes(fix.status, row.source, node=row.node, rho_m=row.rho_m, lateral_m=row.lateral_m)
            yield Outgoing(
                LOCATED,
                Located(fix.stamp_ns, fix.status, fix.pose_map, fix.pose_odom, fix.covariance, fix.height_m),
            )

    def finish(self, now_ns: int, inbox: Sequence[Received]) -> None:
        """End the stream."""
        self._feed(inbox)
        with self.localizer:
            self.localizer.finish()

    def _feed(self, inbox: Sequence[Received]) -> None:
        for received in inbox:
            if received.topic == LOADING:
                now = received.message
                looks_again = now.state == State.IDENTIFICATION and now.attempts > 0
                self.localizer.keeper.digs = now.state in _DIGS or looks_again
            else:
                self.localizer.update(_ROLE_OF[received.topic], received.message)

    def _listen(self, stamp_ns: int, step: OdometryStep, odometry: PlanarOdometry) -> None:
        if not step.processed:
            return
        points = np.concatenate([part[:, :2] for part in (odometry.points, odometry.points_behind)])
        self._seen.append(Seen(stamp_ns, step.pose_odom_base.copy(), points, *self._apart(step), len(odometry.points)))

    def _apart(self, step: OdometryStep) -> tuple[float, float]:
        """Return by how much pose and scan disagree; infinite where the scan does not fit at all."""
        by_wheels = self._agreement.of_motion(step.time_ns, step.pose_odom_base)
        fix = self.localizer.fix
        by_map = (0.0, 0.0)
        if fix is not None:
            by_map = self._agreement.of_map(fix.pose_map, fix.pose_odom, known=fix.status == TRACKING)
        if self.localizer.pipeline.records.lost_now:
            return math.inf, math.inf
        return max(by_wheels[0], by_map[0]), max(by_wheels[1], by_map[1])

"""Perception on a map as a process: odometry and localization in one, fed with what comes over the bus and nothing else."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from lhdmap.config import Settings
from lhdmap.loading.states import ASSISTANCE, State
from lhdmap.localization.agreement import Agreement
from lhdmap.localization.floor import NO_FLOOR, FloorOnMap, over_floor
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


_PILE_M = 10.0  # so near to where it weighed its bucket, the pile is most of what is ahead


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
        self._floor, self._least_m = FloorOnMap(known.topology), settings.odometry.min_height_m
        self._agreement = Agreement(self.localizer.pipeline.front_end.wheels.motion_between)
        self._dug_at: FloatArray | None = None
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
                self.localizer.keeper.digs = self._beside_its_pile(digs=now.state in _DIGS or looks_again)
            else:
                self.localizer.update(_ROLE_OF[received.topic], received.message)

    def _beside_its_pile(self, *, digs: bool) -> bool:
        """Return whether the machine is before a pile that it has dug, and what it sees ahead is not what the map has."""
        here = np.array(self.localizer.pipeline.track.newest[:2])
        if len(here) < 2:
            return digs
        if digs:
            self._dug_at = here
        elif self._dug_at is not None and not float(np.hypot(*(here - self._dug_at))) < _PILE_M:
            self._dug_at = None
        return self._dug_at is not None

    def _listen(self, stamp_ns: int, step: OdometryStep, odometry: PlanarOdometry) -> None:
        if not step.processed:
            return
        floor_m = self._floor_about()
        front, rear = (self._walls(part, step, floor_m) for part in (odometry.points, odometry.points_behind))
        points, apart = np.concatenate([front, rear]), self._apart(step)
        self._seen.append(Seen(stamp_ns, step.pose_odom_base.copy(), points, *apart, len(front), floor_m))

    def _floor_about(self) -> FloatArray:
        """Return the floor about the machine (K, 3), where its place is known."""
        fix = self.localizer.fix
        if fix is None or fix.status != TRACKING:
            return NO_FLOOR
        return self._floor.about(fix.pose_map, fix.height_m, fix.pose_odom)

    def _walls(self, points: FloatArray, step: OdometryStep, floor_m: FloatArray) -> FloatArray:
        """Return hits (N, 2) of points (N, 3) that are none of a floor that rises ahead."""
        level = points - [0.0, 0.0, self.localizer.pipeline.track.height_m]
        kept: FloatArray = points[over_floor(level, step.pose_odom_base, floor_m, self._least_m), :2]
        return kept

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

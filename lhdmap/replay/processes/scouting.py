"""Perception at a draw point as a process: odometry without a map, hits of each scan, and the pile ahead."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from lhdmap.config import Settings
from lhdmap.localization.agreement import Agreement
from lhdmap.machine import Machine
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pile.result import PileReport, Snapshot
from lhdmap.pile.stage import PileStage
from lhdmap.pipeline.mapping import MappingOptions, MappingPipeline
from lhdmap.pipeline.pile import PlacedScan
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import MILLISECOND_NS, PILE, POSE, SEEN, Outgoing, Process, Received
from lhdmap.replay.processes.perception import PERCEPTION
from lhdmap.replay.processes.told import Seen
from lhdmap.roles import BUILD_MAP, ROLES, read_by

_ROLE_OF = {ROLES[name].topic: name for name in read_by(BUILD_MAP)}
_STEP_S = 0.08  # a machine that stands or creeps has to know so, too
_HALF_WINDOW_S = 0.08  # scans wait for the inclinometer's filter: a control loop has less time than a map


def live(settings: Settings) -> Settings:
    """Return settings for a control loop: often, and soon."""
    often = replace(settings.odometry, step_s=min(settings.odometry.step_s, _STEP_S))
    soon = replace(settings.attitude, half_window_s=min(settings.attitude.half_window_s, _HALF_WINDOW_S))
    return replace(settings, odometry=often, attitude=soon)


class PileAhead:
    """The pile stage as perception asks it: `newest` is the last estimate of the pile that the machine drives towards."""

    def __init__(self, settings: Settings) -> None:
        self._stage = PileStage(settings.pile)
        self.newest: Snapshot | None = None

    def update(self, scan: PlacedScan) -> None:
        """Take one scan."""
        snapshot = self._stage.update(scan.hits())
        if snapshot is not None:
            self.newest = snapshot

    def report(self) -> PileReport:
        """Return what is said of the pile so far."""
        return self._stage.report()


class Scouting(Process):
    """Gives the pose of now in `odom`, the hits of each processed scan, and each new estimate of the pile."""

    name, period_ns, priority = PERCEPTION, 20 * MILLISECOND_NS, 10
    reads = tuple(_ROLE_OF)

    def __init__(self, settings: Settings, machine: Machine, scribe: Scribe) -> None:
        self.pile = PileAhead(settings)
        self.pipeline = MappingPipeline(
            live(settings), machine, MappingOptions(cloud=False, pile=self.pile, on_step=self._listen, kept=False)
        )
        self._agreement = Agreement(self.pipeline.front_end.wheels.motion_between)
        self._scribe, self._seen = scribe, list[Seen]()
        self._told_ns = 0
        scribe.goes("waiting", "no scan yet")

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Feed what has come; tell the pose of now, and what new scans have told."""
        self._feed(inbox)
        pose = self.pipeline.pose_at(now_ns)
        if pose is None:
            return
        yield Outgoing(POSE, pose)
        self._scribe.goes("lost" if self.pipeline.records.lost_now else "tracking", "scans")
        seen, self._seen = self._seen, []
        for one in seen:
            yield Outgoing(SEEN, one)
        newest = self.pile.newest
        if newest is not None and newest.stamp_ns != self._told_ns:
            self._told_ns = newest.stamp_ns
            yield Outgoing(PILE, newest)

    def finish(self, now_ns: int, inbox: Sequence[Received]) -> None:
        """End the stream."""
        self._feed(inbox)
        with self.pipeline:
            self.pipeline.finish()

    def _feed(self, inbox: Sequence[Received]) -> None:
        for received in inbox:
            self.pipeline.update(_ROLE_OF[received.topic], received.message)

    def _listen(self, stamp_ns: int, step: OdometryStep, odometry: PlanarOdometry) -> None:
        if not step.processed:
            return
        points = np.concatenate([part[:, :2] for part in (odometry.points, odometry.points_behind)])
        apart = self._agreement.of_motion(step.time_ns, step.pose_odom_base)
        if self.pipeline.records.lost_now:
            apart = math.inf, math.inf
        self._seen.append(Seen(stamp_ns, step.pose_odom_base.copy(), points, *apart, len(odometry.points)))

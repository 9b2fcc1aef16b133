"""Perception as a process: the mapping pipeline, fed message by message with what comes over the bus, and with nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from lhdmap.config import Settings
from lhdmap.machine import Machine
from lhdmap.pipeline.mapping import MappingOptions, MappingPipeline
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import MILLISECOND_NS, POSE, Outgoing, Process, Received
from lhdmap.roles import BUILD_MAP, ROLES, read_by

PERCEPTION = "perception"
_ROLE_OF = {ROLES[name].topic: name for name in read_by(BUILD_MAP)}


class Perception(Process):
    """Odometry of the front scanner, without a cloud and without a look for piles; gives the pose of now.

    Its journal has when it started, and when the walls were lost and found again.
    """

    name, period_ns, priority = PERCEPTION, 40 * MILLISECOND_NS, 10
    reads = tuple(_ROLE_OF)

    def __init__(self, settings: Settings, machine: Machine, scribe: Scribe) -> None:
        without_pile = replace(settings, pile=replace(settings.pile, method="off"))
        self.pipeline = MappingPipeline(without_pile, machine, MappingOptions(cloud=False, kept=False))
        self._scribe = scribe
        scribe.goes("waiting", "no scan yet")

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Feed what has come, and tell the pose of now once there is one."""
        self._feed(inbox)
        pose = self.pipeline.pose_at(now_ns)
        if pose is not None:
            self._tell(pose.age_s)
            yield Outgoing(POSE, pose)

    def finish(self, now_ns: int, inbox: Sequence[Received]) -> None:
        """End the stream."""
        self._feed(inbox)
        with self.pipeline:
            self.pipeline.finish()

    def _feed(self, inbox: Sequence[Received]) -> None:
        for received in inbox:
            self.pipeline.update(_ROLE_OF[received.topic], received.message)

    def _tell(self, age_s: float) -> None:
        x, y, z, _, _, heading = self.pipeline.track.newest
        lost = self.pipeline.records.lost_now
        at = {"x_m": x, "y_m": y, "z_m": z, "heading_rad": heading, "age_s": age_s}
        if lost:
            self._scribe.goes("lost", "scans do not match", **at)
        else:
            cause = {"waiting": "first scans matched", "lost": "scans match again"}.get(self._scribe.state, "")
            self._scribe.goes("tracking", cause, **at)

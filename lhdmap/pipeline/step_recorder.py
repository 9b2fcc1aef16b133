"""Records the steps of the odometry: a row each with its speed and the wheels' slip, and how sure the newest pose is."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.odometry.cloud.steps import CloudStep
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pipeline.pose_now import Newest
from lhdmap.pipeline.records import ScanRecords
from lhdmap.proprioception.slip import SkidFactor, SlipSettings
from lhdmap.proprioception.wheels import WheelOdometry

_PLANAR = [3, 4, 2]  # of a twist (rotation before translation): x, y, heading
_NOT_KNOWN = np.full(3, math.nan)


class StepRecorder:
    """`believe`, then `record` each processed step; `records` are the rows, `newest` what the odometry knows of its pose."""

    def __init__(self, wheels: WheelOdometry, settings: SlipSettings, *, kept: bool = True) -> None:
        self.records = ScanRecords(kept=kept)
        self.newest = Newest(np.zeros((3, 3)), np.zeros(3), None)
        self._wheels, self._slip = wheels, SkidFactor(settings)

    def believe(self, step: OdometryStep, odometry: PlanarOdometry) -> None:
        """Take over how sure the pose of a step is."""
        believed = odometry.wheels.use.used
        self.newest = Newest(step.covariance, step.velocity, odometry.wheels.scale if believed else None)

    def believe_cloud(self, step: CloudStep) -> None:
        """Take over how sure the pose of a 3D scanner's step is."""
        self.newest = Newest(step.covariance[np.ix_(_PLANAR, _PLANAR)], step.velocity, 1.0)

    def record(
        self, stamp_ns: int, time_ns: int, step: OdometryStep | CloudStep, odometry: PlanarOdometry | None
    ) -> None:
        """Add the row of a step: its scan's stamp, its time, and the odometry that knows the wheels' scale, if any does."""
        wheel_mps = self._wheels.speed_at(time_ns)
        speed_mps = float(step.velocity[0])
        scale = 1.0 if odometry is None else odometry.wheels.scale
        # Where the walls did not show the speed, it is the wheels' own.
        wheel, seen = (math.nan if wheel_mps is None else wheel_mps / scale), math.nan if step.degenerate else speed_mps
        match_, flags = (step.residual_m, step.support), (step.degenerate, step.lost)
        wheels = step.wheels, self._slip.update(time_ns, wheel, seen)
        std = step.error.deviations if isinstance(step, OdometryStep) else _NOT_KNOWN
        self.records.add_processed(stamp_ns, match_, (step.information, std), step.substitute, flags, wheels)
        self.records.add_motion(time_ns, speed_mps, wheel_mps, self._wheels.articulation_at(time_ns))

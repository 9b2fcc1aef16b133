"""The scans once more, at their final poses."""

from __future__ import annotations

from lhdmap.logs.source import LogSource
from lhdmap.logs.survey import Survey
from lhdmap.machine import Machine
from lhdmap.messages import Joints, LaserScan, PointCloud
from lhdmap.pipeline.inputs import Inputs
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.sweep_times import SweepTimes
from lhdmap.pipeline.sweeps import SweepIntegration
from lhdmap.pipeline.track import FinalTrack, TrackRows
from lhdmap.proprioception.wheels import WheelOdometry


def integrate_again(
    inputs: Inputs, pipeline: MappingPipeline, rows: TrackRows, survey: Survey | None = None
) -> SweepIntegration:
    """Read the scans once more and integrate them at their final poses: closed loops have moved them, or they are given.

    Sweeps before the first pose or after the last are left out. `survey`: of these logs, where one was taken.
    """
    sweeps = SweepIntegration(inputs.settings, pipeline.machine, pipeline.front_end.mounts, None)
    wheels = WheelOdometry(inputs.settings.wheels, pipeline.machine or Machine())
    track, times, sweep_times = FinalTrack(rows), map(int, pipeline.records.times_ns), SweepTimes()
    with LogSource(
        list(inputs.logs), inputs.topics, force=inputs.force, survey=survey, window_ns=inputs.window_ns
    ) as source:
        for role, message in source.messages(
            [role for role in ("front", "rear", "points", "joints") if role in source.roles]
        ):
            if isinstance(message, Joints):
                wheels.update(message)
            elif isinstance(message, (LaserScan, PointCloud)):
                time_ns = next(times, message.stamp_ns) if role == "front" else message.stamp_ns
                message = sweep_times.checked(role, message)
                sweeps.add_final(role, time_ns, message, track, wheels)
    sweeps.wait(track, wheels)
    return sweeps

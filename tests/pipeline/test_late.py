"""Scans that a slow link holds up come behind newer ones: left out where other sensors tell that the clock ran on."""

from __future__ import annotations

import numpy as np
from lhdmap.config import Settings
from lhdmap.geometry import se2
from lhdmap.messages import LaserScan, Message
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pipeline.localizer_inputs import FromOdometry
from lhdmap.pipeline.mapping import MappingOptions, MappingPipeline
from lhdmap.pipeline.scan_order import OverdueScans

from tests.localization.known import drive

LATE_NS, SECOND_NS = 780_000_000, 1_000_000_000


def test_a_drive_with_late_scans_is_as_without_them() -> None:
    """As in a mission whose scans of 0.8 s came that much later: the odometry ended 30 m off, turned round."""
    stream, poses = drive(5.0, 25.0)
    scans = [message for role, message in stream if role == "front"]
    begin_ns = scans[len(scans) // 2].stamp_ns

    def arrives_ns(one: tuple[str, Message]) -> int:
        role, message = one
        late = role == "front" and begin_ns <= message.stamp_ns < begin_ns + LATE_NS
        return message.stamp_ns + (LATE_NS if late else 0)

    pipeline = MappingPipeline(Settings(), None, MappingOptions(cloud=False))
    for role, message in sorted(stream, key=arrives_ns):
        pipeline.update(role, message)
    pipeline.finish()
    rows = pipeline.track.rows()
    told = rows.poses[-1][[0, 1, 5]]
    off = se2.between(se2.between(poses[0], poses[-1]), told)
    assert np.hypot(off[0], off[1]) < 0.3
    assert abs(off[2]) < 0.02
    count = sum(begin_ns <= scan.stamp_ns < begin_ns + LATE_NS for scan in scans)
    left_out = [one for one in pipeline.warnings if "came behind newer ones" in one]
    assert len(left_out) == 1
    assert int(left_out[0].split()[0]) == count - 1  # the first of them is the newest that has come


def test_without_another_clock_or_where_it_was_set_back_the_order_tells_more() -> None:
    stream, _ = drive(5.0, 14.0)
    scan = next(message for _, message in stream if isinstance(message, LaserScan))
    newest_ns = scan.stamp_ns + SECOND_NS
    late = OverdueScans()
    assert not late.is_late(scan, newest_ns)
    late.hear(scan.stamp_ns + SECOND_NS)
    assert late.is_late(scan, newest_ns)
    late.hear(scan.stamp_ns)  # all clocks show less
    assert not late.is_late(scan, newest_ns)
    assert late.count == 1
    assert late.warnings()


def test_a_step_that_the_scans_did_not_tell_is_the_wheels() -> None:
    """Scans that fit nowhere carry an odometry away, and back with the first that fits: neither moves the place on a map."""
    stream, poses = drive(5.0, 14.0)
    steps: list[tuple[int, OdometryStep, PlanarOdometry]] = []
    options = MappingOptions(cloud=False, on_step=lambda *one: steps.append(one))
    pipeline = MappingPipeline(Settings(), None, options)
    for role, message in stream:
        pipeline.update(role, message)
    pipeline.finish()
    taken = FromOdometry(pipeline, Settings().localization, 0.0)
    (_, before, _), (_, step, _), (_, after, _) = steps[100:103]
    truth = se2.between(poses[100], poses[101])
    away = np.array([3.0, 1.0, 0.5])
    moved, _, _ = taken.motion(away, step._replace(lost=True), before.time_ns)
    assert np.abs(moved - truth).max() < 0.02  # the wheels are 1 % too fast
    back, _, _ = taken.motion(-away, after._replace(lost=False), step.time_ns)
    assert np.abs(back - se2.between(poses[101], poses[102])).max() < 0.02
    again, _, _ = taken.motion(truth, after._replace(lost=False), step.time_ns)
    assert again is truth

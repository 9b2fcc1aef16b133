"""The pose of now: near the one that the pipeline gives later, honest about its age, and causal."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.config import Settings
from lhdmap.geometry import se3
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.messages import Mount, Tachometer
from lhdmap.pipeline.front_end import FrontEnd
from lhdmap.pipeline.mapping import MappingOptions, MappingPipeline
from lhdmap.pipeline.pose_now import Newest, PoseNow, pose_now
from lhdmap.pipeline.track import FinalTrack, Track
from lhdmap.simulation.drive import SimulatedDrive

SECOND = 10**9


def _asked(drive: SimulatedDrive, roles: list[str]) -> tuple[list[PoseNow], FinalTrack]:
    """Ask with each message for the pose of its time; return the answers and the path that was known in the end."""
    pipeline, found = MappingPipeline(Settings(), Machine(), MappingOptions(cloud=False)), []
    with LogSource([drive.log]) as source, pipeline:
        for role, message in source.messages(roles):
            pipeline.update(role, message)
            pose = None if isinstance(message, Mount) else pipeline.pose_at(message.stamp_ns)
            found += [] if pose is None else [pose]
        pipeline.finish()
    return found, FinalTrack(pipeline.track.rows())


@pytest.mark.parametrize(("wheels", "most_m", "source"), [(True, 0.04, "wheels"), (False, 0.12, "motion")])
def test_the_pose_of_now_is_near_the_one_that_comes_later(
    drive: SimulatedDrive, wheels: bool, most_m: float, source: str
) -> None:
    roles = ["tf_static", "front", "inclinometer", *(["tachometer", "joints"] if wheels else [])]
    found, path = _asked(drive, roles)
    late = [one for one in found if one.age_s > 0.1]
    assert len(late) > 0.5 * len(found)  # the pipeline is late by design
    assert max(one.age_s for one in late[100:]) < 0.6
    later = path.matrices_at(np.array([one.stamp_ns for one in late]))
    off = np.array([(se3.inverse(T) @ one.T_odom_base)[:3, 3] for T, one in zip(later, late, strict=True)])
    assert float(np.sqrt((off[:, :2] ** 2).sum(axis=1).mean())) < most_m
    assert float(np.abs(off[:, 2]).max()) < 0.05
    assert {one.source for one in late[100:]} == {source}


def _track(heading_rad: float = 0.3) -> Track:
    track = Track()
    track.append(0, np.array([0.0, 0.0, heading_rad]), 0.0, 0.0)
    track.append(SECOND, np.array([2.0, 1.0, heading_rad]), 0.0, 0.0)
    return track


def test_by_the_last_motion_it_goes_on_along_the_arc() -> None:
    front, settings = FrontEnd(Settings(), None), Settings().odometry
    turning = Newest(np.zeros((3, 3)), np.array([2.0, 0.0, 0.5]), None)
    pose = pose_now(2 * SECOND, _track(), turning, front, settings)
    chord = 2.0 * 2.0 / 0.5 * math.sin(0.25)  # radius 4 m, half a radian
    assert pose.source == "motion"
    assert pose.age_s == 1.0
    x, y = 2.0 + chord * math.cos(0.55), 1.0 + chord * math.sin(0.55)
    assert pose.T_odom_base[:2, 3] == pytest.approx([x, y], rel=0.02)
    assert math.atan2(pose.T_odom_base[1, 0], pose.T_odom_base[0, 0]) == pytest.approx(0.8)


def test_an_uncertain_heading_makes_what_lies_ahead_uncertain_across() -> None:
    front, settings = FrontEnd(Settings(), None), Settings().odometry
    known = Newest(np.diag([0.0, 0.0, 0.01**2]), np.array([3.0, 0.0, 0.0]), None)
    still = pose_now(SECOND, _track(), known, front, settings)
    assert still.source == "scan"
    assert still.covariance == pytest.approx(known.covariance)
    ahead = pose_now(2 * SECOND, _track(), known, front, settings).covariance
    grown = pose_now(2 * SECOND, _track(), known._replace(covariance=np.zeros((3, 3))), front, settings).covariance
    assert (ahead - grown)[1, 1] == pytest.approx((3.0 * 0.01) ** 2)
    assert (ahead - grown)[0, 0] == pytest.approx(0.0, abs=1e-12)


def test_wheels_are_taken_by_the_scale_that_walls_have_taught() -> None:
    front, settings = FrontEnd(Settings(), None), Settings().odometry
    for k in range(101):
        front.update("tachometer", Tachometer(k * SECOND // 50, 2.2))
    newest = Newest(np.zeros((3, 3)), np.array([2.0, 0.0, 0.0]), 1.1)
    pose = pose_now(2 * SECOND, _track(0.0), newest, front, settings)
    assert pose.source == "wheels"
    assert pose.T_odom_base[0, 3] == pytest.approx(4.0)
    unbelieved = pose_now(2 * SECOND, _track(0.0), newest._replace(wheel_scale=None), front, settings)
    assert unbelieved.source == "motion"

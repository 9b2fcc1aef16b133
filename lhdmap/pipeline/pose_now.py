"""Where the machine is now: the newest processed scan's pose, carried on by wheels and joint, or by the last motion."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from lhdmap.geometry import se2, se3
from lhdmap.messages import FloatArray
from lhdmap.odometry.settings import OdometrySettings
from lhdmap.pipeline.front_end import FrontEnd
from lhdmap.pipeline.track import Track


class Newest(NamedTuple):
    """What the odometry knows of its newest pose: covariance (3, 3) in body axes, velocity (3,), and the wheels' scale.

    `wheel_scale`: what wheels measure over what the machine drives; None where they are not believed.
    """

    covariance: FloatArray
    velocity: FloatArray
    wheel_scale: float | None


class PoseNow(NamedTuple):
    """A pose of `base_link` at `stamp_ns`.

    `T_odom_base` (4, 4); `covariance` (3, 3) of x, y, heading in body axes (m, rad); `age_s`: time since the scan that it goes
    on from; `source`: what carried it on.
    """

    stamp_ns: int
    T_odom_base: FloatArray
    covariance: FloatArray
    age_s: float
    source: Literal["scan", "wheels", "motion"]


def pose_now(now_ns: int, track: Track, newest: Newest, front_end: FrontEnd, settings: OdometrySettings) -> PoseNow:
    """Return the pose at a time at or after the track's newest one."""
    last_ns = track.last_ns
    assert last_ns is not None  # noqa: S101  # asked for where there is one
    age_s = max(now_ns - last_ns, 0) * 1e-9
    delta, grown, source = _moved(last_ns, now_ns, age_s, newest, front_end, settings)
    x, y, _, _, _, heading = track.newest
    pose = se2.compose(np.array([x, y, heading]), delta)
    x, y, z, roll, pitch, heading = track.ahead(pose, *_attitude_now(now_ns, last_ns, front_end))
    T = se3.from_rpy(roll, pitch, heading, (x, y, z))
    return PoseNow(now_ns, T, _carried(newest.covariance, delta) + grown, age_s, source)


def _moved(
    last_ns: int, now_ns: int, age_s: float, newest: Newest, front_end: FrontEnd, settings: OdometrySettings
) -> tuple[FloatArray, FloatArray, Literal["scan", "wheels", "motion"]]:
    """Return the planar motion (3,) since the newest pose, its covariance (3, 3), and what told it."""
    if age_s == 0.0:
        return np.zeros(3), np.zeros((3, 3)), "scan"
    motion = front_end.wheels.motion_between(last_ns, now_ns) if newest.wheel_scale is not None else None
    by_motion = _by_motion(newest.velocity, age_s)
    if motion is None or newest.wheel_scale is None:
        return by_motion, _wandered(settings, age_s), "motion"
    delta = motion.delta.copy()
    delta[:2] /= newest.wheel_scale
    if motion.source == "tachometer":  # the joint is not known: the machine turns on as it did
        delta[2] = by_motion[2]
        delta[1] = 0.5 * by_motion[2] * delta[0]
    heard_ns = front_end.wheels.heard_until_ns or last_ns
    unheard_s = max(now_ns - max(heard_ns, last_ns), 0) * 1e-9  # the last samples stand for a moment after them
    return delta, motion.covariance + _wandered(settings, unheard_s), "wheels"


def _by_motion(velocity: FloatArray, age_s: float) -> FloatArray:
    """Return the motion (3,) at constant forward, lateral and turning speed."""
    turn = float(velocity[2]) * age_s
    half = 0.5 * turn
    way = velocity[:2] * age_s
    return np.array(
        [way[0] * math.cos(half) - way[1] * math.sin(half), way[0] * math.sin(half) + way[1] * math.cos(half), turn]
    )


def _wandered(settings: OdometrySettings, age_s: float) -> FloatArray:
    """Return the covariance (3, 3) of white accelerations over a time."""
    density = np.array([settings.forward_acceleration, settings.lateral_acceleration, settings.turning_acceleration])
    return np.diag(density**2) * age_s**3 / 3.0


def _carried(covariance: FloatArray, delta: FloatArray) -> FloatArray:
    """Return a pose's covariance (3, 3), in its own axes, in those of the pose `delta` (3,) further on."""
    c, s = math.cos(delta[2]), math.sin(delta[2])
    R = np.array([[c, s], [-s, c]])
    J = np.eye(3)
    J[:2, :2] = R
    J[:2, 2] = R @ np.array([-delta[1], delta[0]])
    carried: FloatArray = J @ covariance @ J.T
    return carried


def _attitude_now(now_ns: int, last_ns: int, front_end: FrontEnd) -> tuple[float, float]:
    """Return roll and pitch of now: the filter's, as late as its sensor has been heard."""
    if not front_end.has_inclinometer:
        return 0.0, 0.0
    found = front_end.inclinometer.attitude.causal_at(now_ns)
    return front_end.inclinometer.roll_pitch_at(last_ns) if found is None else (found.roll_rad, found.pitch_rad)

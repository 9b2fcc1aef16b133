"""Short streams of messages by role, in memory: simulated drives, level and tilted, whole and with faults; made once."""

from __future__ import annotations

import functools
import math
from itertools import pairwise

import numpy as np
from lhdmap.geometry import se2
from lhdmap.messages import (
    FloatArray,
    Inclination,
    Joints,
    LaserScan,
    Message,
    Mount,
    PointCloud,
    Record,
    Tachometer,
    WheelPose,
)
from lhdmap.pile.stage import ScanHits
from lhdmap.scan_matching.key_scan import KeyScan
from lhdmap.simulation.drive import records
from lhdmap.simulation.planar import (
    PlanarScanner,
    PlanarWorld,
    drift_world,
    poses_along,
    simulate_scans,
    way_from_rest,
)
from lhdmap.simulation.scenario import DriftScenario
from lhdmap.simulation.sections import DriftSettings, DriveSettings
from lhdmap.simulation.sensing.sections import ScannerSettings
from lhdmap.simulation.world import DriftWorld
from lhdmap.topology.build import Seen

from tests.odometry import cloud_drives
from tests.pile.cast_drift import CastDrift
from tests.smoothing import places
from tests.topology.drawn import World, drive

Stream = tuple[tuple[str, Message], ...]
TILTED = DriftScenario(
    seed=5,
    truth=False,
    drift=DriftSettings(pieces=((4.0, 0.0, -6.0), (4.0, 10.0, 0.0), (10.0, 0.0, 4.0)), mesh_m=0.12),
    drive=DriveSettings(distance_m=9.5, speed_kmh=12.0, acceleration_mps2=2.0, standstill_s=0.8),
    scanner=ScannerSettings(beams=191, sweep=True, dust_share=0.01),
)
CLOUDED = DriftScenario(
    seed=3,
    drift=DriftSettings(mesh_m=0.12, roughness_m=0.03),
    drive=DriveSettings(distance_m=30.0, speed_kmh=20.0, acceleration_mps2=3.0, standstill_s=0.3),
)
RATE_HZ, SPEED_MPS, FROM_M, WAY_M = 25.0, 3.0, 5.0, 7.0
CLOUDS = 30
_JOINT_TO_AXLE_M = 1.7
_JUMP = np.array([0.3, 0.9, math.radians(30.0)])


@functools.cache
def tilted() -> Stream:
    """Return a drive of 9.5 m with all sensors, tilted, and some dust: the rear scanner comes to where the front one was."""
    return tuple((role, one.message) for one in records(DriftWorld(TILTED)) if (role := _role(one)))


def turning() -> tuple[Inclination, ...]:
    """Return two minutes of a gyroscope at 50 Hz in bends, with noise, a gap of 0.15 s and a reading of two turns a second."""
    rng, period_ns = np.random.default_rng(8), 20_000_000
    out = []
    for k in range(6000):
        rate = 0.2 * math.sin(0.01 * k) + 0.0005 + 0.001 * rng.standard_normal()
        if k == 3000:
            rate = 2.5
        if not 2000 < k < 2008:
            out.append(Inclination(k * period_ns, "imu", 0.0, 0.0, np.array([0.0, 0.0, rate]), None))
    return tuple(out)


def _role(record: Record) -> str:
    match record.message:
        case LaserScan():
            return "front" if "front" in record.topic else "rear"
        case Inclination():
            return "inclinometer"
        case Tachometer():
            return "tachometer"
        case Joints():
            return "joints"
        case Mount():
            return "tf_static"
    return ""


def unlevelled() -> Stream:
    """Return the drive without its inclinometer."""
    return tuple(one for one in tilted() if not isinstance(one[1], Inclination))


@functools.cache
def faulty() -> Stream:
    """Return the drive with gaps of 0.6 s and 0.3 s, an outlier and a frozen value of each of its slow sensors."""
    start_ns = tilted()[-1][1].stamp_ns - 6_000_000_000
    kept: list[tuple[str, Message]] = []
    held: Inclination | None = None
    for role, message in tilted():
        t = (message.stamp_ns - start_ns) * 1e-9
        slow = isinstance(message, Inclination | Tachometer | Joints)
        if slow and (2.0 < t < 2.6 or 4.0 < t < 4.3):
            continue
        if isinstance(message, Tachometer) and 3.0 < t < 3.05:
            message = message._replace(speed_mps=20.0)
        if isinstance(message, Inclination):
            if 3.0 < t < 3.02:
                message = message._replace(pitch_rad=message.pitch_rad + math.radians(5.0))
            if 5.0 < t < 5.6:
                held = held or message
                message = message._replace(roll_rad=held.roll_rad, pitch_rad=held.pitch_rad)
        kept.append((role, message))
    return tuple(kept)


@functools.cache
def rare() -> Stream:
    """Return the drive with a scan of each scanner a second: the first ones wait long until the odometry starts."""
    counts = {"front": 0, "rear": 0}
    kept = []
    for role, message in tilted():
        if role in counts:
            counts[role] += 1
            if counts[role] % 25 != 1:
                continue
        kept.append((role, message))
    return tuple(kept)


@functools.cache
def planar(rms_m: float = 0.12, *, wheels: str = "articulated", jumps: bool = False) -> Stream:
    """Return a drive of 7 m from rest round a bend, a level scanner; `wheels` are articulated, tachometer, poses or none.

    It `jumps` once, by 0.95 m and 30 degrees: farther than a narrow search finds whatever the noise.
    """
    world = _bend(rms_m)
    poses = poses_along(world.centre_line_m, FROM_M + way_from_rest(SPEED_MPS, RATE_HZ, WAY_M, 1.5))
    told = poses.copy()
    if jumps:
        half = 2 * len(poses) // 3
        poses[half:] = [se2.compose(pose, _JUMP) for pose in poses[half:]]
    scans = simulate_scans(world, poses, PlanarScanner(), RATE_HZ, 3)
    stamps = [scan.stamp_ns for scan in scans]
    messages: list[tuple[str, Message]] = [("front", scan) for scan in scans]
    messages += wheels_of(wheels, told, stamps)
    messages.sort(key=lambda one: one[1].stamp_ns)
    return (("tf_static", Mount(0, "base_link", "laser", np.eye(4))), *messages)


@functools.cache
def _bend(rms_m: float) -> PlanarWorld:
    return drift_world(11, rms_m=rms_m, pieces=((9.0, 0.0), (4.0, math.pi / 6), (20.0, 0.0)), cross_drift_at_m=None)


def wheels_of(kind: str, poses: FloatArray, stamps: list[int]) -> list[tuple[str, Message]]:
    """Return what wheels say of a drive: 1 % too fast; poses that jump by 2.5 m once, are absent for 1.2 s and end early."""
    steps = np.array([se2.between(one, other) for one, other in pairwise(poses)])
    speeds = RATE_HZ * np.append(steps[:, 0], steps[-1, 0])
    turns = RATE_HZ * np.append(steps[:, 2], steps[-1, 2])
    if kind == "none":
        return []
    if kind == "poses":
        return [("wheel_odometry", one) for one in _wheel_poses(poses, stamps)]
    messages: list[tuple[str, Message]] = [
        ("tachometer", Tachometer(stamp, 1.01 * float(speed))) for stamp, speed in zip(stamps, speeds, strict=True)
    ]
    if kind == "articulated":
        bent = 2.0 * np.arctan2(_JOINT_TO_AXLE_M * turns, np.maximum(speeds, 0.1))
        messages += [
            ("joints", Joints(stamp, {"articulation": float(angle)}, {}))
            for stamp, angle in zip(stamps, bent, strict=True)
        ]
    return messages


def _wheel_poses(poses: FloatArray, stamps: list[int]) -> list[WheelPose]:
    count = len(poses)
    rows = []
    for k, (pose, stamp) in enumerate(zip(poses, stamps, strict=True)):
        if count // 3 < k < count // 3 + 30 or k > count - 4:
            continue
        jump_m = 2.5 if k > 3 * count // 4 else 0.0
        x, y, heading = 1.02 * pose[0] + jump_m, 1.02 * pose[1], 0.95 * pose[2]
        rows.append(WheelPose(stamp + 7_000_000, float(x), float(y), float(heading)))
    return rows


@functools.cache
def clouds() -> Stream:
    """Return a drive of 8 m of a 3D scanner in a smooth drift, with tachometer and inclinometer."""
    world = DriftWorld(CLOUDED)
    drive = cloud_drives.simulate(world, 15.0, count=CLOUDS)
    first_ns = drive.clouds[0].stamp_ns
    times_s = np.arange(0.0, cloud_drives.PERIOD_S * (CLOUDS + 2), 0.02)
    rows, behind = world.history.at(times_s), world.history.at(np.maximum(times_s - 0.02, 0.0))
    messages: list[tuple[str, Message]] = [("points", _thinned(cloud)) for cloud in drive.clouds]
    for t, row, before in zip(times_s, rows, behind, strict=True):
        stamp = first_ns + round(float(t) * 1e9)
        roll, pitch = float(row[3]), float(row[4])
        messages.append(("inclinometer", Inclination(stamp, "inclinometer", roll, pitch, None, None)))
        messages.append(("tachometer", Tachometer(stamp, 1.01 * float(np.hypot(*(row - before)[:2])) / 0.02)))
    messages.sort(key=lambda one: one[1].stamp_ns)
    return (("tf_static", Mount(0, "base_link", "lidar", cloud_drives.T_BASE_SENSOR)), *messages)


def _thinned(cloud: PointCloud) -> PointCloud:
    """Return one point in three, for speed."""
    return cloud._replace(points_m=cloud.points_m[::3], time_offsets_s=cloud.time_offsets_s[::3])


def returning() -> Stream:
    """Return the clouds of the drive, then the same ones back to where it began."""
    return _clouds_of([*range(CLOUDS), *reversed(range(CLOUDS))])


def cut() -> Stream:
    """Return the clouds of the drive without eight of them: it jumps by 4 m."""
    return _clouds_of([*range(16), *range(24, CLOUDS)])


def _clouds_of(rows: list[int]) -> Stream:
    """Return some clouds of the drive in an order, one each 0.1 s, without times in the sweep and without other sensors."""
    all_ = [message for _, message in clouds() if isinstance(message, PointCloud)]
    first_ns = all_[0].stamp_ns
    chosen = [all_[row]._replace(time_offsets_s=cloud_drives.NO_TIMES) for row in rows]
    steps = [cloud._replace(stamp_ns=first_ns + 100_000_000 * k) for k, cloud in enumerate(chosen)]
    return (clouds()[0], *(("points", cloud) for cloud in steps))


@functools.cache
def lap_scans() -> tuple[KeyScan, ...]:
    """Return scans each metre of a lap and a quarter around a pillar, placed by an odometry that drifts."""
    true = places.lap(80)
    keys = places.keys_of(places.square(), true, places.drifted(true, 1.015, 0.08))
    return tuple(keys)


@functools.cache
def towards_a_pile() -> tuple[ScanHits, ...]:
    """Return scans each 0.2 m of a drive of 23 m towards a shallow pile, which ends 3 m before it."""
    return tuple(CastDrift(31.0).scans(from_m=10.0, to_m=33.0))[::2]


@functools.cache
def side_chambers() -> Seen:
    """Return a drive past chambers of 3, 5 and 20 m, branches 7 m apart, and others around a pillar of 7.4 x 4.2 m."""
    chambers = [((x, 0.0), (x, 2.3 + deep)) for x, deep in ((12.0, 3.0), (26.0, 5.0), (42.0, 20.0))]
    chambers += [((49.0, 0.0), (49.0, -20.0)), ((64.0, 0.0), (64.0, 12.0)), ((76.0, 0.0), (76.0, 12.0))]
    drifts = [([(0.0, 0.0), (90.0, 0.0)], 4.6), *((line, 4.6) for line in chambers), ([(61.7, 9.0), (78.3, 9.0)], 5.0)]
    return drive(
        World(drifts), [(3.0, 0.0), (64.0, 0.0), (64.0, 9.0), (76.0, 9.0), (76.0, 0.0), (64.0, 0.0), (88.0, 0.0)]
    )


@functools.cache
def two_levels() -> Seen:
    """Return a drive that comes back 8 m above where it was."""
    world = World([([(0.0, 0.0), (50.0, 0.0)], 4.6), ([(48.0, 0.0), (48.0, 25.0)], 4.6)])
    return drive(world, [(3.0, 0.0, 0.0), (48.0, 0.0, 0.0), (48.0, 20.0, 4.0), (48.0, 0.5, 8.0), (5.0, 0.5, 8.0)])

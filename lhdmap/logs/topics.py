"""Which topic of a log plays which role: by the contract's names, else by type where that leaves no doubt."""

from __future__ import annotations

import re
from collections.abc import Mapping

from lhdmap.errors import InputError, UsageError
from lhdmap.logs.base import TopicInfo
from lhdmap.settings import nearest

SCAN, CLOUD, IMU = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/Imu"
ODOMETRY, PRESSURE, TEXT = "nav_msgs/msg/Odometry", "sensor_msgs/msg/FluidPressure", "std_msgs/msg/String"
TRANSFORMS = "tf2_msgs/msg/TFMessage"

# Role -> the contract's topic and type.
ROLES: dict[str, tuple[str, str]] = {
    "front": ("/lidar/front/scan", SCAN),
    "rear": ("/lidar/rear/scan", SCAN),
    "points": ("/lidar/points", CLOUD),
    "inclinometer": ("/inclinometer", IMU),
    "joints": ("/machine/joints", "sensor_msgs/msg/JointState"),
    "tachometer": ("/machine/tachometer", "geometry_msgs/msg/TwistStamped"),
    "transmission_pressure": ("/machine/pressure/transmission", PRESSURE),
    "lift_pressure": ("/machine/pressure/lift", PRESSURE),
    "tilt_pressure": ("/machine/pressure/tilt", PRESSURE),
    "command": ("/machine/command", "lhd_msgs/msg/MachineCommand"),
    "mode": ("/operation/mode", TEXT),
    "node": ("/operation/node", TEXT),
    "tf_static": ("/tf_static", TRANSFORMS),
    "wheel_odometry": ("/odom", ODOMETRY),
    "ground_truth": ("/ground_truth/odometry", ODOMETRY),
}
# Roles that a topic of the right type takes whatever its name, if it is the only one.
_BY_TYPE = ("points", "inclinometer", "joints", "tachometer", "command", "wheel_odometry")
# Words in the names of scanner topics; the last ones are CARMEN's.
_FRONT_WORDS = re.compile(r"front|forward|(?<![a-z])(fwd|fore)(?![a-z])|flaser|robotlaser1|rawlaser1")
_REAR_WORDS = re.compile(r"rear|back|(?<![a-z])aft(?![a-z])|rlaser|robotlaser2|rawlaser2")


def is_ground_truth(topic: str) -> bool:
    """Return whether the name says that the topic holds the truth, which is never an input."""
    name = topic.lower().replace("-", "_")
    return "ground_truth" in name or "groundtruth" in name or name.strip("/") in ("truth", "truepos")


def assign_topics(topics: Mapping[str, TopicInfo], overrides: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return the topic of each role that the log fills; `overrides` name topics by role and win.

    Raises:
        InputError: two topics could be the front scanner, or an override names a topic that the log lacks.
        UsageError: an override names an unknown role.
    """
    chosen, doubt = roles_and_doubt(topics, overrides)
    if doubt:
        raise InputError(doubt)
    return chosen


def roles_and_doubt(
    topics: Mapping[str, TopicInfo], overrides: Mapping[str, str] | None = None
) -> tuple[dict[str, str], str]:
    """Return the roles as `assign_topics`, and why none is the front scanner where several could be (else empty)."""
    chosen = _overridden(topics, overrides or {})
    free = {name: info for name, info in topics.items() if name not in chosen.values()}
    for role, (name, kind) in ROLES.items():
        if role not in chosen and name in free and free[name].type_name == kind:
            chosen[role] = free.pop(name).name
    truths = {name: info for name, info in free.items() if is_ground_truth(name)}
    _assign_by_type("ground_truth", chosen, truths)
    free = {name: info for name, info in free.items() if name not in truths}
    doubt = _assign_scanners(chosen, free)
    for role in _BY_TYPE:
        _assign_by_type(role, chosen, free)
    return chosen, doubt


def _overridden(topics: Mapping[str, TopicInfo], overrides: Mapping[str, str]) -> dict[str, str]:
    for role, topic in overrides.items():
        if role not in ROLES:
            raise UsageError(f"--topic {role}={topic}: unknown role '{role}'{nearest(role, ROLES)}")
        if topic not in topics:
            raise InputError(f"--topic {role}={topic}: the log has no such topic{nearest(topic, topics)}")
        found, wanted = topics[topic].type_name, ROLES[role][1]
        if wanted in (SCAN, CLOUD) and found != wanted:
            raise InputError(f"--topic {role}={topic}: {wanted} was wanted, that topic is {found}")
    return dict(overrides)


def _assign_scanners(chosen: dict[str, str], free: dict[str, TopicInfo]) -> str:
    """Assign rear and front scanner; return the doubt about the front one, if any."""
    scans = [name for name, info in free.items() if info.type_name == SCAN and info.count != 0]
    rear = [name for name in scans if _REAR_WORDS.search(name.lower())]
    if "rear" not in chosen and len(rear) == 1 and (len(scans) > 1 or "front" in chosen):
        chosen["rear"] = rear[0]
    if "front" in chosen:
        return ""
    scans = [name for name in scans if name != chosen.get("rear")]
    candidates = [name for name in scans if _FRONT_WORDS.search(name.lower())] or scans
    if len(candidates) == 1:
        chosen["front"] = candidates[0]
    elif candidates:
        listed, first = ", ".join(sorted(candidates)), min(candidates)
        return f"{len(candidates)} topics could be the front scanner: {listed}; name it: --topic front={first}"
    return ""


def _assign_by_type(role: str, chosen: dict[str, str], free: Mapping[str, TopicInfo]) -> None:
    if role in chosen:
        return
    same = [name for name, info in free.items() if info.type_name == ROLES[role][1] and info.count != 0]
    if len(same) == 1:
        chosen[role] = same[0]


def missing_scanner(topics: Mapping[str, TopicInfo], rear: str | None = None) -> InputError:
    """Return the error for a log without a scanner to drive by; `rear`: the topic of the rear one, where there is one."""
    if rear is not None:
        return InputError(
            f"no front scanner in the log, {rear} is the rear one; to drive by it, name it: --topic front={rear}"
        )
    listed = ", ".join(f"{info.name} ({info.type_name})" for info in topics.values()) or "no topic at all"
    return InputError(f"no scanner in the log: it has {listed}; a {SCAN} or {CLOUD} topic is needed")

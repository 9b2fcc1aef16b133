"""The roles that topics of a log play: one table of topic, type, message, and who reads it.

A new role is a line in `_TABLE`; a type that is new as well needs its decoder (`logs/decoders.py`) and its builder
(`logs/ros_messages.py`), each under the class of its message. Stages ask for roles by name: `source.messages(["command"])`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

from lhdmap.messages import (
    Command,
    GroundTruth,
    Inclination,
    Joints,
    LaserScan,
    Message,
    Mount,
    PointCloud,
    Pressure,
    Record,
    Tachometer,
    Text,
    WheelPose,
)

SCAN, CLOUD, IMU = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/Imu"
JOINTS, PRESSURE, TWIST = (
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/FluidPressure",
    "geometry_msgs/msg/TwistStamped",
)
ODOMETRY, COMMAND, TEXT = "nav_msgs/msg/Odometry", "lhd_msgs/msg/MachineCommand", "std_msgs/msg/String"
TRANSFORMS, OLD_TRANSFORMS = "tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"

BUILD_MAP, PILE, GIVEN_POSES = "build-map", "pile", "build-map --poses"
_DRIVE = (BUILD_MAP, PILE)
_ALL = (*_DRIVE, GIVEN_POSES)


@dataclass(frozen=True, slots=True)
class Role:
    """What a topic is for.

    Attributes:
        name: what stages and `--topic` call it.
        topic: the contract's topic; the simulator writes to it.
        type_name: its type in ROS 2 form.
        message: what it is decoded to, and written from.
        read_by: the commands that read it unasked; any stage may ask for any role.
        words: a pattern in the names of topics (lower case); a topic of the type takes the role if it is the only one.
        by_type: the only topic of the type takes the role, whatever its name.
        survey: how a quick look at the log judges it. `scan`: is it whole, and as it was meant; `value`: left out if it never
            changes, but zero of one that is level, or straight, is as good as none; `speed`: left out if it never changes.
    """

    name: str
    topic: str
    type_name: str
    message: type[Any]
    read_by: tuple[str, ...] = ()
    words: str = ""
    by_type: bool = False
    survey: Literal["", "scan", "value", "speed"] = ""

    def named_by(self, topic: str) -> bool:
        """Return whether the topic's name has the role's words in it."""
        return bool(self.words and re.search(self.words, topic.lower()))


# The last words of the scanners are CARMEN's.
_FRONT = r"front|forward|(?<![a-z])(fwd|fore)(?![a-z])|flaser|robotlaser1|rawlaser1"
_REAR = r"rear|back|(?<![a-z])aft(?![a-z])|rlaser|robotlaser2|rawlaser2"
_TABLE = (
    Role("front", "/lidar/front/scan", SCAN, LaserScan, _ALL, words=_FRONT, survey="scan"),
    Role("rear", "/lidar/rear/scan", SCAN, LaserScan, _ALL, words=_REAR, survey="scan"),
    Role("points", "/lidar/points", CLOUD, PointCloud, _ALL, by_type=True),
    Role("inclinometer", "/inclinometer", IMU, Inclination, _DRIVE, by_type=True, survey="value"),
    Role("joints", "/machine/joints", JOINTS, Joints, _ALL, by_type=True, survey="value"),
    Role("tachometer", "/machine/tachometer", TWIST, Tachometer, _DRIVE, by_type=True, survey="speed"),
    Role("transmission_pressure", "/machine/pressure/transmission", PRESSURE, Pressure, words="transmission|converter"),
    Role("lift_pressure", "/machine/pressure/lift", PRESSURE, Pressure, words="lift|hoist|boom"),
    Role("tilt_pressure", "/machine/pressure/tilt", PRESSURE, Pressure, words="tilt|bucket"),
    Role("command", "/machine/command", COMMAND, Command, by_type=True),
    Role("mode", "/operation/mode", TEXT, Text),
    Role("node", "/operation/node", TEXT, Text, (BUILD_MAP, GIVEN_POSES)),
    Role("tf_static", "/tf_static", TRANSFORMS, Mount, _ALL),
    Role("wheel_odometry", "/odom", ODOMETRY, WheelPose, _DRIVE, by_type=True, survey="speed"),
    Role("ground_truth", "/ground_truth/odometry", ODOMETRY, GroundTruth),
)
ROLES: dict[str, Role] = {role.name: role for role in _TABLE}
TYPE_OF: dict[type[Any], str] = {role.message: role.type_name for role in _TABLE}
"""The ROS 2 type of each message."""


def read_by(command: str) -> tuple[str, ...]:
    """Return the names of the roles that a command reads."""
    return tuple(role.name for role in _TABLE if command in role.read_by)


def judged_as(*surveys: str) -> tuple[str, ...]:
    """Return the names of the roles that a survey judges in one of these ways."""
    return tuple(role.name for role in _TABLE if role.survey in surveys)


def messages_of(type_name: str) -> Iterable[type[Any]]:
    """Return the messages that a type is decoded to, in the order of the table."""
    meant = TRANSFORMS if type_name == OLD_TRANSFORMS else type_name
    return dict.fromkeys(role.message for role in _TABLE if role.type_name == meant)


def recorded(role: str, log_time_ns: int, message: Message) -> Record:
    """Return the record of a message on the contract's topic of its role.

    Raises:
        TypeError: the role has other messages.
    """
    chosen = ROLES[role]
    if not isinstance(message, chosen.message):
        raise TypeError(f"{role}: a {chosen.message.__name__} was wanted, not a {type(message).__name__}")
    return Record(chosen.topic, log_time_ns, message)

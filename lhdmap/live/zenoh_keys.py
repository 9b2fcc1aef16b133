"""Keys of rmw_zenoh: which topic of which type they are of (its design document, «Topic and service name mapping»).

A topic: `DOMAIN/NAME/PKG::msg::dds_::TYPE_/HASH`. A liveliness token: `@ros2_lv/DOMAIN/SESSION/NODE/ENTITY/KIND/ENCLAVE/
NAMESPACE/NODE/TOPIC/TYPE/HASH/QOS`, with `%` for `/` in names; KIND of a publisher is `MP`.
"""

from __future__ import annotations

from lhdmap.live.source import Announced

_TOKEN_FIELDS, _PUBLISHER = 13, "MP"


def dds_type(type_name: str) -> str:
    """Return `sensor_msgs::msg::dds_::LaserScan_` for `sensor_msgs/msg/LaserScan`."""
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_type(dds_name: str) -> str:
    """Return the ROS 2 name of a DDS type, as it is where it is none."""
    parts = dds_name.split("::")
    if len(parts) != 4 or parts[2] != "dds_" or not parts[3].endswith("_"):
        return dds_name
    return f"{parts[0]}/{parts[1]}/{parts[3][:-1]}"


def topic_of(key: str) -> tuple[str, str] | None:
    """Return topic and type of a key of data, None where it is none."""
    _, _, rest = key.partition("/")
    name, _, tail = rest.rpartition("/")
    name, _, dds_name = name.rpartition("/")
    return ("/" + name, ros_type(dds_name)) if name and tail and "::" in dds_name else None


def announced(token: str) -> Announced | None:
    """Return the topic that a publisher's token announces, None for other tokens."""
    fields = token.split("/")
    if len(fields) < _TOKEN_FIELDS or fields[5] != _PUBLISHER:
        return None
    return Announced(fields[9].replace("%", "/"), ros_type(fields[10]))

"""Small logs of every format that is read, with unique messages on the topics that a machine has."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import zstandard
from lhdmap.logs.ros_messages import definition, serialized
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
    Tachometer,
    Text,
    WheelPose,
)
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer
from rosbags.typesys import Stores, get_typestore

START_NS = 1_700_000_000_000_000_000
STEP_NS = 20_000_000


def sample_messages(count: int) -> Iterator[tuple[str, Message, int]]:
    """Yield (topic, message, log time): a scan each step, the other topics in turn; each scan unique."""
    yield "/tf_static", Mount(START_NS, "base_link", "front", np.eye(4)), START_NS
    rng = np.random.default_rng(1)
    for i in range(count):
        stamp = START_NS + i * STEP_NS
        ranges = rng.uniform(1.0, 30.0, 91).astype(np.float32)
        yield "/lidar/front/scan", LaserScan(stamp, "front", -0.8, 0.0175, 1e-5, 0.1, 80.0, ranges), stamp
        yield *_slow(i, stamp), stamp + 1000


def _slow(i: int, stamp: int) -> tuple[str, Message]:
    topics: list[tuple[str, Message]] = [
        ("/inclinometer", Inclination(stamp, "front", 0.01, -0.02, np.zeros(3), np.array([0, 0, 9.8]))),
        ("/machine/joints", Joints(stamp, {"articulation": 0.1 + i, "boom_lift": 0.2}, {})),
        ("/machine/tachometer", Tachometer(stamp, 1.0 + i)),
        ("/machine/pressure/lift", Pressure(stamp, 1e6 + i)),
        ("/machine/command", Command(stamp, 0.5, 0.1, 0.0, 0.0, False, True)),
        ("/operation/mode", Text(stamp, f"autonomous {i}")),
        ("/odom", WheelPose(stamp, 0.1 * i, 0.0, 0.01)),
        ("/ground_truth/odometry", GroundTruth(stamp, np.array([0.1 * i, 0, 0]), np.array([0, 0, 0, 1.0]))),
        (
            "/lidar/points",
            PointCloud(stamp, "top", np.full((20, 3), i, np.float32), np.linspace(0.0, 0.1, 20, dtype=np.float32)),
        ),
    ]
    return topics[i % len(topics)]


def write_mcap(
    path: Path,
    count: int,
    compression: CompressionType,
    *,
    chunked: bool = True,
    packed: Callable[[bytes], bytes] = bytes,
) -> Path:
    """Write a small MCAP log, each message `packed`; returns its path."""
    channels: dict[str, int] = {}
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=8192, compression=compression, use_chunking=chunked)
        writer.start(profile="ros2", library="fuzz")
        for topic, message, log_ns in sample_messages(count):
            kind, data = serialized(message)
            if topic not in channels:
                schema = writer.register_schema(kind, "ros2msg", definition(kind).encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], log_ns, packed(data), log_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def compressed(path: Path) -> Path:
    """Compress a log as a whole, in frames as large logs have; returns the path of what comes out."""
    target, data = path.with_name(path.name + ".zst"), path.read_bytes()
    frames = [zstandard.compress(data[start : start + 4096]) for start in range(0, len(data), 4096)]
    target.write_bytes(b"".join(frames))
    return target


def write_bag(path: Path, count: int, compression: BagWriter.CompressionFormat | None) -> Path:
    """Write a small ROS 1 bag of scans and speeds; returns its path."""
    store, humble = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
    kinds = {"/lidar/front/scan": "sensor_msgs/msg/LaserScan", "/machine/tachometer": "geometry_msgs/msg/TwistStamped"}
    writer = BagWriter(path)
    if compression is not None:
        writer.set_compression(compression)
    writer.chunk_threshold = 8192
    with writer:
        connections = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
        for topic, message, log_ns in sample_messages(count):
            if topic in kinds:
                cdr = serialized(message)[1]
                humble_message = humble.deserialize_cdr(cdr, kinds[topic])
                data = store.serialize_ros1(_with_seq(humble_message, store), kinds[topic])
                writer.write(connections[topic], log_ns, data)
    return path


def _with_seq(message: object, store: object) -> object:
    """Give the header of a ROS 2 message the sequence number that ROS 1 has."""
    header_type = store.types["std_msgs/msg/Header"]  # type: ignore[attr-defined]
    header = message.header  # type: ignore[attr-defined]
    stamped = header_type(seq=0, stamp=header.stamp, frame_id=header.frame_id)
    values = {name: getattr(message, name) for name in message.__dataclass_fields__ if name != "header"}  # type: ignore[attr-defined]
    return store.types[message.__msgtype__](header=stamped, **values)  # type: ignore[attr-defined]


def write_db3(path: Path, count: int) -> Path:
    """Write a small ROS 2 bag folder at `path`; returns the path of the database in it."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    known = set(store.types)
    with Bag2Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connections = {}
        for topic, message, log_ns in sample_messages(count):
            kind, data = serialized(message)
            if kind not in known:
                continue
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], log_ns, data)
    return next(path.glob("*.db3"))


def write_carmen(path: Path, count: int) -> Path:
    """Write a small CARMEN log; returns its path."""
    rng = np.random.default_rng(2)
    lines = ["PARAM robot_frontlaser_offset 0.25 nohost 0"]
    for i in range(count):
        time_s = f"{976052857 + i}.{i % 1000:03d}250"
        ranges = " ".join(f"{value:.2f}" for value in rng.uniform(1.0, 20.0, 181))
        lines.append(f"ODOM {0.1 * i:.6f} 0.0 0.0 0.1 0.0 0.0 {time_s} nohost {i}.0")
        lines.append(f"FLASER 181 {ranges} {0.1 * i:.6f} 0 0 {0.1 * i:.6f} 0 0 {time_s} nohost {i}.1")
    path.write_text("\n".join(lines) + "\n")
    return path


def write_breezy(path: Path, count: int) -> Path:
    """Write a small BreezySLAM log; returns its path."""
    rng = np.random.default_rng(3)
    rows = []
    for i in range(count):
        ranges = " ".join(str(value) for value in rng.integers(0, 5500, 682))
        rows.append(f"{361431443 + 98000 * i} 1 {100 * i} {101 * i} {' 0' * 20} {ranges} 0")
    path.write_text("\n".join(rows) + "\n")
    return path

"""Writing a log and reading it back through `LogSource`: one file, several, folders, partial names."""

from __future__ import annotations

import hashlib
import shutil
import sqlite3
import struct
from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError, UsageError
from lhdmap.geometry import se3
from lhdmap.logs import LogSource, open_log
from lhdmap.logs.ros_messages import serialized
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import GroundTruth, LaserScan, Mount, Tachometer, Text
from mcap.writer import Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer
from rosbags.typesys import Stores, get_typestore

from tests.logs.small_logs import sample_messages, write_db3

SECOND = 10**9
START = 1_712_345_678_123_456_789


def _scan(stamp_ns: int) -> LaserScan:
    return LaserScan(stamp_ns, "front", -1.0, 0.01, 0.0, 0.1, 80.0, np.arange(50, dtype=np.float32))


def _write(path: Path, stamps: list[int], topic: str = "/lidar/front/scan") -> Path:
    with LogWriter(path) as writer:
        for stamp in stamps:
            writer.write(topic, _scan(stamp))
    return path


def test_every_message_type_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    written = list(sample_messages(30))
    with LogWriter(path, {"seed": "1"}) as writer:
        for topic, message, log_ns in written:
            writer.write(topic, message, log_ns)
    with LogSource(path) as source:
        got = list(source.messages())
        assert {type(message) for _, message in got} == {type(message) for _, message, _ in written}
        assert source.roles["front"] == "/lidar/front/scan"
        assert source.duration_s == pytest.approx(29 * 0.02 + 1e-6)
        assert source.damage == source.warnings == []
    stamps = [message.stamp_ns for role, message in got if role == "front"]
    assert stamps == [message.stamp_ns for topic, message, _ in written if topic == "/lidar/front/scan"]


def test_stamps_of_19_digits_survive(tmp_path: Path) -> None:
    with LogSource(_write(tmp_path / "log.mcap", [START, START + 1])) as source:
        assert [message.stamp_ns for _, message in source.messages()] == [START, START + 1]


def test_several_mounts_in_one_message(tmp_path: Path) -> None:
    poses = [se3.from_rpy(0.1, 0.2, 0.3, (1.0, 2.0, 3.0)), se3.from_rpy(0.0, 0.0, np.pi, (-1.0, 0.0, 1.0))]
    path = tmp_path / "log.mcap"
    with LogWriter(path) as writer:
        writer.write("/tf_static", [Mount(START, "base_link", f"laser{i}", pose) for i, pose in enumerate(poses)])
        writer.write("/lidar/front/scan", _scan(START))
    with LogSource(path) as source:
        mounts = [message for _, message in source.messages({"tf_static"})]
    assert [mount.child_frame for mount in mounts if isinstance(mount, Mount)] == ["laser0", "laser1"]
    for mount, pose in zip(mounts, poses, strict=True):
        assert isinstance(mount, Mount)
        assert np.allclose(mount.T_parent_child, pose, atol=1e-12)


def test_interrupted_writing_leaves_a_readable_partial_file(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"

    def interrupted() -> None:
        with LogWriter(path) as writer:
            writer.write("/lidar/front/scan", _scan(START))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert not path.exists()
    partial = tmp_path / "log.mcap.partial"
    with open_log(partial) as reader:
        assert sum(1 for _ in reader.records()) == 1


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    path = _write(tmp_path / "log.mcap", [START])
    with pytest.raises(UsageError, match="exists already"), LogWriter(path):
        pass


def test_a_topic_holds_one_type(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "log.mcap") as writer:
        writer.write("/a", Text(START, "x"))
        with pytest.raises(InputError, match="holds std_msgs/msg/String"):
            writer.write("/a", Tachometer(START, 1.0))


def test_files_are_one_log_in_time_order(tmp_path: Path) -> None:
    evens = _write(tmp_path / "even.mcap", [START + i * SECOND for i in range(0, 20, 2)])
    odds = _write(tmp_path / "odd.mcap", [START + i * SECOND for i in range(1, 20, 2)])
    with LogSource([odds, evens]) as source:
        stamps = [message.stamp_ns for _, message in source.messages()]
        assert source.topics()["/lidar/front/scan"].count == 20
        assert source.duration_s == 19.0
    assert stamps == [START + i * SECOND for i in range(20)]


def test_named_ground_truth_is_read_as_such(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    truth = GroundTruth(START, np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, 0.0, 1.0]))
    with LogWriter(path) as writer:
        writer.write("/lidar/front/scan", _scan(START))
        writer.write("/vicon", truth)
    with LogSource(path, {"ground_truth": "/vicon"}) as source:
        (got,) = [message for _, message in source.messages({"ground_truth"})]
    assert isinstance(got, GroundTruth)
    assert got.position_m.tolist() == [1.0, 2.0, 3.0]


def test_log_without_a_scanner(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with LogWriter(path) as writer:
        writer.write("/operation/mode", Text(START, "idle"))
    with pytest.raises(InputError, match=r"no scanner in the log: it has /operation/mode"), LogSource(path):
        pass


def test_inventory(tmp_path: Path) -> None:
    path = _write(tmp_path / "log.mcap", [START + i * SECOND // 10 for i in range(11)])
    with LogSource(path) as source:
        assert sum(1 for _ in source.messages()) == 11
        (inventory,) = source.inventory()
    topic = inventory.topics["/lidar/front/scan"]
    assert (topic.role, topic.count, topic.type_name) == ("front", 11, "sensor_msgs/msg/LaserScan")
    assert topic.rate_hz == pytest.approx(10.0)
    assert topic.max_gap_s == pytest.approx(0.1)
    assert inventory.size_bytes == path.stat().st_size
    assert inventory.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("with_metadata", [True, False])
def test_bag_folders(tmp_path: Path, storage: StoragePlugin, with_metadata: bool) -> None:
    folder = tmp_path / "bag"
    with Bag2Writer(folder, version=9, storage_plugin=storage) as writer:
        store = get_typestore(Stores.ROS2_HUMBLE)
        connection = writer.add_connection("/scan", "sensor_msgs/msg/LaserScan", typestore=store)
        for i in range(5):
            writer.write(connection, START + i, serialized(_scan(START + i))[1])
    if not with_metadata:
        (folder / "metadata.yaml").unlink()
    with LogSource(folder) as source:
        assert source.roles == {"front": "/scan"}
        assert [message.stamp_ns for _, message in source.messages()] == [START + i for i in range(5)]
    file = next(path for path in folder.iterdir() if path.suffix in (".mcap", ".db3"))
    with LogSource(file) as source:
        assert sum(1 for _ in source.messages()) == 5


def test_split_bag_folder_with_one_broken_part(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    for part in range(3):
        _write(folder / f"bag_{part}.mcap", [START + (2 - part) * SECOND + i for i in range(4)])
    (folder / "bag_3.mcap").write_bytes(b"")
    with open_log(folder) as reader:
        stamps = [record.message.stamp_ns for record in reader.records()]
        assert stamps == sorted(stamps)
        assert len(stamps) == 12
        assert any("bag_3.mcap" in line for line in reader.damage)


def test_database_that_is_no_bag(tmp_path: Path) -> None:
    database = write_db3(tmp_path / "bag", 5)
    broken = tmp_path / "other.db3"
    shutil.copy(database, broken)
    broken.write_bytes(broken.read_bytes().replace(b"messages", b"massages"))
    with open_log(broken) as reader:
        assert reader.topics()
        assert any("no tables" in line or "damaged" in line for line in reader.damage)


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("log.mcap", b"", "is empty"),
        ("log.mcap", b"not an mcap file at all", "not an MCAP file"),
        ("log.bag", b"#ROSBAG V1.2\nxxxx", "#ROSBAG V1.2"),
        ("log.db3", b"x" * 200, "not an SQLite file"),
        ("cloud.ply", b"ply\nformat ascii 1.0\n", "a point cloud is no log"),
        ("drive.rawlog", b"x", "MRPT rawlog"),
        ("thing.bin", b"\0\1\2", "unknown format"),
    ],
)
def test_what_is_no_log(tmp_path: Path, name: str, content: bytes, text: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=text) as caught, open_log(path):
        pass
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_file_and_folder_without_a_log(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        open_log(tmp_path / "nothing.mcap")
    with pytest.raises(InputError, match=r"no \.mcap or \.db3"), open_log(tmp_path):
        pass


def test_a_log_is_known_by_its_first_bytes_where_the_suffix_says_nothing(tmp_path: Path) -> None:
    path = _write(tmp_path / "log.mcap", [START]).rename(tmp_path / "recording.0")
    with open_log(path) as reader:
        assert sum(1 for _ in reader.records()) == 1


def test_a_log_can_be_read_twice(tmp_path: Path) -> None:
    with open_log(_write(tmp_path / "log.mcap", [START, START + 1])) as reader:
        assert [sum(1 for _ in reader.records()) for _ in range(2)] == [2, 2]


@pytest.mark.parametrize(
    ("encoding", "schema_encoding", "name"),
    [
        ("cdr", "ros2msg", "sensor_msgs/msg/LaserScan"),
        ("cdr", "ros2idl", "sensor_msgs/msg/LaserScan"),
        ("ros1", "ros1msg", "sensor_msgs/LaserScan"),
    ],
)
def test_mcap_of_either_ros(tmp_path: Path, encoding: str, schema_encoding: str, name: str) -> None:
    scan = _scan(START)
    data = serialized(scan)[1]
    if encoding == "ros1":  # a sequence number before the stamp, no alignment, no zero at the end of the frame
        head = struct.pack("<IIII", 1, *divmod(START, SECOND), 5) + b"front"
        data = head + struct.pack("<7f", -1.0, -0.51, 0.01, 0.0, 0.0, 0.1, 80.0)
        data += struct.pack("<I", 50) + scan.ranges_m.tobytes() + struct.pack("<I", 0)
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile=encoding)
        schema = writer.register_schema(name, schema_encoding, b"")
        writer.add_message(writer.register_channel("/scan", encoding, schema), START, data, START)
        writer.finish()  # type: ignore[no-untyped-call]
    with LogSource(path) as source:
        ((role, got),) = source.messages()
    assert role == "front"
    assert isinstance(got, LaserScan)
    assert (got.stamp_ns, got.frame_id, got.ranges_m.tolist()) == (START, "front", scan.ranges_m.tolist())


def test_unknown_types_are_listed_and_skipped(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="")
        schema = writer.register_schema("acme.Thing", "protobuf", b"xx")
        writer.add_message(writer.register_channel("/thing", "protobuf", schema), START, b"yy", START)
        writer.finish()  # type: ignore[no-untyped-call]
    with open_log(path) as reader:
        assert reader.topics()["/thing"].type_name == "acme.Thing"
        assert list(reader.records()) == []
        assert reader.damage == []


def test_database_of_a_crashed_recorder_with_its_write_ahead_log(tmp_path: Path) -> None:
    database = write_db3(tmp_path / "bag", 5)
    with open_log(database) as reader:
        whole = sum(1 for _ in reader.records())
    connection = sqlite3.connect(database)
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute("PRAGMA wal_autocheckpoint=0")
    connection.execute("INSERT INTO messages SELECT NULL, topic_id, timestamp + 1, data FROM messages")
    connection.commit()
    crashed = tmp_path / "crashed"
    shutil.copytree(database.parent, crashed)  # while the recorder has it open
    connection.close()
    assert (crashed / (database.name + "-wal")).stat().st_size
    with open_log(crashed / database.name) as reader:
        assert sum(1 for _ in reader.records()) == 2 * whole


def test_damage_is_told_once_however_often_it_is_read(tmp_path: Path) -> None:
    path = _write(tmp_path / "log.mcap", [START + i for i in range(100)])
    data = bytearray(path.read_bytes())
    at = data.find(b"zstd") + 40
    data[at : at + 8] = bytes(8)
    path.write_bytes(data[:-40])
    with open_log(path) as reader:
        counts = [sum(1 for _ in reader.records()) for _ in range(3)]
        assert counts[0] == counts[1] == counts[2]
        assert len(reader.damage) == len(set(reader.damage))
        assert not any("times)" in line for line in reader.damage)

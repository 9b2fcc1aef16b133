"""Our readers and our writer against other people's: mcap-ros2-support, rosbag (of ROS 1), rosbags."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.logs import open_log
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import GroundTruth, LaserScan, WheelPose
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from tests.logs.small_logs import sample_messages


def _stamp(message: Any) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


def _assert_scan(scan: LaserScan, other: Any, stamp_ns: int) -> None:
    assert scan.stamp_ns == stamp_ns
    assert scan.frame_id == other.header.frame_id.lstrip("/")
    numbers = (scan.angle_min_rad, scan.angle_increment_rad, scan.time_increment_s, scan.range_min_m, scan.range_max_m)
    theirs = (other.angle_min, other.angle_increment, other.time_increment, other.range_min, other.range_max)
    assert np.array_equal(np.array(numbers, np.float32), np.array(theirs, np.float32))
    assert np.array_equal(scan.ranges_m, np.array(other.ranges, np.float32), equal_nan=True)


@pytest.mark.parametrize("name", ["05_ual_vehicle/ual_2014_05_23.mcap", "07_bags/ccny_handheld_demo.mcap"])
def test_real_mcap_against_mcap_ros2(shared_data: Path, name: str) -> None:
    path = shared_data / name
    with open_log(path) as reader, path.open("rb") as file:
        records = [record for record in reader.records() if isinstance(record.message, (LaserScan, WheelPose))]
        theirs = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        count = 0
        for _, channel, message, other in theirs:
            if channel.topic == "/tf_static":
                continue
            if count < 1500:
                record = records[count]
                assert (record.topic, record.log_time_ns) == (channel.topic, message.log_time)
                if isinstance(record.message, LaserScan):
                    _assert_scan(record.message, other, _stamp(other))
                else:
                    assert record.message.stamp_ns == _stamp(other)
                    assert record.message[1] == other.pose.pose.position.x  # x_m
            count += 1
            if count == 1500:
                break
        assert count in (1500, len(records))


@pytest.mark.parametrize(("name", "count"), [("scans_demo.bag", 661), ("ccny_demo.bag", 360)])
def test_real_bags_against_the_tools_of_ros_1(shared_data: Path, name: str, count: int) -> None:
    rosbag = pytest.importorskip("rosbag", reason="rosbag-standalone is not installed: no independent reader of bags")
    path = shared_data / "07_bags" / name
    with open_log(path) as reader:
        ours = list(reader.records())
    assert len(ours) == count
    with rosbag.Bag(str(path)) as bag:
        for record, (topic, other, time) in zip(ours, bag.read_messages(), strict=True):
            assert (record.topic, record.log_time_ns) == (topic, time.to_nsec())
            assert isinstance(record.message, LaserScan)
            _assert_scan(record.message, other, other.header.stamp.to_nsec())


def test_written_log_read_by_rosbags(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    written = list(sample_messages(20))
    with LogWriter(path) as writer:
        for topic, message, log_ns in written:
            writer.write(topic, message, log_ns)
    with AnyReader([path]) as reader:
        theirs = {
            (connection.topic, time): reader.deserialize(data, connection.msgtype)
            for connection, time, data in reader.messages()
        }
    assert len(theirs) == len(written)
    for topic, message, log_ns in written:
        other: Any = theirs[topic, log_ns]
        if isinstance(message, LaserScan):
            _assert_scan(message, other, _stamp(other))
        if isinstance(message, GroundTruth):
            assert other.header.frame_id == "map"
            assert other.child_frame_id == "base_link"
            assert other.pose.pose.position.x == message.position_m[0]


def test_written_log_read_by_mcap_ros2_without_any_knowledge_of_types(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with LogWriter(path) as writer:
        for topic, message, log_ns in sample_messages(20):
            writer.write(topic, message, log_ns)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        decoded = {channel.topic: message for _, channel, _, message in reader.iter_decoded_messages()}
        assert decoded["/machine/command"].propel == 0.5
        assert decoded["/machine/command"].brake is True
        assert list(decoded["/machine/joints"].name) == ["articulation", "boom_lift"]
        assert len(list(reader.iter_metadata())) == 1
        assert len(list(reader.iter_attachments())) == 1

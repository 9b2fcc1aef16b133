"""A topic with messages of several types: the one that can be used is, in whatever order they come."""

from __future__ import annotations

import itertools
import sqlite3
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from lhdmap.logs import LogSource, open_log
from lhdmap.logs.base import TopicInfo
from lhdmap.logs.doctor.health import LogVerdict, examine
from lhdmap.logs.kinds import of_one_type
from lhdmap.logs.ros_messages import definition, serialized
from lhdmap.messages import LaserScan, Message, Text
from mcap.writer import Writer

START, STEP, COUNT = 1_700_000_000 * 10**9, 40_000_000, 60
SCAN, STRING = "sensor_msgs/msg/LaserScan", "std_msgs/msg/String"


def _scan(i: int) -> LaserScan:
    ranges = (5.0 + np.sin(0.1 * i + np.linspace(0.0, 6.0, 181))).astype(np.float32)
    return LaserScan(START + i * STEP, "laser", -1.57, 0.0174, 1e-5, 0.1, 80.0, ranges)


def _messages(texts: int) -> list[tuple[Message, int]]:
    scans: list[tuple[Message, int]] = [(_scan(i), START + i * STEP) for i in range(COUNT)]
    return scans + [(Text(0, "hello"), START + i * STEP + 1) for i in range(texts)]


def _mcap(path: Path, messages: Sequence[tuple[Message, int]], kinds: Sequence[str] = (SCAN, STRING)) -> Path:
    """Write messages on /scan, the channels in the order of `kinds`."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        channels = {}
        for kind in kinds:
            schema = writer.register_schema(kind, "ros2msg", definition(kind).encode())
            channels[kind] = writer.register_channel("/scan", "cdr", schema)
        for message, stamp in sorted(messages, key=lambda one: one[1]):
            kind, data = serialized(message)
            writer.add_message(channels[kind], stamp, data, stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def _database(path: Path, messages: Sequence[tuple[Message, int]], kinds: Sequence[str] = (SCAN, STRING)) -> Path:
    database = sqlite3.connect(path)
    database.execute(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL, "
        "offered_qos_profiles TEXT NOT NULL)"
    )
    database.execute(
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL)"
    )
    for number, kind in enumerate(kinds):
        database.execute("INSERT INTO topics VALUES (?, '/scan', ?, 'cdr', '')", (number + 1, kind))
    for message, stamp in messages:
        kind, data = serialized(message)
        database.execute("INSERT INTO messages VALUES (NULL, ?, ?, ?)", (kinds.index(kind) + 1, stamp, data))
    database.commit()
    database.close()
    return path


@pytest.mark.parametrize("kinds", [(SCAN, STRING), (STRING, SCAN)])
@pytest.mark.parametrize("texts", [1, COUNT, 5 * COUNT])  # more of them do not make it a topic of texts
@pytest.mark.parametrize("suffix", [".mcap", ".db3"])
def test_the_scans_of_a_topic_that_also_holds_texts(
    tmp_path: Path, kinds: tuple[str, str], texts: int, suffix: str
) -> None:
    write = _mcap if suffix == ".mcap" else _database
    path = write(tmp_path / f"log{suffix}", _messages(texts), kinds)
    told = f"/scan: also {texts} message{'s' * (texts > 1)} of type {STRING} on it, not used; it is read as {SCAN}"
    with LogSource(path) as source:
        assert source.roles == {"front": "/scan"}
        assert source.topics()["/scan"] == TopicInfo("/scan", SCAN, COUNT)
        got = list(source.messages())
        assert source.warnings == [f"{path}: {told}"]
    assert [role for role, _ in got] == ["front"] * COUNT
    assert all(isinstance(message, LaserScan) for _, message in got)
    with open_log(path) as reader:
        assert {type(record.message) for record in reader.records()} == {LaserScan}
        assert reader.stated_end_rad("/scan") == pytest.approx(-1.57 + 180 * 0.0174)
    outcome = examine(path)
    assert outcome.verdict is not LogVerdict.UNUSABLE
    assert any(told in finding.text for finding in outcome.findings)


def test_parts_of_a_bag_folder_with_other_types(tmp_path: Path) -> None:
    half = COUNT // 2
    _mcap(tmp_path / "a_0.mcap", [(Text(0, "x"), START - 5), *_messages(0)[:half]], (STRING, SCAN))
    _mcap(tmp_path / "a_1.mcap", _messages(0)[half:], (SCAN,))
    _mcap(tmp_path / "a_2.mcap", [(Text(0, "y"), START + COUNT * STEP)], (STRING,))
    with LogSource(tmp_path) as source:
        assert [message.stamp_ns for _, message in source.messages()] == [START + i * STEP for i in range(COUNT)]
        assert source.warnings == [
            f"{tmp_path}: /scan: also 2 messages of type {STRING} on it, not used; it is read as {SCAN}"
        ]


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_files_given_together_with_other_types(tmp_path: Path, order: tuple[int, int]) -> None:
    files = [
        _mcap(tmp_path / "scans.mcap", _messages(0), (SCAN,)),
        _mcap(tmp_path / "texts.mcap", [(Text(0, "x"), START + i) for i in range(3)], (STRING,)),
    ]
    with LogSource([files[i] for i in order]) as source:
        got = list(source.messages())
        assert [type(message) for _, message in got] == [LaserScan] * COUNT
        assert source.warnings == [f"/scan: also 3 messages of type {STRING} on it, not used; it is read as {SCAN}"]


FRONT = "/lidar/front/scan"
RANKED = [  # from the type that is meant to the one that is least
    TopicInfo(FRONT, SCAN, 5),  # the contract's
    TopicInfo(FRONT, "sensor_msgs/msg/PointCloud2", 900),  # a sensor's, most messages
    TopicInfo(FRONT, "sensor_msgs/msg/Imu", 30),
    TopicInfo(FRONT, STRING, 1000),  # can be decoded
    TopicInfo(FRONT, "acme_msgs/msg/Thing", 5000),
    TopicInfo(FRONT, "nav_msgs/msg/Odometry", 0),  # no message
]


@pytest.mark.parametrize("pair", list(itertools.combinations(RANKED, 2)))
@pytest.mark.parametrize("turned", [False, True])
def test_the_type_that_is_meant(pair: tuple[TopicInfo, TopicInfo], turned: bool) -> None:
    chosen, told = of_one_type(reversed(pair) if turned else pair)
    assert chosen == {FRONT: pair[0]}
    assert len(told) == (pair[1].count != 0)

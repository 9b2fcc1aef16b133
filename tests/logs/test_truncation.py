"""Logs cut off at any byte: no error but InputError, and every message that is wholly there is delivered."""

from __future__ import annotations

import bz2
import gzip
import random
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.logs import open_log
from lhdmap.logs.ros_messages import definition, serialized
from lhdmap.messages import LaserScan
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Reader as BagReader
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer
from rosbags.typesys import Stores, get_typestore

from tests.logs.small_logs import write_carmen

COUNT, CUTS = 60, 200
TOPIC, KIND = "/lidar/front/scan", "sensor_msgs/msg/LaserScan"
START_NS = 1_700_000_000_000_000_000


def _scans() -> list[LaserScan]:
    """Scans whose last ranges are a pattern that occurs nowhere else in the file."""
    rng = np.random.default_rng(5)
    return [
        LaserScan(START_NS + i * 10**7, "front", -1.0, 0.01, 0.0, 0.1, 80.0, ranges)
        for i, ranges in enumerate(rng.uniform(1, 50, (COUNT, 300)).astype(np.float32))
    ]


def _end_of(data: bytes, scan: LaserScan) -> int:
    """Return where a scan's message ends in a file that holds it as it is: ranges, then an empty array (4 bytes)."""
    at = data.find(scan.ranges_m[-4:].tobytes())
    assert at > 0
    return at + 16 + 4


def _delivered(path: Path) -> set[int]:
    """Return the stamps of the scans that come out; an InputError counts as none."""
    try:
        with open_log(path) as reader:
            return {record.message.stamp_ns for record in reader.records({TOPIC})}
    except InputError:
        return set()


def _cuts(size: int, seed: int) -> list[int]:
    rng = random.Random(seed)
    return [0, 1, size - 1, *(rng.randrange(size) for _ in range(CUTS - 3))]


def _check(path: Path, expected: Callable[[int], set[int]]) -> None:
    """Cut the file everywhere and compare with the stamps that must come out for each cut."""
    data = path.read_bytes()
    everything = _delivered(path)
    assert len(everything) == COUNT
    target = path.with_name("cut" + path.suffix)
    for cut in _cuts(len(data), seed=len(data)):
        target.write_bytes(data[:cut])
        got = _delivered(target)
        assert expected(cut) <= got <= everything, f"cut at {cut} of {len(data)}"


def _write_mcap(path: Path, compression: CompressionType, *, chunked: bool) -> None:
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=9000, compression=compression, use_chunking=chunked)
        writer.start(profile="ros2")
        schema = writer.register_schema(KIND, "ros2msg", definition(KIND).encode())
        channel = writer.register_channel(TOPIC, "cdr", schema)
        for scan in _scans():
            writer.add_message(channel, scan.stamp_ns, serialized(scan)[1], scan.stamp_ns)
        writer.finish()  # type: ignore[no-untyped-call]


@pytest.mark.parametrize("chunked", [True, False])
def test_uncompressed_mcap_gives_every_whole_message(tmp_path: Path, chunked: bool) -> None:
    path = tmp_path / "log.mcap"
    _write_mcap(path, CompressionType.NONE, chunked=chunked)
    data = path.read_bytes()
    ends = {scan.stamp_ns: _end_of(data, scan) for scan in _scans()}
    _check(path, lambda cut: {stamp for stamp, end in ends.items() if end <= cut})


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_compressed_mcap_gives_every_message_of_whole_chunks(tmp_path: Path, compression: CompressionType) -> None:
    path = tmp_path / "log.mcap"
    _write_mcap(path, compression, chunked=True)
    ends: dict[int, int] = {}
    with path.open("rb") as file:  # where each chunk ends, by the mcap package's own stream reader
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, Chunk):
                stamps = range(record.message_start_time, record.message_end_time + 1, 10**7)
                ends |= dict.fromkeys(stamps, file.tell())
    assert len(ends) == COUNT
    _check(path, lambda cut: {stamp for stamp, end in ends.items() if end <= cut})


def test_cut_compressed_chunk_gives_part_of_its_messages(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:  # one large chunk of several zstd blocks
        writer = Writer(file, chunk_size=1 << 30, compression=CompressionType.ZSTD)
        writer.start(profile="ros2")
        schema = writer.register_schema(KIND, "ros2msg", definition(KIND).encode())
        channel = writer.register_channel(TOPIC, "cdr", schema)
        rng = np.random.default_rng(7)
        for i in range(20 * COUNT):
            ranges = rng.uniform(1, 50, 300).astype(np.float32)
            scan = LaserScan(START_NS + i, "front", -1.0, 0.01, 0.0, 0.1, 80.0, ranges)
            writer.add_message(channel, scan.stamp_ns, serialized(scan)[1], scan.stamp_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with open_log(path) as reader:
        got = [record.message.stamp_ns for record in reader.records()]
        assert got == list(range(START_NS, START_NS + len(got)))
        assert len(got) > 5 * COUNT
        assert any("messages in that part are used" in line for line in reader.damage)


def _write_bag(path: Path, compression: BagWriter.CompressionFormat | None) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    writer = BagWriter(path)
    if compression is not None:
        writer.set_compression(compression)
    writer.chunk_threshold = 9000
    with writer:
        connection = writer.add_connection(TOPIC, KIND, typestore=store)
        for i, scan in enumerate(_scans()):
            seconds, nanoseconds = divmod(scan.stamp_ns, 10**9)
            head = struct.pack("<IIII", i, seconds, nanoseconds, 5) + b"front"
            numbers = struct.pack("<7f", -1.0, 2.0, 0.01, 0.0, 0.0, 0.1, 80.0)
            body = struct.pack("<I", 300) + scan.ranges_m.tobytes() + struct.pack("<I", 0)
            writer.write(connection, scan.stamp_ns, head + numbers + body)


def test_uncompressed_bag_gives_every_whole_message(tmp_path: Path) -> None:
    path = tmp_path / "log.bag"
    _write_bag(path, None)
    data = path.read_bytes()
    ends = {scan.stamp_ns: _end_of(data, scan) for scan in _scans()}
    first = data.find(b"op=\x07")  # the connection must be there as well
    _check(path, lambda cut: {stamp for stamp, end in ends.items() if end <= cut and first < cut})


@pytest.mark.parametrize("compression", [BagWriter.CompressionFormat.BZ2, BagWriter.CompressionFormat.LZ4])
def test_compressed_bag_gives_every_message_of_whole_chunks(
    tmp_path: Path, compression: BagWriter.CompressionFormat
) -> None:
    path = tmp_path / "log.bag"
    _write_bag(path, compression)
    ends: dict[int, int] = {}
    with BagReader(path) as reader:  # where each chunk ends at the latest: where the next one begins
        infos = sorted(reader.chunk_infos, key=lambda info: info.pos)
        for info, following in zip(infos, [*(info.pos for info in infos[1:]), path.stat().st_size], strict=True):
            ends |= dict.fromkeys(range(info.start_time, info.end_time + 1, 10**7), following)
    assert len(ends) == COUNT
    _check(path, lambda cut: {stamp for stamp, end in ends.items() if end <= cut})


def test_database_gives_every_message_whose_pages_are_there(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    rng = np.random.default_rng(6)
    scans = [  # every third message is larger than a page
        scan if i % 3 else scan._replace(ranges_m=rng.uniform(1, 50, 3000).astype(np.float32))
        for i, scan in enumerate(_scans())
    ]
    with Bag2Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection(TOPIC, KIND, typestore=store)
        for scan in scans:
            writer.write(connection, scan.stamp_ns, serialized(scan)[1])
    path = next((tmp_path / "bag").glob("*.db3"))
    data = path.read_bytes()
    page = int.from_bytes(data[16:18], "big")
    ends = {}
    for scan in scans:  # all pages that hold a part of the ranges
        parts = [data.find(scan.ranges_m[i : i + 2].tobytes()) for i in (0, len(scan.ranges_m) - 2)]
        ends[scan.stamp_ns] = max((at // page + 1) * page for at in parts)
    topics = (data.find(TOPIC.encode()) // page + 1) * page
    _check(path, lambda cut: {stamp for stamp, end in ends.items() if max(end, topics) <= cut})


@pytest.mark.parametrize("pack", [bytes, gzip.compress, bz2.compress])
def test_carmen_gives_every_whole_line(tmp_path: Path, pack: Callable[[bytes], bytes]) -> None:
    plain = write_carmen(tmp_path / "drive.clf", 40).read_bytes()
    path = tmp_path / "packed.clf"
    data = pack(plain)
    lines = plain.splitlines(keepends=True)
    ends = np.cumsum([len(line) for line in lines])
    scans = np.array([line.startswith(b"FLASER") for line in lines])
    for cut in _cuts(len(data), seed=3):
        path.write_bytes(data[:cut])
        try:
            with open_log(path) as reader:
                got = sum(1 for record in reader.records({"FLASER"}))
        except InputError:
            got = 0
        whole = int(scans[ends <= cut].sum())
        assert got <= 40
        if pack is bytes:
            # the last line may lack its end only
            assert whole <= got <= whole + 1, cut


def test_damage_of_a_cut_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    _write_mcap(path, CompressionType.ZSTD, chunked=True)
    path.write_bytes(path.read_bytes()[:-100])
    with open_log(path) as reader:
        assert sum(1 for _ in reader.records()) == COUNT
        assert len(reader.damage) == 1
        assert "cut off" in reader.damage[0]

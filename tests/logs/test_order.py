"""Messages come in log-time order, whatever their order in the file, with bounded memory."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lhdmap.logs import blocks, open_log
from lhdmap.logs.blocks import ChunkBlock, Loaded, in_time_order
from lhdmap.logs.ros_messages import definition, serialized
from lhdmap.messages import Tachometer, Text
from mcap.writer import CompressionType, IndexType, Writer

from tests.logs.small_logs import write_bag

KIND = "geometry_msgs/msg/TwistStamped"


def _write_shuffled(path: Path, times: list[int], *, index: bool, chunk_bytes: int = 2000) -> None:
    with path.open("wb") as file:
        kinds = IndexType.ALL if index else IndexType.NONE
        writer = Writer(
            file, chunk_size=chunk_bytes, compression=CompressionType.ZSTD, index_types=kinds, use_statistics=index
        )
        writer.start(profile="ros2")
        schema = writer.register_schema(KIND, "ros2msg", definition(KIND).encode())
        channel = writer.register_channel("/machine/tachometer", "cdr", schema)
        for time_ns in times:
            writer.add_message(channel, time_ns, serialized(Tachometer(time_ns, float(time_ns)))[1], time_ns)
        writer.finish()  # type: ignore[no-untyped-call]


@pytest.mark.parametrize("index", [True, False])
@pytest.mark.parametrize("budget", [1, 96 << 20])
def test_shuffled_log_comes_out_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, index: bool, budget: int
) -> None:
    monkeypatch.setattr(blocks, "BUDGET_BYTES", budget)  # 1: every block is dropped as soon as another one is loaded
    times = [1000 + 10 * i for i in range(500)]
    shuffled = random.Random(4).sample(times, len(times))
    path = tmp_path / "log.mcap"
    _write_shuffled(path, shuffled, index=index)
    with open_log(path) as reader:
        records = list(reader.records())
        assert [record.log_time_ns for record in records] == times
        assert [record.message.stamp_ns for record in records] == times
        assert reader.damage == []
        assert (reader.start_ns, reader.end_ns) == (times[0], times[-1])


def test_messages_of_one_time_keep_the_order_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=300)
        writer.start(profile="ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channel = writer.register_channel("/operation/mode", "cdr", schema)
        for i in range(50):
            writer.add_message(channel, 77, serialized(Text(0, str(i)))[1], 77)
        writer.finish()  # type: ignore[no-untyped-call]
    with open_log(path) as reader:
        texts = [record.message.text for record in reader.records() if isinstance(record.message, Text)]
    assert texts == [str(i) for i in range(50)]


@settings(max_examples=80, deadline=None)
@given(st.lists(st.lists(st.integers(0, 60), max_size=8), max_size=8))
def test_blocks_that_overlap_in_any_way_are_merged(times_of_blocks: list[list[int]]) -> None:
    content = {
        ChunkBlock(i, 1, 1, "", 0, min(times, default=0), max(times, default=0)): times
        for i, times in enumerate(times_of_blocks)
    }

    def load(block: ChunkBlock) -> Loaded:
        return Loaded(b"x", [(time_ns, block.offset, 0, 1) for time_ns in content[block]])

    got = [(time_ns, channel) for time_ns, channel, _ in in_time_order(list(content), load)]
    assert [time_ns for time_ns, _ in got] == sorted(time_ns for times in times_of_blocks for time_ns in times)
    assert sorted(got) == sorted((time_ns, i) for i, times in enumerate(times_of_blocks) for time_ns in times)


def test_blocks_are_loaded_only_when_their_time_comes() -> None:
    loaded: list[int] = []
    listed = [ChunkBlock(i, 1, 1, "", 0, 100 * i, 100 * i + 150) for i in range(50)]  # each overlaps the next one

    def load(block: ChunkBlock) -> Loaded:
        loaded.append(block.offset)
        return Loaded(b"x", [(block.start_ns, 0, 0, 1), (block.end_ns, 0, 0, 1)])

    for count, (time_ns, _, _) in enumerate(in_time_order(listed, load)):
        assert len(loaded) <= time_ns // 100 + 1, count
    assert loaded == list(range(50))


def test_unindexed_bag_is_in_order(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "log.bag", 40, None)
    with open_log(path) as reader:
        whole = list(reader.records())
        assert reader.damage == []
    data = path.read_bytes()
    index_at = data.rfind(b"op=\x07")  # the connections at the end of the file, then the chunk infos
    path.write_bytes(data[: index_at - 100])
    with open_log(path) as reader:
        got = list(reader.records())
        assert len(reader.damage) == 1
    assert [record.log_time_ns for record in got] == [record.log_time_ns for record in whole]

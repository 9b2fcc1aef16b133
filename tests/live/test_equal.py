"""A live run gives what its log gives afterwards, to the last digit; and what is lost or odd is told."""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from lhdmap.cli.main import main
from lhdmap.live.addresses import source_of
from lhdmap.live.run import LOG, LiveRequest, LiveResult, live
from lhdmap.live.source import LiveSource, Sink
from lhdmap.logs.source import LogSource
from lhdmap.pipeline.driven import ways_of
from lhdmap.pipeline.inputs import ROLES_READ
from lhdmap.pipeline.localize_run import LocalizeRequest, localize
from lhdmap.pipeline.mapping import MappingPipeline, feed
from lhdmap.pipeline.mounts import machine_of
from lhdmap.runfolder import RunFolder
from lhdmap.trajectory import write_tum

from tests.live.conftest import DISTANCE_M, LIGHT, SETTINGS
from tests.live.peers import Bridge, GrowingLog, Sent, messages_of, paced, running

OF_THE_MAP = ("trajectory.tum", "odometry.tum", "diagnostics.parquet", "cloud.ply", "topology.geojson", "pile.json")


def same_as_of_log(result: LiveResult) -> None:
    """Send the recorded log through the stages as `build-map` does, and compare the trajectories to the last digit."""
    with LogSource([result.folder / LOG]) as source:
        pipeline = MappingPipeline(LIGHT, machine_of(source, None))
        feed(pipeline, source.messages([role for role in ROLES_READ if role in source.roles]))
        ways = ways_of(pipeline, None)
        written = source.recorded_ns("front", ways.final.stamps_ns)
    for name, way in (("trajectory.tum", ways.final), ("odometry.tum", ways.odometry)):
        write_tum(result.folder / f"again_{name}", way._replace(stamps_ns=written))
        assert (result.folder / "map" / name).read_bytes() == (result.folder / f"again_{name}").read_bytes()


def write_growing(path: Path, messages: Sequence[Sent], speed: float) -> None:
    log = GrowingLog(path)
    for message in paced(messages, speed):
        log.write(message)
    log.finish()


def test_a_growing_file_gives_the_map_of_the_log(drive: Path, mapped: Path, tmp_path: Path) -> None:
    with running(write_growing, tmp_path / "grows.mcap", messages_of(drive), 3.0):
        shown: list[Any] = []
        source = source_of(str(tmp_path / "grows.mcap"))
        result = live(LiveRequest(source, tmp_path / "run", settings=SETTINGS, interval_s=0.2, show=shown.append))
    assert result.summary["stream"]["messages"] == len(messages_of(drive))
    assert result.summary["stream"]["dropped"] == {}
    assert result.warnings == list(RunFolder.open(result.folder).warnings)
    same_as_of_log(result)
    for name in OF_THE_MAP:  # what was recorded is what was sent
        assert (result.folder / "map" / name).read_bytes() == (mapped / name).read_bytes(), name
    last = shown[-1]
    assert last.pose is not None
    assert (
        DISTANCE_M - 2.5 < last.distance_m < DISTANCE_M + 0.5
    )  # it is 0.5 s behind: poses wait for the inclinometer's filter
    assert [status.scans for status in shown] == sorted(status.scans for status in shown)
    sources = RunFolder.open(result.folder / "map").info["sources"]
    assert [Path(one["path"]) for one in sources] == [result.folder / LOG]


def test_places_on_a_map_are_those_of_the_log(drive: Path, mapped: Path, tmp_path: Path) -> None:
    start = np.zeros(4)
    request = LiveRequest(source_of(f"mcap:{drive}"), tmp_path / "run", mapped, SETTINGS, start=start, warm=False)
    result = live(request)
    afterwards = localize(LocalizeRequest([result.folder / LOG], mapped, tmp_path / "again", SETTINGS, start=start))
    one, other = (
        pq.read_table(folder / "localization.parquet").drop_columns(["latency_ms"])
        for folder in (result.folder / "localization", afterwards.folder)
    )
    assert one.column_names == other.column_names
    for name in one.column_names:
        np.testing.assert_array_equal(one[name].to_numpy(), other[name].to_numpy(), name)
    assert result.summary["tracking_share"] == 1.0


def test_a_bridge_that_is_cut_twice(drive: Path, tmp_path: Path) -> None:
    bridge = Bridge(messages_of(drive), speed=3.0)
    bridge.cut_at = {len(bridge.messages) // 2, len(bridge.messages) * 2 // 3}
    said: list[str] = []
    ended = threading.Event()
    with bridge.served() as url, running(_stop_at_end, bridge, ended):
        source = _Until(source_of(f"foxglove:{url}"), ended)
        result = live(LiveRequest(source, tmp_path / "run", settings=LIGHT, warm=False, say=said.append))
    stream = result.summary["stream"]
    assert bridge.cuts == 2
    assert stream["reconnects"] >= 2
    assert sum("trying again" in text for text in said) == stream["reconnects"]
    assert stream["messages"] == len(bridge.messages)  # this bridge goes on where it was cut: nothing was lost
    assert bridge.offered[0] == ["foxglove.sdk.v1", "foxglove.websocket.v1"]
    same_as_of_log(result)


def test_a_clock_that_is_set_back_is_told_and_taken_out(drive: Path, tmp_path: Path) -> None:
    messages = messages_of(drive)
    middle = messages[len(messages) // 2].log_time_ns
    moved = [_set_back(one, 3_000_000_000) if one.log_time_ns > middle else one for one in messages]
    write_growing(tmp_path / "stepped.mcap", moved, 1e9)
    said: list[str] = []
    source = source_of(str(tmp_path / "stepped.mcap"))
    result = live(LiveRequest(source, tmp_path / "run", settings=LIGHT, warm=False, interval_s=0.01, say=said.append))
    assert result.summary["stream"]["clock_steps"] == 1
    assert any("set back by 3.0" in text for text in said)
    assert result.summary["distance_m"] == pytest.approx(DISTANCE_M, abs=0.5)
    same_as_of_log(result)


def test_a_computer_that_is_too_slow_drops_and_says_so(drive: Path, tmp_path: Path) -> None:
    messages = messages_of(drive)
    said: list[str] = []
    source = _Flood(messages)
    result = live(
        LiveRequest(source, tmp_path / "run", settings=LIGHT, warm=False, most=(100, 1 << 20), say=said.append)
    )
    stream = result.summary["stream"]
    assert stream["messages"] == len(messages)
    assert sum(stream["dropped"].values()) > 0
    assert any("dropped" in text for text in said)
    same_as_of_log(result)  # the log has all of them, and the map is made of it


def test_ctrl_c_is_the_end_of_the_stream_and_the_run_is_complete(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = GrowingLog(tmp_path / "grows.mcap")
    for message in messages_of(drive):
        log.write(message)
    light = ["--set", "pile.method=off", "--set", "topology.method=off"]
    threading.Timer(3.0, os.kill, (os.getpid(), signal.SIGINT)).start()  # the file is not complete: it waits
    assert main(["live", str(tmp_path / "grows.mcap"), "-o", str(tmp_path / "run"), "--json", *light]) == 0
    log.break_off()
    told = json.loads(capsys.readouterr().out)
    assert told["scans"] > 0
    assert RunFolder.open(tmp_path / "run").kind == "live"


def _set_back(message: Sent, by_ns: int) -> Sent:
    """Return a message as a clock that was set back would have it: log time and header stamp."""
    data = bytearray(message.data)
    if message.type_name not in ("std_msgs/msg/String", "tf2_msgs/msg/TFMessage"):
        sec, nanosec = np.frombuffer(message.data[4:12], "<u4").tolist()
        stamp = divmod(sec * 1_000_000_000 + nanosec - by_ns, 1_000_000_000)
        data[4:12] = np.array(stamp, "<u4").tobytes()
    return message._replace(log_time_ns=message.log_time_ns - by_ns, data=bytes(data))


def _stop_at_end(bridge: Bridge, ended: threading.Event) -> None:
    while bridge.next < len(bridge.messages):
        time.sleep(0.05)
    time.sleep(0.3)
    ended.set()


class _Until:
    """A source that is stopped from outside, as Ctrl-C does."""

    waits = False

    def __init__(self, source: LiveSource, ended: threading.Event) -> None:
        self.address, self._source, self._ended = source.address, source, ended

    def run(self, sink: Sink, stop: threading.Event) -> None:
        del stop
        self._source.run(sink, self._ended)


class _Flood:
    """A source that sends all at once."""

    address, waits = "test:flood", False

    def __init__(self, messages: Sequence[Sent]) -> None:
        self._messages = messages

    def run(self, sink: Sink, stop: threading.Event) -> None:
        from lhdmap.live.source import LiveMessage

        for message in self._messages:
            sink.put(LiveMessage(*message))

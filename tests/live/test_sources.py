"""Each source against a peer on this machine: what is sent arrives, and what is lost, late or cut is told."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.errors import InputError, InstallationError, UsageError
from lhdmap.live.addresses import source_of
from lhdmap.live.backlog import Backlog
from lhdmap.live.foxglove import Foxglove
from lhdmap.live.mcap_follow import McapFollow
from lhdmap.live.source import LinkLost, LiveSource
from lhdmap.live.zenoh_keys import announced, dds_type, topic_of
from lhdmap.logs.ros_messages import serialized
from lhdmap.messages import LaserScan

from tests.live.peers import Bridge, Caught, GrowingLog, Sent

SCAN = "sensor_msgs/msg/LaserScan"


def scans(count: int) -> list[Sent]:
    """Return scans at 100 Hz, each with its number in it."""
    made = []
    for k in range(count):
        scan = LaserScan(k + 1, "laser", 0.0, 0.1, 0.0, 0.0, 30.0, np.array([k, 1.0], np.float32))
        made.append(Sent("/scan", SCAN, 1_000_000_000 + 10_000_000 * k, serialized(scan)[1]))
    return made


@contextmanager
def followed(source: LiveSource) -> Iterator[tuple[Caught, threading.Event, list[BaseException]]]:
    """Run a source; yield its sink, what stops it, and what it raised."""
    caught, stop, raised = Caught(), threading.Event(), list[BaseException]()

    def run() -> None:
        try:
            source.run(caught, stop)
        except (LinkLost, InputError) as error:
            raised.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    yield caught, stop, raised
    stop.set()
    thread.join(10.0)
    assert not thread.is_alive()


@pytest.mark.parametrize("chunk_size", [0, 500])
def test_a_file_is_followed_to_its_end(tmp_path: Path, chunk_size: int) -> None:
    sent = scans(40)
    with followed(McapFollow(tmp_path / "a.mcap", quiet_s=5.0)) as (caught, _, raised):
        time.sleep(0.1)  # it is not there yet
        log = GrowingLog(tmp_path / "a.mcap", chunk_size)
        for message in sent[:20]:
            log.write(message)
        caught.wait_for(20 if not chunk_size else 10)
        for message in sent[20:]:
            log.write(message)
        log.finish()
        caught.wait_for(40)
    assert [Sent(*one[:4]) for one in caught.messages] == sent
    assert caught.topics["/scan"].definition.startswith("std_msgs/Header header")
    assert not raised


def test_a_file_whose_writer_died_ends_after_a_quiet_time(tmp_path: Path) -> None:
    log = GrowingLog(tmp_path / "a.mcap")
    for message in scans(10):
        log.write(message)
    log.break_off()
    with (tmp_path / "a.mcap").open("ab") as file:
        file.write(b"\x05\xff\x00")  # half of a record
    caught = Caught()
    McapFollow(tmp_path / "a.mcap", quiet_s=0.2).run(caught, threading.Event())
    assert len(caught.messages) == 10
    assert "nothing was written for 0 s" in caught.said[0]


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"no mcap at all, but long enough")
    with pytest.raises(InputError, match=r"a\.mcap: not an MCAP file"):
        McapFollow(tmp_path / "a.mcap", quiet_s=0.1).run(Caught(), threading.Event())


def test_a_file_that_does_not_appear_is_waited_for_aloud(tmp_path: Path) -> None:
    caught = Caught()
    with pytest.raises(InputError, match="no such file"):
        McapFollow(tmp_path / "a.mcap", quiet_s=0.1).run(caught, threading.Event())
    assert "a.mcap: not there yet; waiting for it" in caught.said[0]


def test_a_file_in_a_folder_that_is_not_there_is_refused_at_once(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="there is no folder"):
        source_of(str(tmp_path / "drvies" / "a.mcap"))


def test_a_bridge_sends_what_it_was_asked_for() -> None:
    sent = scans(30)
    picture = Sent("/camera", "std_msgs/msg/Header", 1, b"")
    bridge = Bridge([picture, *sent], speed=5.0)
    bridge.next = 1  # the picture is offered, and not asked for
    with bridge.served() as url, followed(Foxglove(url)) as (caught, _, raised):
        caught.wait_for(30)
    assert [Sent(*one[:4]) for one in caught.messages] == sent
    assert list(caught.topics) == ["/scan"]
    assert not raised or "broke" in str(raised[0])  # the bridge hangs up at the end


def test_a_backlog_is_given_up_for_what_is_new() -> None:
    bridge = Bridge(scans(2000), speed=1.0, delay_s=lambda k: 0.0 if k < 20 else 5.0 + 0.01 * k)
    with bridge.served() as url, followed(Foxglove(url)) as (caught, _, raised):
        deadline_s = time.monotonic() + 10.0
        while not raised and time.monotonic() < deadline_s:
            time.sleep(0.02)
    assert "old: given up for what is new" in str(raised[0])
    assert caught.given_up == 1


def test_a_backlog_is_told_from_a_link_that_catches_up_and_from_another_clock() -> None:
    clock = [0.0]
    watch = Backlog(now_ns=lambda: round(1e9 * (clock[0] + 500.0)), monotonic_s=lambda: clock[0])

    def late(late_s: float) -> bool:
        clock[0] += 0.1
        return watch.served_late(round(1e9 * (clock[0] - late_s)))

    assert not any(late(0.05) for _ in range(50))  # the sender's clock is 500 s behind: that is no lateness
    assert not any(late(4.0 - 0.2 * k) for k in range(21))  # a hole in the radio, caught up with
    found = [late(3.0) for _ in range(15)]
    assert not any(found[:10])
    assert found[-1]


def test_no_server_is_a_lost_link() -> None:
    with pytest.raises(LinkLost, match="no connection"):
        Foxglove("ws://127.0.0.1:9").run(Caught(), threading.Event())


def test_keys_of_rmw_zenoh() -> None:
    key = "@ros2_lv/0/aac3178e/0/11/MP/%/%/talker/%lidar%front%scan/sensor_msgs::msg::dds_::LaserScan_/RIHS01_ab/::,7:,:,:,,"
    found = announced(key)
    assert found is not None
    assert (found.topic, found.type_name) == ("/lidar/front/scan", SCAN)
    assert announced(key.replace("/MP/", "/MS/")) is None
    assert dds_type(SCAN) == "sensor_msgs::msg::dds_::LaserScan_"
    assert topic_of("7/lidar/front/scan/sensor_msgs::msg::dds_::LaserScan_/RIHS01_ab") == ("/lidar/front/scan", SCAN)
    assert topic_of("7/other/key") is None


@contextmanager
def vehicle(port: int) -> Iterator[Any]:
    """Be a zenoh peer that listens on this machine."""
    zenoh = pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed: pip install 'lhdmap[live]'")
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("listen/endpoints", f'["tcp/127.0.0.1:{port}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("timestamping/enabled", "true")
    session = zenoh.open(config)
    yield session
    session.close()


def test_zenoh_holes_latched_topics_and_a_peer_that_goes() -> None:
    zenoh = pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed: pip install 'lhdmap[live]'")
    from zenoh import ext

    key = f"0/lidar/front/scan/{dds_type(SCAN)}/RIHS01_ab"
    with vehicle(17447) as session:
        latched = ext.declare_advanced_publisher(
            session, f"0/tf_static/{dds_type('tf2_msgs/msg/TFMessage')}/RIHS01_ab", cache=ext.CacheConfig(1)
        )
        latched.put(b"mounts")  # before anybody listens
        with followed(source_of("zenoh:tcp/127.0.0.1:17447")) as (caught, _, raised):
            caught.wait_for(1)
            publisher = session.declare_publisher(key)
            for number in (1, 2, 3, 7, 8):
                count = ext.z_serialize((ext.Int64(number), ext.Int64(5), b"0123456789abcdef"))
                publisher.put(b"scan%d" % number, attachment=count)
            publisher.put(b"without", attachment=b"?")
            caught.wait_for(7)
            session.close()
            deadline_s = time.monotonic() + 5.0
            while not raised and time.monotonic() < deadline_s:
                time.sleep(0.02)
    assert [one.data for one in caught.messages] == [b"mounts", *(b"scan%d" % n for n in (1, 2, 3, 7, 8)), b"without"]
    assert {one.topic for one in caught.messages} == {"/tf_static", "/lidar/front/scan"}
    assert caught.holes == {"/lidar/front/scan": 3}
    assert "the other side is gone" in str(raised[0])
    assert zenoh is not None


def test_dds_on_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("cyclonedds", reason="cyclonedds is not installed: pip install 'lhdmap[dds]'")
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK)
    from cyclonedds.core import Policy, Qos
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic
    from cyclonedds.util import duration
    from lhdmap.live.dds_types import struct_of

    participant = DomainParticipant(77)
    kinds = {name: struct_of(name) for name in (SCAN, "std_msgs/msg/Header", "builtin_interfaces/msg/Time")}
    transforms = struct_of("tf2_msgs/msg/TFMessage")
    qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.TransientLocal)
    latched = DataWriter(participant, Topic(participant, "rt/tf_static", transforms), qos=qos)
    latched.write(transforms([]))
    writer = DataWriter(participant, Topic(participant, "rt/scan", kinds[SCAN]))
    with followed(source_of("dds:77")) as (caught, _, _):
        caught.wait_for(1)
        deadline_s = time.monotonic() + 10.0
        while "/scan" not in caught.topics and time.monotonic() < deadline_s:
            time.sleep(0.02)
        time.sleep(0.3)  # a writer must have found the reader
        header = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](0, 1), "laser")
        writer.write(kinds[SCAN](header, 0.0, 0.1, 0.1, 0.0, 0.2, 0.0, 30.0, [0.0, 1.0], []))
        caught.wait_for(2)
    assert caught.messages[0].topic == "/tf_static"
    scan = caught.messages[1]
    assert (scan.topic, scan.type_name) == ("/scan", SCAN)
    wanted = LaserScan(1, "laser", 0.0, 0.1, 0.0, 0.0, 30.0, np.array([0.0, 1.0], np.float32))
    assert len(scan.data) == len(serialized(wanted)[1])


LOOPBACK = (
    '<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>'
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    '<MaxAutoParticipantIndex>40</MaxAutoParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery>'
    "</Domain></CycloneDDS>"
)


@pytest.mark.parametrize(
    ("address", "wanted"),
    [
        ("http://host:80", "a source was wanted"),
        ("mcap:", "a source was wanted"),
        ("zenoh:host", "zenoh:tcp/HOST:7447 was wanted"),
        ("dds:lidar", "a domain number was wanted"),
        (".", "is a folder"),
    ],
)
def test_addresses_that_are_none(address: str, wanted: str) -> None:
    with pytest.raises(UsageError, match=wanted):
        source_of(address)


@pytest.mark.parametrize(
    ("address", "package", "extra"),
    [("ws://h:1", "websockets", "live"), ("zenoh:tcp/h:1", "zenoh", "live"), ("dds:0", "cyclonedds", "dds")],
)
def test_a_package_that_is_missing_is_named_with_its_extra(
    address: str, package: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, package, None)
    with pytest.raises(InstallationError, match=rf"pip install 'lhdmap\[{extra}\]'"):
        source_of(address)

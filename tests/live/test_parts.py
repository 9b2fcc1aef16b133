"""Counting, recording, queueing: the small parts of a live run."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lhdmap.config import Settings
from lhdmap.live.inbox import Inbox
from lhdmap.live.latency import Latency
from lhdmap.live.link import Link
from lhdmap.live.recorder import LiveRecorder
from lhdmap.live.source import Announced, LinkLost, LiveMessage, Sink
from lhdmap.live.tally import MessageTally
from lhdmap.live.warm_up import warm_up
from lhdmap.logs.formats import open_log
from lhdmap.odometry.anchored import rear_view
from lhdmap.scan_matching import submap

from tests.live.peers import messages_of

TEXT = "std_msgs/msg/String"
MS = 1_000_000


def text(topic: str, at_ms: int, size: int = 12) -> LiveMessage:
    return LiveMessage(topic, TEXT, 1_000_000 * MS + at_ms * MS, bytes(size))


def test_quantiles_are_right_to_two_percent() -> None:
    values = np.random.default_rng(1).lognormal(1.0, 1.0, 20_000)
    latency = Latency()
    for value in values:
        latency.add(float(value))
    for share in (0.5, 0.99):
        assert latency.quantile_ms(share) == pytest.approx(np.quantile(values, share), rel=0.025)
    assert latency.max_ms == values.max()
    assert latency.count == 20_000
    assert Latency().quantile_ms(0.5) is None


def test_gaps_of_regular_topics_are_counted_and_pauses_of_others_are_not() -> None:
    tally = MessageTally()
    at_ms = [20 * k for k in range(100)] + [3000 + 20 * k for k in range(100)]
    found = [tally.count("/scan", ms * MS, 10) for ms in at_ms]
    assert [gap for gap in found if gap is not None] == [pytest.approx(1.02)]
    for ms in (0, 900, 9000, 9100, 50_000):
        assert tally.count("/mode", ms * MS, 10) is None
    assert (tally.gaps, tally.messages, tally.bytes) == (1, 205, 2050)


def test_the_log_has_the_order_in_which_messages_came(tmp_path: Path) -> None:
    recorder = LiveRecorder(tmp_path / "a.mcap")
    came = [text("/a", 0), text("/b", 10), text("/a", 5), text("/b", 30), text("/a", -2000), text("/b", -1990)]
    written = [recorder.write(message) for message in came]
    recorder.announce(Announced("/silent", "unknown_msgs/msg/Odd"))
    recorder.close()
    apart_ms = [(one.log_time_ns - came[0].log_time_ns) // MS for one in written]
    assert apart_ms == [
        0,
        10,
        10,
        30,
        -2000,
        -1990,
    ]  # a late one takes the time of the one before; a clock set back stays
    assert sorted(one.log_time_ns for one in messages_of(tmp_path / "a.mcap")) == sorted(
        one.log_time_ns for one in written
    )
    with open_log(tmp_path / "a.mcap") as log:
        assert {name: info.count for name, info in log.topics().items()} == {"/a": 3, "/b": 3, "/silent": 0}
        assert not log.damage


def test_a_log_that_was_never_closed_can_be_read(tmp_path: Path) -> None:
    recorder = LiveRecorder(tmp_path / "a.mcap")
    for k in range(30):
        recorder.write(text("/a", k))
        time.sleep(0.01)
    kept = tmp_path / "killed.mcap"
    kept.write_bytes((tmp_path / "a.mcap").read_bytes())
    recorder.close()
    assert len(messages_of(kept)) >= 15  # what was flushed: ten times a second


@pytest.mark.parametrize("most", [(5, 1 << 20), (1000, 60)])
def test_a_full_queue_drops_the_oldest_and_counts_it(tmp_path: Path, most: tuple[int, int]) -> None:
    inbox = Inbox(LiveRecorder(tmp_path / "a.mcap"), MessageTally(), waits=False, most=most)
    for k in range(20):
        inbox.put(text("/a", k))
    kept = len(inbox)
    assert 3 <= kept < 5
    assert inbox.tally.dropped == {"/a": 20 - kept}
    first = inbox.get(0.0)
    assert first is not None
    assert first.log_time_ns == text("/a", 20 - kept).log_time_ns
    inbox.end()
    assert len(messages_of(tmp_path / "a.mcap")) == 20


def test_a_source_that_can_wait_is_held_up_and_nothing_is_dropped(tmp_path: Path) -> None:
    inbox = Inbox(LiveRecorder(tmp_path / "a.mcap"), MessageTally(), waits=True, most=(5, 1 << 20))

    def send() -> None:
        for k in range(50):
            inbox.put(text("/a", k))

    sender = threading.Thread(target=send, daemon=True)
    sender.start()
    got = [message for _ in range(50) if (message := inbox.get(5.0)) is not None]
    sender.join(5.0)
    assert [one.log_time_ns for one in got] == [text("/a", k).log_time_ns for k in range(50)]
    assert not inbox.tally.dropped
    inbox.end()


class _Shaky:
    """A source whose link breaks three times."""

    address, waits = "test:shaky", False

    def __init__(self) -> None:
        self.began_s: list[float] = []

    def run(self, sink: Sink, stop: threading.Event) -> None:
        self.began_s.append(time.monotonic())
        sink.put(text("/a", len(self.began_s)))
        if len(self.began_s) < 4:
            raise LinkLost("it broke")


def test_a_lost_link_is_made_again_after_growing_waits(tmp_path: Path) -> None:
    inbox, source = Inbox(LiveRecorder(tmp_path / "a.mcap"), MessageTally(), waits=False), _Shaky()
    link = Link(source, inbox)
    link.start()
    while not inbox.over:
        inbox.get(0.1)
    link.close()
    waits_s = np.diff(source.began_s)
    assert (waits_s > [0.2, 0.4, 0.8]).all()
    assert inbox.tally.reconnects == 3
    assert list(inbox.said) == ["test:shaky: it broke; trying again"] * 3


class _Faulty:
    address, waits = "test:faulty", False

    def run(self, sink: Sink, stop: threading.Event) -> None:
        raise ValueError("a fault")


def test_what_ends_a_source_is_raised_where_its_messages_are_read(tmp_path: Path) -> None:
    inbox = Inbox(LiveRecorder(tmp_path / "a.mcap"), MessageTally(), waits=False)
    link = Link(_Faulty(), inbox)
    link.start()
    with pytest.raises(ValueError, match="a fault"):
        inbox.get(5.0)
    link.close()


def test_the_warm_up_runs_the_kernels_that_a_link_that_breaks_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    ran = list[str]()

    def counted(module: Any, name: str) -> None:
        kernel = getattr(module, name)

        def run(*arguments: Any, **more: Any) -> Any:
            ran.append(name)
            return kernel(*arguments, **more)

        monkeypatch.setattr(module, name, run)

    counted(submap, "search")
    counted(rear_view, "_joint_equation")
    warm_up(Settings(), None)
    assert set(ran) == {"search", "_joint_equation"}

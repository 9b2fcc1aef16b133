"""Clocks: one for the whole log, stamps that begin at zero, and clocks that are set while the log is recorded."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import LhdmapError
from lhdmap.logs.blocks import ChunkBlock, Loaded
from lhdmap.logs.doctor.health import examine
from lhdmap.logs.formats import open_log
from lhdmap.logs.order import clock_was_set_back
from lhdmap.logs.ros_messages import serialized
from lhdmap.logs.source import LogSource
from lhdmap.logs.stamp_clocks import ONE_CLOCK, Sample, find_clocks
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import Inclination, Message, Tachometer
from lhdmap.pipeline.build import BuildRequest, build_map

from tests.logs import drives

SECOND = 10**9
AT = 80


def _stepped(path: Path, step_s: float, *, at: int = AT) -> Path:
    """Write the drive with a clock that is set by `step_s` before scan `at`; the tachometer comes with it."""

    def shift(k: int) -> int:
        return round(step_s * SECOND) if k >= at else 0

    def others(k: int) -> list[tuple[str, Message]]:
        half = drives.PERIOD_NS // 2
        stamps = [drives.START_NS + k * drives.PERIOD_NS + shift(k) + part for part in (-half, 0)]
        return [("/machine/tachometer", Tachometer(stamp, drives.SPEED_MPS + 0.01 * (k % 3))) for stamp in stamps]

    return drives.write(
        path,
        lambda k, scan: scan._replace(stamp_ns=scan.stamp_ns + shift(k)),
        lambda k: drives.START_NS + k * drives.PERIOD_NS + drives.LATE_NS + shift(k),
        others,
    )


@pytest.mark.parametrize("step_s", [-0.5, -4.0, -3600.0, 0.7, 2.0, 3600.0])
def test_a_clock_that_is_set_in_mid_drive_is_taken_out_and_told(tmp_path: Path, step_s: float) -> None:
    log = _stepped(tmp_path / "log.mcap", step_s)
    outcome = examine(log)
    (told,) = (finding.text for finding in outcome.findings if "clock was set" in finding.text)
    word = "back" if step_s < 0 else "forward"
    assert f"set {word} by {abs(step_s):.2f} s, 6.4 s after the start" in told
    assert not any("gap" in finding.text or "backwards" in finding.text for finding in outcome.findings)
    found = build_map(BuildRequest([log], tmp_path / "map"))
    assert drives.along_error_m(found.trajectory.positions_m) < 0.05
    recorded = [scan.stamp_ns + (round(step_s * SECOND) if k >= AT else 0) for k, scan in enumerate(drives.drive()[1])]
    assert found.trajectory.stamps_ns.tolist() == recorded  # each pose under the stamp of its scan
    assert sum("clock was set" in text for text in found.warnings) == 1


def test_a_pause_in_which_the_machine_drove_on_is_a_pause(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    kept = [k for k in range(150) if not 60 <= k < 85]
    with LogWriter(log) as writer:
        for k in kept:
            writer.write(drives.FRONT, drives.drive()[1][k])
    with open_log(log) as reader:
        stamps = [record.message.stamp_ns for record in reader.records()]
        assert reader.clock_steps == []
    assert stamps == [drives.drive()[1][k].stamp_ns for k in kept]


def test_a_pause_of_a_standing_machine_is_a_pause(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    first = drives.drive()[1][0]
    log = tmp_path / "log.mcap"
    with LogWriter(log) as writer:
        for k in range(120):
            noise = rng.normal(0.0, 0.01, len(first.ranges_m)).astype(np.float32)
            stamp = first.stamp_ns + k * drives.PERIOD_NS + (5 * SECOND if k >= 70 else 0)
            writer.write(drives.FRONT, first._replace(stamp_ns=stamp, ranges_m=first.ranges_m + noise))
    with open_log(log) as reader:
        assert len(list(reader.records())) == 120
        assert reader.clock_steps == []


def test_usual_times_between_messages_are_not_moved_by_a_step(tmp_path: Path) -> None:
    """A step of an hour made the mean of 20 messages minutes long, and no gap was seen any more."""
    log = tmp_path / "log.mcap"
    with LogWriter(log) as writer:
        for k, scan in enumerate(drives.drive()[1][:60]):
            later = (3600 * SECOND if k >= 20 else 0) + (2 * SECOND if k >= 40 else 0)
            ranges = scan.ranges_m + np.float32(0.3 * (k >= 20) + 0.5 * (k >= 40))  # elsewhere
            writer.write(drives.FRONT, scan._replace(stamp_ns=scan.stamp_ns + later, ranges_m=ranges))
    texts = [finding.text for finding in examine(log).findings]
    assert any("2 gaps, the longest 3600.08 s" in text and "usually 0.080 s" in text for text in texts), texts


def test_simulation_time_from_zero_is_one_clock_for_all(tmp_path: Path) -> None:
    """The scanner alone went to the wall clock, inclinometer and wheels were silently unused."""

    def others(k: int) -> list[tuple[str, Message]]:
        stamp = k * drives.PERIOD_NS + 1_000_000
        return [
            ("/inclinometer", Inclination(stamp, "laser", 0.01, 0.02 + 1e-4 * (k % 5), None, None)),
            ("/machine/tachometer", Tachometer(stamp, 2.0 + 0.01 * (k % 3))),
        ]

    log = drives.write(
        tmp_path / "log.mcap", lambda k, scan: scan._replace(stamp_ns=k * drives.PERIOD_NS), others=others
    )
    with LogSource(log) as source:
        stamps: dict[str, list[int]] = {}
        for role, message in source.messages():
            stamps.setdefault(role, []).append(message.stamp_ns)
        assert source.warnings == []
    assert stamps["front"] == [k * drives.PERIOD_NS for k in range(150)]
    assert stamps["tachometer"] == [k * drives.PERIOD_NS + 1_000_000 for k in range(150)]


def test_messages_without_a_stamp_come_to_the_clock_of_the_stamps(tmp_path: Path) -> None:
    log = drives.write(
        tmp_path / "log.mcap",
        lambda k, scan: scan._replace(stamp_ns=(k + 1) * drives.PERIOD_NS),
        others=lambda k: [("/machine/tachometer", Tachometer(0, 2.0 + 0.01 * (k % 3)))],
    )
    with LogSource(log) as source:
        found = dict(source.messages(["front", "tachometer"]))
    assert found["tachometer"].stamp_ns == pytest.approx(found["front"].stamp_ns, abs=5_000_000)


def test_a_topic_with_a_clock_of_its_own_is_moved_to_that_of_the_others() -> None:
    samples = [Sample("/imu", k, 10**18 + k) for k in range(1, 9)]
    samples += [Sample("/scan", 10**18 + k - 5, 10**18 + k) for k in range(1, 9)]
    clocks = find_clocks(samples)
    assert clocks.offset_ns == 0
    assert clocks.foreign_ns == {"/imu": 10**18 - 5}
    assert find_clocks([sample for sample in samples if sample.topic == "/scan"]) == ONE_CLOCK


def test_zero_is_a_time_only_where_the_clock_begins_there() -> None:
    begins = [Sample("/scan", 40 * k, 10**18 + 40 * k) for k in range(9)]
    assert find_clocks(begins).begin_at_zero == {"/scan"}
    unstamped = [Sample("/scan", 0, 10**18 + k) for k in range(9)]
    stamped = [Sample("/imu", 10**18 + k, 10**18 + k + 2) for k in range(9)]
    assert find_clocks(unstamped + stamped).begin_at_zero == frozenset()


def _says(pieces: list[range]) -> bool:
    times = np.concatenate([np.array(list(piece)) for piece in pieces]).astype(np.int64)
    return clock_was_set_back(times, np.zeros(len(times), dtype=np.int64))


@pytest.mark.parametrize(
    ("pieces", "set_back"),
    [
        ([range(0, 300, 10), range(250, 600, 10)], True),  # runs once more through what was
        ([range(10**12, 10**12 + 300, 10), range(0, 300, 10)], True),  # an hour back
        ([range(300, 600, 10), range(0, 300, 10)], False),  # blocks in the wrong order
        ([range(0, 600, 10)], False),
        ([range(k, k + 20, 10) for k in range(300, 0, -20)], False),  # all of it out of order
    ],
)
def test_a_clock_set_back_is_told_from_a_file_out_of_order(pieces: list[range], set_back: bool) -> None:
    assert _says(pieces) == set_back


def test_blocks_are_read_ahead_only_where_they_run_back() -> None:
    from lhdmap.logs.blocks import set_back

    def load(_: ChunkBlock) -> Loaded:
        raise LhdmapError("read")

    listed = [ChunkBlock(k, 1, 1, "", 0, 10**9 * k, 10**9 * (k + 1)) for k in range(9)]
    assert not set_back(listed, load)
    with pytest.raises(LhdmapError):
        set_back(listed[::-1], load)


def _database(path: Path, times_ns: list[int]) -> Path:
    """Write a ROS 2 bag in SQLite by hand: tachometer messages in the order given."""
    data = [serialized(Tachometer(ns, 1.0 + k))[1] for k, ns in enumerate(times_ns)]
    with closing(sqlite3.connect(path)) as base, base:
        base.execute("CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)")
        base.execute("CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
        base.execute("INSERT INTO topics VALUES (1, '/machine/tachometer', 'geometry_msgs/msg/TwistStamped', 'cdr')")
        rows = [(1, ns, message) for ns, message in zip(times_ns, data, strict=True)]
        base.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    return path


def test_a_database_with_a_clock_set_back_is_read_as_written(tmp_path: Path) -> None:
    times = [(10 + k) * SECOND for k in range(40)] + [(30 + k) * SECOND for k in range(40)]
    with open_log(_database(tmp_path / "log.db3", times)) as reader:
        assert [record.log_time_ns for record in reader.records()] == times
        assert [step.by_ns for step in reader.clock_steps] == [-20 * SECOND]
    with open_log(_database(tmp_path / "other.db3", times[40:] + times[:20])) as reader:
        assert [record.log_time_ns for record in reader.records()] == sorted(times[40:] + times[:20])


@pytest.mark.parametrize(
    ("starts_s", "wanted"),
    [((0, 60, 120), "012"), ((120, 0, 60), "120"), ((0, 40, 100), "012"), ((7200, 60, 120), "012")],
)
def test_files_of_a_bag_follow_each_other(tmp_path: Path, starts_s: tuple[int, ...], wanted: str) -> None:
    """By time where only their names are out of order, as listed where the clock was set back between them."""
    for part, start_s in enumerate(starts_s):
        with LogWriter(tmp_path / f"drive_{part}.mcap") as writer:
            for k in range(60):
                stamp = (start_s + k + 1) * SECOND
                writer.write("/machine/tachometer", Tachometer(stamp, float(part)), stamp)
    with open_log(tmp_path) as reader:
        speeds = [record.message.speed_mps for record in reader.records() if isinstance(record.message, Tachometer)]
    assert "".join(str(int(speed)) for speed in speeds[::60]) == wanted

"""Times of points as drivers give them, rightly and wrongly, against the times that the points were measured at."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from lhdmap.logs import LogSource, open_log
from lhdmap.logs.cloud_times import CloudTimes
from lhdmap.logs.doctor.health import examine
from lhdmap.messages import PointCloud
from lhdmap.pipeline.sweep_times import SweepTimes
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore

FIRST_NS, PERIOD_NS = 1_700_000_000_123_456_789, 100_000_000
COLUMNS, RINGS, CLOUDS = 100, 8, 20
POINTS = COLUMNS * RINGS
TRUE_S = np.repeat(np.arange(COLUMNS) * 1e-3, RINGS)  # a column of points each millisecond, as the scanner turns
NS = np.round(TRUE_S * 1e9).astype(np.int64)
KIND = "sensor_msgs/msg/PointCloud2"
STORE = get_typestore(Stores.ROS2_HUMBLE)
Raw = npt.NDArray[Any]


def _wrapped(ns: npt.NDArray[np.int64]) -> Raw:
    """Return what a driver stores that counts in 32 bits without a sign."""
    return ns.astype(np.uint32)


def _replaced(values: Raw, share: float, by: Callable[[np.random.Generator, int], Raw], seed: int = 0) -> Raw:
    rng = np.random.default_rng(seed)
    out, chosen = values.copy(), rng.choice(POINTS, int(share * POINTS), replace=False)
    out[chosen] = by(rng, len(chosen)).astype(values.dtype)
    return out


def _block(start: float, end: float, off_ns: int) -> Raw:
    """Return counts of which one stretch of points is off."""
    ns = NS.copy()
    ns[int(start * POINTS) : int(end * POINTS)] += off_ns
    return _wrapped(ns)


def _read(make: Callable[[int], Raw], clouds: int = CLOUDS) -> tuple[list[npt.NDArray[np.float32]], list[str]]:
    times = CloudTimes()
    stamps = [FIRST_NS + k * PERIOD_NS for k in range(clouds)]
    return [times.seconds(make(stamp), stamp, "top") for stamp in stamps], times.remarks("/points")


SOUND: dict[str, Callable[[int], Raw]] = {
    "uint32 ns": lambda _: _wrapped(NS),
    "int32 ns": lambda _: NS.astype(np.int32),
    "float64 ns": lambda _: TRUE_S * 1e9,
    "float32 s": lambda _: TRUE_S.astype(np.float32),
    "float64 s, absolute": lambda stamp: TRUE_S + 1e-9 * stamp,
    "float64 ns, absolute": lambda stamp: 1e9 * TRUE_S + stamp,
    "float64 us, absolute": lambda stamp: 1e6 * TRUE_S + 1e-3 * stamp,
    "sorted by ring": lambda _: _wrapped(NS.reshape(COLUMNS, RINGS).T.ravel()),
    "in no order": lambda _: _wrapped(np.random.default_rng(0).permutation(NS)),
    "one column": lambda _: _wrapped(NS[:5]),
}


@pytest.mark.parametrize("name", SOUND)
def test_times_of_sound_drivers(name: str) -> None:
    got, remarks = _read(SOUND[name])
    wanted = {"sorted by ring": NS.reshape(COLUMNS, RINGS).T.ravel() * 1e-9, "one column": NS[:5] * 1e-9}.get(
        name, TRUE_S
    )
    if name == "in no order":
        wanted = np.random.default_rng(0).permutation(NS) * 1e-9
    assert all(np.allclose(times, wanted, atol=1e-6) for times in got)
    assert remarks == [] or name == "float64 ns"  # floats are seconds, as a rule


ODD: dict[str, tuple[Callable[[int], Raw], str, float]] = {  # what is stored, what is said, how far off times may be
    "uint32 us": (lambda _: _wrapped(NS // 1000), "microseconds", 1e-6),
    "uint16 us": (lambda _: (NS // 2000).astype(np.uint16), "microseconds", 0.05),  # half the speed, to fit
    "float32 ms": (lambda _: (1e3 * TRUE_S).astype(np.float32), "milliseconds", 1e-6),
    "another clock": (lambda stamp: TRUE_S + 1e-9 * stamp - 1.6e9, "another clock", 1e-6),
    "another clock that wraps": (lambda stamp: _wrapped(NS + 2**32 - 50_000_000 + 0 * stamp), "wrapped", 0.051),
    "us of the hour": (lambda stamp: _wrapped(NS // 1000 + stamp // 1000 % 3_600_000_000), "another clock", 1e-6),
    "single ones off by seconds": (
        lambda _: _replaced(_wrapped(NS), 0.01, lambda rng, n: rng.integers(10**9, 4 * 10**9, n)), "1 %", 2e-3
    ),
    "a third at random": (
        lambda _: _replaced(_wrapped(NS), 0.33, lambda rng, n: rng.integers(0, 2**32, n)), "nonsense for 3", 0.02
    ),
    "no numbers": (
        lambda _: _replaced(TRUE_S.astype(np.float32), 0.2, lambda rng, n: np.full(n, np.nan)), "20 %", 2e-3
    ),
    "a sector wrapped below zero": (lambda _: _block(0.60, 0.75, -70_000_000), "15 %", 1e-3),
    "a wide sector wrapped below zero": (lambda _: _block(0.40, 0.70, -90_000_000), "30 %", 1e-3),
    "a sector ahead": (lambda _: _block(0.20, 0.30, 2_000_000_000), "10 %", 1e-3),
    "points wrapped below zero": (
        lambda _: _wrapped(np.where(np.random.default_rng(1).random(POINTS) < 0.15, NS - 70_000_000, NS)), "1", 0.02
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ODD)
def test_times_of_odd_drivers(name: str) -> None:
    make, said, off_s = ODD[name]
    got, remarks = _read(make)
    assert any(said in line for line in remarks), remarks
    assert all("/points: the times of its points are" in line for line in remarks)
    for times in got:
        assert len(times) == POINTS
        assert np.quantile(np.abs(times - TRUE_S), 0.9 if name == "a third at random" else 1.0) <= off_s
        assert np.median(np.abs(times - TRUE_S)) <= max(1e-6, off_s if off_s > 0.03 else 0.0)


@pytest.mark.parametrize("middle_s", [-0.1, -0.05])
@pytest.mark.parametrize("counts", ["uint32", "float32"])
def test_a_stamp_in_the_middle_or_at_the_end_of_the_sweep(middle_s: float, counts: str) -> None:
    after_s = TRUE_S + middle_s
    raw = _wrapped(np.round(after_s * 1e9).astype(np.int64)) if counts == "uint32" else after_s.astype(np.float32)
    got, remarks = _read(lambda _: raw)
    assert all(np.allclose(times, after_s, atol=1e-6) for times in got)
    assert [("wrapped below zero" in line) for line in remarks] == [True] * (counts == "uint32")


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (lambda _: _wrapped(10 * NS), "not those of a sweep in 20 of 20"),  # a sweep of a second, ten in a second
        (lambda _: np.random.default_rng(2).integers(0, 2**32, POINTS).astype(np.uint32), "not those of a sweep"),
        (lambda _: np.full(POINTS, np.nan), "not those of a sweep"),
        (lambda _: np.zeros(POINTS, np.uint32), "all the same in 20 of 20"),
        (lambda stamp: (TRUE_S + 1e-9 * stamp).astype(np.float32), "all the same"),  # float32 tells two minutes apart
    ],
)
def test_times_that_say_nothing_are_not_used(raw: Callable[[int], Raw], said: str) -> None:
    got, remarks = _read(raw)
    assert all(len(times) == 0 for times in got)
    assert any(said in line and "not compensated" in line for line in remarks), remarks


def test_two_scanners_in_turn_each_with_its_own_period() -> None:
    times, got = CloudTimes(), []
    for k in range(2 * CLOUDS):
        stamp = FIRST_NS + k * PERIOD_NS // 2
        got.append(times.seconds(_wrapped(NS), stamp, f"lidar_{k % 2}"))
    assert all(np.allclose(one, TRUE_S) for one in got)
    assert times.remarks("/points") == []


def test_clouds_that_come_in_bunches() -> None:
    times = CloudTimes()
    stamps = [FIRST_NS + (k // 5) * 5 * PERIOD_NS + (k % 5) * 1_000_000 for k in range(40)]
    assert all(np.allclose(times.seconds(_wrapped(NS), stamp, "top"), TRUE_S) for stamp in stamps)


def test_sweeps_of_blocks_from_two_scanners() -> None:
    """Half a turn apart, a packet of each in turn: they leap, and are right."""
    both = np.stack([NS.reshape(10, -1), NS.reshape(10, -1) + 50_000_000], axis=1).ravel()
    times = CloudTimes()
    for k in range(CLOUDS):
        assert np.allclose(times.seconds(_wrapped(both), FIRST_NS + 2 * k * PERIOD_NS, "top"), both * 1e-9)


@pytest.mark.parametrize("values", [[1e308, -1e308, 0.0] * 20, [np.inf, -np.inf, np.nan, 1.0] * 20, [5e-324] * 40])
@pytest.mark.filterwarnings("error")
def test_numbers_at_the_end_of_their_range(values: list[float]) -> None:
    times = CloudTimes()
    for k in range(3):
        got = times.seconds(np.array(values), FIRST_NS + k, "top")
        assert len(got) in (0, len(values))
        assert np.isfinite(got).all()


def _log(path: Path, make: Callable[[int], Raw], blind: int = 0) -> Path:
    """Write clouds of a drum around the scanner, with a field `t` (uint32); the first ones have no return."""
    types, field = STORE.types, STORE.types["sensor_msgs/msg/PointField"]
    angles = np.repeat(2.0 * np.pi * np.arange(COLUMNS) / COLUMNS, RINGS)
    table = np.zeros(POINTS, dtype=[("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("t", "<u4")])
    heights = np.tile(np.linspace(-1.0, 1.0, RINGS), COLUMNS)
    table["x"], table["y"], table["z"] = 4.0 * np.cos(angles), 3.0 * np.sin(angles), heights
    for name in "xyz":
        table[name][:blind] = 0.0
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/points", "cdr", writer.register_schema(KIND, "ros2msg", b""))
        for k in range(CLOUDS):
            stamp = FIRST_NS + k * PERIOD_NS
            table["t"] = make(stamp)
            time = types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
            message = types[KIND](
                header=types["std_msgs/msg/Header"](stamp=time, frame_id="top"), height=1, width=POINTS,
                fields=[field(name=name, offset=4 * i, datatype=7 if i < 3 else 6, count=1) for i, name in enumerate("xyzt")],
                is_bigendian=False, point_step=16, row_step=16 * POINTS, data=table.view(np.uint8).reshape(-1), is_dense=True,
            )  # fmt: skip
            writer.add_message(channel, stamp, bytes(STORE.serialize_cdr(message, KIND)), stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def test_a_log_is_read_and_told_of(tmp_path: Path) -> None:
    path = _log(tmp_path / "log.mcap", lambda _: _block(0.60, 0.75, -70_000_000))
    with LogSource(path) as source:
        for _ in range(2):  # what is said of a log does not grow when it is read again
            clouds = [message for _, message in source.messages() if isinstance(message, PointCloud)]
            assert all(np.allclose(cloud.time_offsets_s, TRUE_S, atol=1e-3) for cloud in clouds)
            (line,) = [line for line in source.warnings if "nonsense" in line]
            assert "/points: the times of its points are nonsense for 15 % of the points (up to 0.07" in line
    assert any("nonsense for 15 %" in finding.text for finding in examine(path).findings)


def test_points_at_the_scanner_itself_are_no_returns(tmp_path: Path) -> None:
    path = _log(tmp_path / "log.mcap", lambda _: _wrapped(NS), blind=RINGS)
    with open_log(path) as reader:
        cloud = next(reader.records({"/points"})).message
    assert isinstance(cloud, PointCloud)
    assert len(cloud.points_m) == len(cloud.time_offsets_s) == POINTS - RINGS
    assert np.allclose(cloud.time_offsets_s, TRUE_S[RINGS:])


def test_a_cloud_whose_sweep_is_longer_than_the_time_to_the_next_has_no_times_for_the_stages() -> None:
    times = SweepTimes()
    points = np.ones((POINTS, 3), np.float32)
    got = []
    for k in range(CLOUDS):
        cloud = PointCloud(FIRST_NS + k * PERIOD_NS, "top", points, (3.0 * TRUE_S).astype(np.float32))
        got.append(len(times.checked("points", cloud).time_offsets_s))
    assert got[10:] == [0] * (CLOUDS - 10)
    assert times.warnings == [
        "points scanner: by the times of its points a sweep lasts 0.297 s, longer than the time to the next; not used"
    ]

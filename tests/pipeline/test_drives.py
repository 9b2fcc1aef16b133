"""Which drives logs hold: parts of one recording are one, other times and other places are others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lhdmap.errors import InputError
from lhdmap.logs.source import LogSource
from lhdmap.logs.writer import LogWriter
from lhdmap.messages import FloatArray, LaserScan, Tachometer
from lhdmap.pipeline.drives import LogDrive, drives_of, same_place
from lhdmap.simulation.planar import PlanarScanner, simulate_scans

from tests.update.drives import RATE_HZ, first_way, mine

_SCANNER = PlanarScanner(field_of_view_deg=270.0, max_range_m=30.0)


def scans(way: FloatArray, at_s: float, seed: int = 1) -> list[LaserScan]:
    begun = simulate_scans(mine(branch=False), way, _SCANNER, RATE_HZ, seed)
    first = begun[0].stamp_ns
    return [scan._replace(stamp_ns=scan.stamp_ns - first + round((1_700_000_000.0 + at_s) * 1e9)) for scan in begun]


def write(path: Path, *parts: list[LaserScan]) -> Path:
    with LogWriter(path) as writer:
        for part in parts:
            for scan in part:
                writer.write("/lidar/front/scan", scan)
    return path


@pytest.fixture(scope="module")
def way() -> FloatArray:
    return first_way()[::3]


def test_parts_that_follow_each_other_are_one(tmp_path: Path, way: FloatArray) -> None:
    one, other = write(tmp_path / "1.mcap", scans(way[:50], 0.0)), write(tmp_path / "2.mcap", scans(way[50:], 6.0))
    assert drives_of([other, one], {}) == [LogDrive((one, other))]


def test_drives_of_one_time_are_two(tmp_path: Path, way: FloatArray) -> None:
    logs = [write(tmp_path / f"{k}.mcap", scans(way[:50], 0.0, k)) for k in (1, 2)]
    assert drives_of(logs, {}) == [LogDrive((log,)) for log in logs]


def test_another_place_after_a_pause_is_another_drive(tmp_path: Path, way: FloatArray) -> None:
    one, other = write(tmp_path / "1.mcap", scans(way[:50], 500.0)), write(tmp_path / "2.mcap", scans(way[90:], 0.0))
    assert drives_of([one, other], {}) == [LogDrive((one,)), LogDrive((other,))]  # in the order they were named


def test_the_same_place_after_a_pause_is_the_same_drive(tmp_path: Path, way: FloatArray) -> None:
    one, other = write(tmp_path / "1.mcap", scans(way[:50], 0.0)), write(tmp_path / "2.mcap", scans(way[50:], 90.0))
    assert drives_of([one, other], {}) == [LogDrive((one, other))]


def test_a_log_is_parted_where_the_machine_was_moved(tmp_path: Path, way: FloatArray) -> None:
    log = write(tmp_path / "1.mcap", scans(way[:50], 0.0), scans(way[90:], 60.0))
    first, second = drives_of([log], {})
    assert first.logs == second.logs == (log,)
    assert first.window_ns is not None
    assert second.window_ns is not None
    assert first.window_ns[1] < second.window_ns[0]
    counts = []
    for drive in (first, second):
        with LogSource(list(drive.logs), window_ns=drive.window_ns) as source:
            counts.append(sum(1 for _ in source.messages(["front"])))
            assert source.duration_s < 30.0
    assert counts == [50, len(way) - 90]


def test_a_log_with_a_pause_at_one_place_is_whole(tmp_path: Path, way: FloatArray) -> None:
    log = write(tmp_path / "1.mcap", scans(way[:50], 0.0), scans(way[50:], 60.0))
    assert drives_of([log], {}) == [LogDrive((log,))]


def test_sensors_in_a_file_of_their_own_are_of_the_drive_of_their_time(tmp_path: Path, way: FloatArray) -> None:
    fronts = [write(tmp_path / "1.mcap", scans(way[:50], 0.0)), write(tmp_path / "2.mcap", scans(way[90:], 900.0))]
    wheels = tmp_path / "wheels.mcap"
    with LogWriter(wheels) as writer:
        for k in range(40):
            writer.write("/machine/tachometer", Tachometer(round((1_700_000_900.0 + 0.1 * k) * 1e9), 1.0))
    first, second = drives_of([*fronts, wheels], {})
    assert first == LogDrive((fronts[0],))
    assert set(second.logs) == {fronts[1], wheels}


def test_a_log_that_is_none_is_told(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"x\.mcap"):
        drives_of([tmp_path / "x.mcap"], {})


def test_places_by_one_scan_each(way: FloatArray) -> None:
    seen = scans(way[[10, 10, 11, 60]], 0.0)
    assert same_place(seen[0], seen[1])
    assert same_place(seen[0], seen[2])  # half a metre on
    assert not same_place(seen[0], seen[3])
    empty = seen[3]._replace(ranges_m=np.full(len(seen[3].ranges_m), np.inf, np.float32))
    assert same_place(seen[0], empty)  # nothing tells

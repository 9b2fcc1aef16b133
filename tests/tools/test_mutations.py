"""Logs with random damage: no error but InputError, in little time (the long run is `python -m tools.fuzz_logs`)."""

from __future__ import annotations

import random
import time
from pathlib import Path

import pytest
from lhdmap.logs import open_log
from mcap.writer import CompressionType
from tools.fuzz_logs import SEEDS, mutated, read_all

from tests.logs.small_logs import write_mcap

COUNT = 300


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", sorted(SEEDS))
def test_mutated_logs(tmp_path: Path, name: str) -> None:
    path = SEEDS[name](tmp_path, 20)
    data, whole = path.read_bytes(), read_all(path)
    assert whole > 20
    target = path.with_name("mutated" + path.suffix)
    delivered = 0
    for number in range(COUNT):
        target.write_bytes(mutated(data, random.Random(number)))
        begin = time.monotonic()
        got = read_all(target)
        assert time.monotonic() - begin < 5.0, number
        delivered += max(got, 0)
    assert delivered > 0.2 * whole * COUNT  # damage costs what it hits, not the whole log


@pytest.mark.parametrize("chunked", [True, False])
def test_damage_in_the_middle_costs_little(tmp_path: Path, chunked: bool) -> None:
    compression = CompressionType.ZSTD if chunked else CompressionType.NONE
    path = write_mcap(tmp_path / "log.mcap", 200, compression, chunked=chunked)
    data = bytearray(path.read_bytes())
    with open_log(path) as reader:
        whole = sum(1 for _ in reader.records())
    middle = len(data) // 2
    data[middle : middle + 30] = b"\xff" * 30
    path.write_bytes(data)
    with open_log(path) as reader:
        got = sum(1 for _ in reader.records())
        assert reader.damage
    assert 0.9 * whole < got < whole


def test_a_record_of_absurd_length_allocates_nothing(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "log.mcap", 20, CompressionType.NONE)
    data = bytearray(path.read_bytes())
    chunk = data.find(b"\x06", 8 + 9)  # after magic and the head of the header record
    data[chunk + 1 : chunk + 9] = b"\xff" * 7 + b"\x7f"
    path.write_bytes(data)
    with open_log(path) as reader:
        assert sum(1 for _ in reader.records()) >= 0
        assert any("claims" in line or "no valid record" in line or "impossible" in line for line in reader.damage)

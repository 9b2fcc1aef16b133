"""Logs that are compressed as a whole: read like the file in them, and nothing is left behind."""

from __future__ import annotations

import bz2
import gzip
import hashlib
import lzma
import os
import tempfile
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from lhdmap.errors import InputError
from lhdmap.logs import LogSource, open_log
from lhdmap.logs.doctor.health import LogVerdict, examine
from mcap.writer import CompressionType

from tests.logs.small_logs import write_bag, write_db3, write_mcap

PACKERS: dict[str, Callable[[bytes], bytes]] = {
    ".zst": zstandard.compress,
    ".zstd": lambda data: zstandard.compress(data[:5000]) + zstandard.compress(data[5000:]),  # two frames
    ".gz": gzip.compress,
    ".bz2": bz2.compress,
    ".xz": lzma.compress,
    ".lz4": lz4.frame.compress,
}


@pytest.fixture(autouse=True)
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that files are unpacked into."""
    folder = tmp_path / "room"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def _written(folder: Path, suffix: str) -> Path:
    if suffix == ".mcap":
        return write_mcap(folder / "log.mcap", 40, CompressionType.ZSTD)
    return write_bag(folder / "log.bag", 40, None) if suffix == ".bag" else write_db3(folder / "bag", 40)


def _stamps(path: Path) -> list[tuple[str, int]]:
    with open_log(path) as reader:
        return [(record.topic, record.message.stamp_ns) for record in reader.records()]


@pytest.mark.parametrize("suffix", [".mcap", ".bag", ".db3"])
@pytest.mark.parametrize("packer", PACKERS)
def test_a_packed_log(tmp_path: Path, room: Path, suffix: str, packer: str) -> None:
    whole = _written(tmp_path, suffix)
    packed = tmp_path / f"packed{suffix}{packer}"
    packed.write_bytes(PACKERS[packer](whole.read_bytes()))
    assert _stamps(packed) == _stamps(whole)
    assert examine(packed).findings[1:] == examine(whole).findings[1:]
    assert list(room.iterdir()) == []
    with LogSource(packed) as source:
        (inventory,) = source.inventory()
    assert inventory.size_bytes == packed.stat().st_size
    assert inventory.sha256 == hashlib.sha256(packed.read_bytes()).hexdigest()
    assert "compressed" in inventory.format


def test_a_file_that_is_open_twice_is_unpacked_once(tmp_path: Path, room: Path) -> None:
    packed = tmp_path / "log.mcap.zst"
    packed.write_bytes(zstandard.compress(_written(tmp_path, ".mcap").read_bytes()))
    with LogSource(packed) as first:
        with LogSource(packed) as second:
            assert len(list(room.iterdir())) == 1
            count = sum(1 for _ in second.messages())
        assert sum(1 for _ in first.messages()) == count > 0
    assert list(room.iterdir()) == []


@pytest.mark.parametrize("packer", PACKERS)
def test_a_packed_log_that_is_cut_gives_what_comes_before(tmp_path: Path, room: Path, packer: str) -> None:
    whole = write_mcap(tmp_path / "log.mcap", 400, CompressionType.NONE)
    packed = tmp_path / f"cut.mcap{packer}"
    data = PACKERS[packer](whole.read_bytes())
    packed.write_bytes(data[: len(data) // 2])
    if packer == ".bz2":  # which packs so short a log as one block
        with pytest.raises(InputError, match="or cut off"):
            _stamps(packed)
    else:
        got = _stamps(packed)
        assert got == _stamps(whole)[: len(got)]
        assert len(got) > 50
        assert examine(packed).verdict is LogVerdict.REMARKS
    assert list(room.iterdir()) == []


@pytest.mark.parametrize(
    "content", [b"", b"neither", gzip.compress(b"some text\n", mtime=0), gzip.compress(b"", mtime=0)]
)
def test_what_is_no_packed_log(tmp_path: Path, room: Path, content: bytes) -> None:
    path = tmp_path / "log.mcap.gz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"log\.mcap\.gz") as caught, open_log(path):
        pass
    assert str(room) not in str(caught.value)
    assert list(room.iterdir()) == []


def test_without_room_the_command_that_unpacks_is_told(tmp_path: Path, room: Path) -> None:
    packed = tmp_path / "log.mcap.zst"
    packed.write_bytes(zstandard.compress(_written(tmp_path, ".mcap").read_bytes()))
    real = Path.open

    def full(self: Path, *words: object, **more: object) -> object:
        if self.is_relative_to(room) and "w" in str(words):
            raise OSError(28, "No space left on device")
        return real(self, *words, **more)  # type: ignore[call-overload]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "open", full)
        with pytest.raises(InputError, match=r"No space left.*zstd -d log\.mcap\.zst"), open_log(packed):
            pass
    assert list(room.iterdir()) == []


def test_unpacking_takes_little_memory(tmp_path: Path) -> None:
    """A log of 200 MB, most of it one attachment of zeros, packed to a few kilobytes."""
    whole = _written(tmp_path, ".mcap").read_bytes()
    packer = zstandard.ZstdCompressor().compressobj()
    packed = tmp_path / "log.mcap.zst"
    with packed.open("wb") as file:
        file.write(packer.compress(whole))
        for _ in range(200):
            file.write(packer.compress(bytes(1 << 20)))
        file.write(packer.flush())
    tracemalloc.start()
    try:
        with open_log(packed) as reader:
            assert reader.topics()
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 32 << 20


@pytest.mark.skipif(os.name != "posix", reason="names are bytes on POSIX alone")
def test_a_packed_log_whose_name_is_no_utf8(tmp_path: Path, room: Path) -> None:
    packed = Path(os.fsdecode(os.fsencode(tmp_path) + b"/M\xfcller.db3.zst"))
    whole = _written(tmp_path, ".db3")
    packed.write_bytes(zstandard.compress(whole.read_bytes()))
    other = packed.with_name(os.fsdecode(b"M\xfcller.db3"))
    other.write_bytes(whole.read_bytes())
    assert _stamps(packed) == _stamps(other) == _stamps(whole)
    assert list(room.iterdir()) == []

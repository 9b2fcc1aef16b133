"""Log files that are compressed as a whole (`.mcap.zstd`, `.db3.zst`, `.bag.gz`): unpacked into a temporary file, then read.

The temporary file goes with the last reader that has it open; TMPDIR moves it.
"""

from __future__ import annotations

import bz2
import gzip
import lzma
import tempfile
import zlib
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import IO, Any

import lz4.frame
import zstandard

from lhdmap.errors import InputError
from lhdmap.logs.bag.log import BagFile
from lhdmap.logs.compression import ZSTD_MAGIC
from lhdmap.logs.container import Container, Contents, OpenContainer
from lhdmap.logs.findings import Findings
from lhdmap.logs.mcap.log import McapFile
from lhdmap.logs.sqlite.log import MAGIC as SQLITE_MAGIC
from lhdmap.logs.sqlite.log import SqliteFile

SUFFIXES = (".zstd", ".zst", ".gz", ".bz2", ".xz", ".lz4")
_CONTAINERS: dict[bytes, OpenContainer] = {b"\x89MCAP": McapFile, b"#ROSBAG": BagFile, SQLITE_MAGIC: SqliteFile}
# First bytes -> what reads the stream, and the command that unpacks it.
_STREAMS: dict[bytes, tuple[Callable[[IO[bytes]], Any], str]] = {
    ZSTD_MAGIC: (lambda file: zstandard.ZstdDecompressor().stream_reader(file, read_across_frames=True), "zstd -d"),
    b"\x1f\x8b": (lambda file: gzip.GzipFile(fileobj=file), "gunzip -k"),
    b"BZh": (bz2.BZ2File, "bunzip2 -k"),
    b"\xfd7zXZ\0": (lzma.LZMAFile, "unxz -k"),
    b"\x04\x22\x4d\x18": (lz4.frame.LZ4FrameFile, "lz4 -d"),
}
_BROKEN = (zstandard.ZstdError, lzma.LZMAError, zlib.error, EOFError, RuntimeError, ValueError)
_STEP = 1 << 16


class PackedFile:
    """An open log that is compressed as a whole (a `Container`)."""

    def __init__(self, path: Path, damage: Findings) -> None:
        self._unpacked = _Unpacked.of(path)
        try:
            self._inner = _opened(path, self._unpacked.path, damage)
        except BaseException:
            self._unpacked.release()
            raise
        if self._unpacked.problem:
            damage.add(self._unpacked.problem)
        self.format, self.remarks = f"{self._inner.format}, compressed", self._inner.remarks

    def contents(self) -> Contents:
        """Return channels, counts and log times."""
        return self._inner.contents()

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time, channel id and bytes in log-time order."""
        return self._inner.messages(wanted)

    def close(self) -> None:
        """Close the file and remove what was unpacked."""
        self._inner.close()
        self._unpacked.release()


class _Unpacked:
    """A file unpacked into a temporary one, which all readers of the process share."""

    _all: dict[tuple[Path, int, int], _Unpacked] = {}  # noqa: RUF012  # a log is opened twice, and unpacking takes long

    def __init__(self, key: tuple[Path, int, int], path: Path) -> None:
        self._key, self._readers, self.problem = key, 0, ""
        self._folder = tempfile.TemporaryDirectory(prefix="lhdmap-")
        self.path = Path(self._folder.name) / "unpacked"
        try:
            self._unpack(path)
        except BaseException:
            self._folder.cleanup()
            raise

    @classmethod
    def of(cls, path: Path) -> _Unpacked:
        """Return the unpacked file, once more with a reader that will release it."""
        state = path.stat()
        key = (path.resolve(), state.st_mtime_ns, state.st_size)
        found = cls._all.get(key) or cls(key, path)
        found.take()
        return found

    def take(self) -> None:
        """Say that one more reader uses it."""
        self._readers += 1
        self._all[self._key] = self

    def release(self) -> None:
        """Say that a reader is done with it."""
        self._readers -= 1
        if not self._readers:
            self._all.pop(self._key, None)
            self._folder.cleanup()

    def _unpack(self, path: Path) -> None:
        with path.open("rb") as file:
            stream, command = _stream(file)
            try:
                with self.path.open("wb") as target:
                    self.problem = _copied(stream, target)
            except OSError as error:
                raise InputError(
                    f"{path}: cannot be unpacked into {self.path.parent} ({error.strerror or error}); unpack it "
                    f"({command} {path.name}) and give that file, or set TMPDIR to a folder with room"
                ) from error


def _stream(file: IO[bytes]) -> tuple[Any, str]:
    """Return what reads the content of a file, and the command that unpacks it; a file that is not packed as it is."""
    start = file.read(8)
    file.seek(0)
    for magic, (kind, command) in _STREAMS.items():
        if start.startswith(magic):
            return kind(file), command
    return file, "cp"


def _copied(stream: Any, target: IO[bytes]) -> str:
    """Copy all that can be had; return what is wrong with the stream, if anything."""
    try:
        while part := stream.read1(_STEP):  # what comes before a break is given, `read` would keep it
            target.write(part)
    except _BROKEN as error:
        return f"the compressed file is damaged or cut off ({error}): what comes before that is used"
    except OSError as error:
        if error.errno is None:  # gzip and bz2 say so of what they cannot read
            return f"the compressed file is damaged ({error}): what comes before that is used"
        raise
    return ""


def _opened(path: Path, unpacked: Path, damage: Findings) -> Container:
    with unpacked.open("rb") as file:
        start = file.read(16)
    for magic, container in _CONTAINERS.items():
        if start.startswith(magic):
            try:
                return container(unpacked, damage)
            except InputError as error:
                raise InputError(str(error).replace(str(unpacked), str(path))) from error
    raise InputError(
        f"{path}: what is packed in it is no MCAP file, ROS 1 bag or .db3; is it another format, or cut off?"
    )

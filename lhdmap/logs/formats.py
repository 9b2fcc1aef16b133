"""`open_log`: the reader for a path, chosen by suffix from a map, by the first bytes where the suffix says nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lhdmap.descriptions import described, kind_of
from lhdmap.errors import InputError
from lhdmap.logs.bag.folder import BagFolder
from lhdmap.logs.bag.log import BagFile
from lhdmap.logs.base import LogReader
from lhdmap.logs.compression import ZSTD_MAGIC
from lhdmap.logs.decoded import DecodedLog
from lhdmap.logs.mcap.log import McapFile
from lhdmap.logs.packed import SUFFIXES as PACKED
from lhdmap.logs.packed import PackedFile
from lhdmap.logs.sqlite.log import MAGIC as SQLITE_MAGIC
from lhdmap.logs.sqlite.log import SqliteFile
from lhdmap.logs.text.breezy import BreezyLog
from lhdmap.logs.text.carmen import CarmenLog

Opener = Callable[[Path], LogReader]


def _mcap(path: Path) -> LogReader:
    return DecodedLog(path, McapFile)


def _bag(path: Path) -> LogReader:
    return DecodedLog(path, BagFile)


def _sqlite(path: Path) -> LogReader:
    return DecodedLog(path, SqliteFile)


def _packed(path: Path) -> LogReader:
    return DecodedLog(path, PackedFile)


def _folder(path: Path) -> LogReader:
    return DecodedLog(path, BagFolder)


_BY_SUFFIX: dict[str, Opener] = {
    ".mcap": _mcap,
    ".bag": _bag,
    ".db3": _sqlite,
    ".clf": CarmenLog,
    ".log": CarmenLog,
    ".dat": BreezyLog,
}
_BY_START: dict[bytes, Opener] = {b"\x89MCAP": _mcap, b"#ROSBAG": _bag, SQLITE_MAGIC: _sqlite, ZSTD_MAGIC: _packed}
_TEXTS = (CarmenLog, BreezyLog)  # which unpack .gz and .bz2 line by line
# What people pass by mistake, and what it is.
_NOT_LOGS = {
    **dict.fromkeys((".ply", ".pcd", ".laz", ".las", ".xyz", ".e57"), "a point cloud"),
    **dict.fromkeys((".dae", ".obj", ".stl", ".glb"), "a mesh"),
    **dict.fromkeys((".tum", ".csv", ".txt", ".g2o", ".relations"), "a table"),
    ".rawlog": "an MRPT rawlog (convert it to MCAP or a ROS bag first)",
    ".rrd": "a Rerun recording",
    ".yaml": "a description of a log (give its folder instead)",
}
WANTED = (
    "MCAP, ROS 1 bag, ROS 2 bag folder or .db3 (also .zst, .gz, ...), CARMEN .clf/.log (also .gz, .bz2) or "
    "BreezySLAM .dat was wanted"
)


def open_log(path: Path | str) -> LogReader:
    """Return the reader for a log file or a ROS 2 bag folder; nothing is read before it is entered.

    Raises:
        InputError: there is no such file, it is empty, or its format is unknown.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    if path.is_dir() and (kind := kind_of(path)) is not None:
        raise InputError(
            f"{path}: is a {kind} folder of lhdmap and no log: lhdmap info tells what is in it{_its_log(path)}"
        )
    if path.is_file() and not path.stat().st_size:
        raise InputError(f"{path}: the file is empty; {WANTED}")
    return _opener(path)(path)


def _its_log(folder: Path) -> str:
    """Return, as the end of a sentence, which log a folder of lhdmap holds or was made from."""
    found = described(folder) or {}
    logs = [str(folder / found["log"])] if "log" in found else [one["path"] for one in found.get("sources", [])]
    return f"; its log: {', '.join(logs)}" if logs else ""


def _opener(path: Path) -> Opener:
    if path.is_dir():
        return _folder
    suffixes = [suffix.lower() for suffix in path.suffixes]
    packed = suffixes.pop() if suffixes and suffixes[-1] in PACKED else ""
    suffix = suffixes[-1] if suffixes else ""
    found = _BY_SUFFIX.get(suffix) or _by_start(path)
    if packed and suffix not in _NOT_LOGS and not (found in _TEXTS and packed in (".gz", ".bz2")):
        return _packed
    if found is None:
        raise InputError(f"{path}: {_NOT_LOGS.get(suffix, 'an unknown format')} is no log that can be read; {WANTED}")
    return found


def _by_start(path: Path) -> Opener | None:
    with path.open("rb") as file:
        start = file.read(16)
    return next((opener for magic, opener in _BY_START.items() if start.startswith(magic)), None)

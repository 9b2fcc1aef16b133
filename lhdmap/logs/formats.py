"""`open_log`: the reader for a path, chosen by suffix from a map, by the first bytes where the suffix is unknown."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lhdmap.errors import InputError
from lhdmap.logs.bag_log import BagFile
from lhdmap.logs.base import LogReader
from lhdmap.logs.decoded import DecodedLog
from lhdmap.logs.mcap_log import McapFile

Opener = Callable[[Path], LogReader]


def _mcap(path: Path) -> LogReader:
    return DecodedLog(path, McapFile)


def _bag(path: Path) -> LogReader:
    return DecodedLog(path, BagFile)


_BY_SUFFIX: dict[str, Opener] = {".mcap": _mcap, ".bag": _bag}
_BY_START: dict[bytes, Opener] = {b"\x89MCAP": _mcap}


def open_log(path: Path | str) -> LogReader:
    """Return the reader for a log file or a ROS 2 bag folder; nothing is read before it is entered.

    Raises:
        InputError: there is no such file, it is empty, or its format is unknown.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    if path.is_file() and not path.stat().st_size:
        raise InputError(f"{path}: the file is empty")
    opener = _BY_SUFFIX.get(path.suffix.lower())
    if opener is None:
        raise InputError(f"{path}: unknown format")
    return opener(path)

"""SOURCE of `lhdmap live`: an address to a source."""

from __future__ import annotations

import importlib
import os
import re
from pathlib import Path
from typing import Any

from lhdmap.errors import UsageError
from lhdmap.extras import library
from lhdmap.live.source import LiveSource

FORMS = "mcap:FILE (or a path), foxglove:ws://HOST:8765, zenoh:tcp/HOST:7447 or dds:DOMAIN"


def source_of(address: str, quiet_s: float | None = None) -> LiveSource:
    """Return the source of an address; `quiet_s`: after how long a file that does not grow has ended.

    Raises:
        UsageError: it is no address, or the package that it needs is not installed.
    """
    scheme, _, rest = address.partition(":")
    match scheme:
        case "foxglove":
            return _made("foxglove", "Foxglove", "websockets", rest)
        case "ws" | "wss":
            return _made("foxglove", "Foxglove", "websockets", address)
        case "zenoh":
            return _made("over_zenoh", "OverZenoh", "zenoh", _endpoint(address, rest), _domain())
        case "dds":
            if not re.fullmatch(r"\d{1,3}", rest or "0"):
                raise UsageError(f"{address}: a domain number was wanted, e.g. dds:0")
            return _made("over_dds", "OverDds", "cyclonedds", int(rest) if rest else _domain())
    path = Path(rest if scheme == "mcap" else address)
    if "://" in address or (not rest and scheme == "mcap"):
        raise UsageError(f"{address}: a source was wanted: {FORMS}")
    if path.is_dir():
        raise UsageError(f"{path}: is a folder; the MCAP file in it that grows was wanted")
    if not path.parent.is_dir():  # a file may come yet, its folder is a typing error
        raise UsageError(f"{path}: there is no folder {path.parent}")
    from lhdmap.live.mcap_follow import QUIET_S, McapFollow

    return McapFollow(path, QUIET_S if quiet_s is None else quiet_s)


def _endpoint(address: str, rest: str) -> str:
    if not re.fullmatch(r"(tcp|tls|udp|quic|ws)/.+:\d+", rest):
        raise UsageError(f"{address}: zenoh:tcp/HOST:7447 was wanted, the address of a zenoh router")
    return rest


def _domain() -> int:
    """Return the domain that ROS 2 would take."""
    text = os.environ.get("ROS_DOMAIN_ID", "0")
    if not text.isdigit():
        raise UsageError(f"ROS_DOMAIN_ID={text}: a number was wanted")
    return int(text)


def _made(module: str, name: str, package: str, *arguments: Any) -> LiveSource:
    library(package)
    made: LiveSource = getattr(importlib.import_module(f"lhdmap.live.{module}"), name)(*arguments)
    return made

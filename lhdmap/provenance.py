"""Where data came from: SHA-256 of files, and what `map.json` records of a source."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from lhdmap.errors import InputError


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def file_entry(path: Path) -> dict[str, Any]:
    """Return SHA-256 and size of a file."""
    return {"sha256": sha256_of(path), "bytes": path.stat().st_size}


def source_entry(path: Path) -> dict[str, Any]:
    """Return what `map.json` records of a source: its path as given, size and SHA-256; of a bag folder, each file's.

    Raises:
        InputError: the source cannot be read.
    """
    try:
        if path.is_dir():
            files = {item.name: file_entry(item) for item in sorted(path.iterdir()) if item.is_file()}
            return {"path": str(path), "files": files}
        return {"path": str(path), **file_entry(path)}
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error

"""Files and folders on an object store, by fsspec."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lhdmap.descriptions import DESCRIPTIONS, is_own
from lhdmap.errors import InputError, UsageError
from lhdmap.extras import install_line, is_installed, library

_STAMPS = ("ETag", "etag", "mtime", "LastModified", "last_modified", "created")
_PACKAGES = "s3fs for s3://, adlfs for az:// and abfs://, gcsfs for gs://"


def is_url(text: str) -> bool:
    """Return whether a cell or an option names something on a store: `s3://bucket/drive.mcap`."""
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]+://", text) is not None


def check_store(url: str) -> None:
    """Raise UsageError where fsspec, or what it needs for this kind of store, is not installed."""
    if not is_installed("fsspec"):
        raise UsageError(f"{url} needs fsspec: {install_line('fsspec')}")
    try:
        library("fsspec").core.url_to_fs(url)
    except (ImportError, ValueError) as error:
        raise UsageError(f"{url}: {error}; pip install what fsspec needs for it: {_PACKAGES}") from error


@dataclass(frozen=True, slots=True)
class Store:
    """A folder on a store, as a URL."""

    url: str

    def at(self, name: str) -> str:
        """Return the URL of something in it."""
        return f"{self.url.rstrip('/')}/{name}"

    def described(self, name: str) -> Mapping[str, Any] | None:
        """Return the description of a complete result, None where there is none."""
        for file in DESCRIPTIONS:
            with (
                contextlib.suppress(OSError, ValueError),
                library("fsspec").open(self.at(f"{name}/{file}"), "rb") as opened,
            ):
                found = json.load(opened)
                return found if is_own(found) else None
        return None

    def send(self, folder: Path, names: Sequence[str]) -> None:
        """Copy files and folders of a folder there, in that order; raise InputError where that fails."""
        files, root = files_at(self.url)
        with told_of(self.url):
            for name in names:
                for path in _files(folder / name):
                    there = f"{root}/{path.relative_to(folder).as_posix()}"
                    files.makedirs(there.rpartition("/")[0], exist_ok=True)
                    files.put_file(str(path), there)

    def fetch(self, name: str, folder: Path) -> None:
        """Copy the folder of a name from there; nothing where it is not there."""
        files, root = files_at(self.at(name))
        with told_of(self.url):
            there = files.isdir(root)
        if there:
            fetch(self.at(name), folder / name)


def stamp_of(url: str) -> list[str] | None:
    """Return size and time or tag of something on a store: that it is another one now; None where it is not there."""
    try:
        files, path = files_at(url)
        info = files.info(path)
    except Exception:  # noqa: BLE001  # each store has errors of its own; the row itself will tell
        return None
    return [str(info.get("size")), *(str(info[key]) for key in _STAMPS if key in info)]


def fetch(url: str, target: Path) -> None:
    """Copy a file, or a folder with all that is in it."""
    files, root = files_at(url)
    with told_of(url):
        if not files.isdir(root):
            target.parent.mkdir(parents=True, exist_ok=True)
            files.get_file(root, str(target))
            return
        for one in files.find(root):
            path = target / str(one)[len(root.rstrip("/")) + 1 :]
            if ".." in path.parts:
                raise InputError(f"{one}: a name that leads out of its folder")
            path.parent.mkdir(parents=True, exist_ok=True)
            files.get_file(one, str(path))


def files_at(url: str) -> tuple[Any, str]:
    """Return the store of a URL and the path in it; listings that it has kept may be of before another node wrote."""
    files, path = library("fsspec").core.url_to_fs(url.rstrip("/"))
    files.invalidate_cache()
    return files, path


def _files(path: Path) -> Iterator[Path]:
    yield from (one for one in sorted(path.rglob("*")) if one.is_file()) if path.is_dir() else (path,)


@contextlib.contextmanager
def told_of(url: str) -> Iterator[None]:
    """Raise InputError of whatever a store raises: each has errors of its own."""
    try:
        yield
    except Exception as error:
        raise InputError(f"{url}: {type(error).__name__}: {' '.join(str(error).split())}") from error

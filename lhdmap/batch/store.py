"""Logs and results on an object store (fsspec): inputs are fetched, results made on the node's own disk and then sent.

The description (`map.json`, `run.json`) goes last, so that a result is there as a whole or not at all.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lhdmap.batch.work import Outcome, Work
from lhdmap.descriptions import DESCRIPTIONS, is_own
from lhdmap.errors import InputError, LhdmapError, UsageError
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
        files, root = _files_at(self.url)
        with _told_of(self.url):
            for name in names:
                for path in _files(folder / name):
                    there = f"{root}/{path.relative_to(folder).as_posix()}"
                    files.makedirs(there.rpartition("/")[0], exist_ok=True)
                    files.put_file(str(path), there)

    def fetch(self, name: str, folder: Path) -> None:
        """Copy the folder of a name from there; nothing where it is not there."""
        files, root = _files_at(self.at(name))
        with _told_of(self.url):
            there = files.isdir(root)
        if there:
            _fetch(self.at(name), folder / name)


@dataclass(frozen=True, slots=True)
class Staged:
    """Work whose command lines may hold URLs: they become files of this node, and results are sent where they belong."""

    work: Work

    def __call__(self, words: Sequence[str]) -> Outcome:
        """Run one command line; what cannot be fetched or sent is an outcome with the exit code of an input."""
        if not any(is_url(word) for word in words):
            return self.work(words)
        with _scratch(words) as scratch:
            try:
                return self._run(words, scratch)
            except LhdmapError as error:
                told = {"kind": "input", "message": str(error), "exit_code": error.exit_code}
                return Outcome(error.exit_code, {"error": told}, f"lhdmap: {error}\n")

    def _run(self, words: Sequence[str], scratch: Path) -> Outcome:
        at = words.index("-o") + 1 if "-o" in words else None
        here = {
            word: scratch / str(k) / word.rstrip("/").rpartition("/")[2] for k, word in enumerate(words) if is_url(word)
        }
        for k, word in enumerate(words):
            if word in here and k == at:
                here[word].parent.mkdir()
            elif word in here:
                _fetch(word, here[word])
        outcome = self.work([str(here.get(word, word)) for word in words])
        urls = {str(path): url for url, path in here.items()}
        if at is not None and words[at] in here and here[words[at]].is_dir():
            _send_result(here[words[at]], words[at], urls)
        said = _renamed(outcome.said, urls)
        return outcome._replace(values=_renamed(outcome.values, urls), said=said)


def stamp_of(url: str) -> list[str] | None:
    """Return size and time or tag of something on a store: that it is another one now; None where it is not there."""
    try:
        files, path = _files_at(url)
        info = files.info(path)
    except Exception:  # noqa: BLE001  # each store has errors of its own; the row itself will tell
        return None
    return [str(info.get("size")), *(str(info[key]) for key in _STAMPS if key in info)]


def _fetch(url: str, target: Path) -> None:
    """Copy a file, or a folder with all that is in it."""
    files, root = _files_at(url)
    with _told_of(url):
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


def _send_result(folder: Path, url: str, urls: Mapping[str, str]) -> None:
    """Replace what stands at the URL: its description goes first, that of the new one comes last."""
    names = {path.name for path in folder.iterdir()}
    last = sorted(names & set(DESCRIPTIONS))
    if not last:
        return  # not complete
    for name in last:
        described = folder / name
        described.write_text(_renamed(described.read_text(encoding="utf-8"), urls), encoding="utf-8")
    files, path = _files_at(url)
    with _told_of(url):
        for name in DESCRIPTIONS:
            if files.exists(f"{path}/{name}"):
                files.rm_file(f"{path}/{name}")
        if files.exists(path):
            files.rm(path, recursive=True)
    Store(url).send(folder, [*sorted(names - set(last)), *last])


def _files_at(url: str) -> tuple[Any, str]:
    """Return the store of a URL and the path in it; listings that it has kept may be of before another node wrote."""
    files, path = library("fsspec").core.url_to_fs(url.rstrip("/"))
    files.invalidate_cache()
    return files, path


def _files(path: Path) -> Iterator[Path]:
    yield from (one for one in sorted(path.rglob("*")) if one.is_file()) if path.is_dir() else (path,)


def _renamed(value: Any, urls: Mapping[str, str]) -> Any:
    """Return a value with the paths of this node's files as the URLs that they stand for."""
    if isinstance(value, str):
        for path, url in urls.items():
            value = value.replace(path, url)
        return value
    if isinstance(value, Mapping):
        return {key: _renamed(one, urls) for key, one in value.items()}
    return [_renamed(one, urls) for one in value] if isinstance(value, (list, tuple)) else value


@contextlib.contextmanager
def _told_of(url: str) -> Iterator[None]:
    """Raise InputError of whatever a store raises: each has errors of its own."""
    try:
        yield
    except Exception as error:
        raise InputError(f"{url}: {type(error).__name__}: {' '.join(str(error).split())}") from error


@contextlib.contextmanager
def _scratch(words: Sequence[str]) -> Iterator[Path]:
    """Give an empty folder on this node's disk; what a killed try of the same row has left there is removed."""
    mark = f"lhdmap-{hashlib.sha256(repr(list(words)).encode()).hexdigest()[:12]}-"
    root = Path(tempfile.gettempdir())
    for left in root.glob(f"{mark}*"):
        if not _is_alive(int(left.name.rpartition("-")[2])):
            shutil.rmtree(left, ignore_errors=True)
    folder = root / f"{mark}{os.getpid()}"
    folder.mkdir(mode=0o700)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return process != os.getpid()

"""A row between stores: inputs are fetched, the result is made on the node's own disk and then sent.

The description (`map.json`, `run.json`) goes last, so that a result is there as a whole or not at all.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lhdmap.batch.store import Store, fetch, files_at, is_url, told_of
from lhdmap.batch.work import JobOutcome, Work
from lhdmap.descriptions import DESCRIPTIONS
from lhdmap.errors import LhdmapError


@dataclass(frozen=True, slots=True)
class Staged:
    """Work whose command lines may hold URLs: they become files of this node, and results are sent where they belong."""

    work: Work

    def __call__(self, words: Sequence[str]) -> JobOutcome:
        """Run one command line; what cannot be fetched or sent is an outcome with the exit code of an input."""
        if not any(is_url(word) for word in words):
            return self.work(words)
        with _scratch(words) as scratch:
            try:
                return self._run(words, scratch)
            except LhdmapError as error:
                told = {"kind": "input", "message": str(error), "exit_code": error.exit_code}
                return JobOutcome(error.exit_code, {"error": told}, f"lhdmap: {error}\n")

    def _run(self, words: Sequence[str], scratch: Path) -> JobOutcome:
        at = words.index("-o") + 1 if "-o" in words else None
        here = {
            word: scratch / str(k) / word.rstrip("/").rpartition("/")[2] for k, word in enumerate(words) if is_url(word)
        }
        for k, word in enumerate(words):
            if word in here and k == at:
                here[word].parent.mkdir()
            elif word in here:
                fetch(word, here[word])
        outcome = self.work([str(here.get(word, word)) for word in words])
        urls = {str(path): url for url, path in here.items()}
        if at is not None and words[at] in here and here[words[at]].is_dir():
            _send_result(here[words[at]], words[at], urls)
        said = _renamed(outcome.said, urls)
        return outcome._replace(values=_renamed(outcome.values, urls), said=said)


def _send_result(folder: Path, url: str, urls: Mapping[str, str]) -> None:
    """Replace what stands at the URL: its description goes first, that of the new one comes last."""
    names = {path.name for path in folder.iterdir()}
    last = sorted(names & set(DESCRIPTIONS))
    if not last:
        return  # not complete
    for name in last:
        described = folder / name
        described.write_text(_renamed(described.read_text(encoding="utf-8"), urls), encoding="utf-8")
    files, path = files_at(url)
    with told_of(url):
        for name in DESCRIPTIONS:
            if files.exists(f"{path}/{name}"):
                files.rm_file(f"{path}/{name}")
        if files.exists(path):
            files.rm(path, recursive=True)
    Store(url).send(folder, [*sorted(names - set(last)), *last])


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

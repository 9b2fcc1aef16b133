"""The folder of a run, of any kind: written under a partial name, renamed when complete, over another one only with `force`.

`RunFolderWriter` is a context manager. Each `write_…` leaves a whole file; `complete` hashes all files, writes the
description (`run.json`, that of a map is `map.json`) and renames the folder. Left without `complete` (an error, Ctrl-C), the
folder keeps its partial name, and what was finished stays in it; without anything finished it is removed.
`RunFolder.open` reads any of them back.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from lhdmap.descriptions import DESCRIPTIONS, SOFTWARE, described, description_name, is_own, kind_in, looks_like_log
from lhdmap.errors import InputError
from lhdmap.json_files import read_json, write_json
from lhdmap.outputs import PARTIAL_SUFFIX, OutputFolder
from lhdmap.provenance import file_entry, sha256_of, source_entry

FORMAT_VERSION = 1
Columns = Mapping[str, npt.NDArray[Any] | Sequence[str]]


@dataclass(frozen=True, slots=True)
class RunInfo:
    """What a description says besides kind, versions and the hashes of the folder's files.

    `options` are the settings and what else was asked for, `counts` the figures of the run; `more` are entries of one kind
    of run alone, such as the `map` within a demo.
    """

    sources: Sequence[Path] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    counts: Mapping[str, Any] = field(default_factory=dict)
    warnings: Sequence[str] = ()
    frames: Mapping[str, str] = field(default_factory=dict)
    more: Mapping[str, Any] = field(default_factory=dict)


class RunFolderWriter:
    """Writes the folder of one run; `path` is where it grows, `target` where it ends."""

    def __init__(
        self, kind: str, target: Path, *, force: bool = False, inputs: Sequence[Path] = (), resumed: bool = False
    ) -> None:
        """Make the partial folder for `target`; `inputs` are what the run reads, and never replaced.

        `resumed`: what an interrupted run has left in the partial folder is gone on with.

        Raises:
            UsageError: the target is no name of a folder to make, or is there already, and must not be replaced.
            InputError: the folder cannot be made.
        """
        self._folder = OutputFolder(target, force=force, inputs=inputs, resumed=resumed)
        self.kind, self.target, self.path = kind, target, self._folder.path

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Keep the partial folder as it is, if something in it was finished."""
        self._folder.__exit__(kind, error, trace)

    def finished(self, path: Path) -> Path:
        """Note that a file of the folder is whole, and return its path: it is kept if the run ends before its time."""
        self._folder.finished.append(path.name)
        return path

    def write_json(self, name: str, values: Mapping[str, Any]) -> Path:
        """Write a JSON file; what is not finite becomes null."""
        return self.finished(write_json(self.path / name, values))

    def write_table(self, name: str, columns: Columns) -> Path:
        """Write a Parquet file of columns: arrays (N,), or N texts."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        arrays = {
            key: column if isinstance(column, np.ndarray) else pa.array(list(column), pa.string())
            for key, column in columns.items()
        }
        path = self.path / name
        with path.open("wb") as file:
            pq.write_table(pa.table(arrays), file, compression="zstd")
        return self.finished(path)

    def complete(self, info: RunInfo, source_hashes: Mapping[Path, Any] | None = None) -> Path:
        """Write the description, rename the folder and return its final path.

        `source_hashes` are those of `source_entry`, where the caller has them already (they are slow for large logs).

        Raises:
            UsageError: the name was taken meanwhile.
            InputError: a source cannot be read, or the folder cannot be renamed.
        """
        known = source_hashes or {}
        entries = [known[path] if path in known else source_entry(path) for path in info.sources]
        own = self.path / description_name(self.kind)
        files = {_name(path, self.path): file_entry(path) for path in _files(self.path) if path != own}
        write_json(
            own,
            {
                "format_version": FORMAT_VERSION,
                "kind": self.kind,
                "software": SOFTWARE,
                "options": info.options,
                "sources": entries,
                "frames": info.frames,
                "counts": info.counts,
                **info.more,
                "files": files,
                "warnings": list(info.warnings),
            },
        )
        return self._folder.complete()


class RunFolder:
    """A complete folder of a run, opened with `RunFolder.open`; the files are read when they are asked for."""

    def __init__(self, path: Path, kind: str, info: Mapping[str, Any]) -> None:
        self.path, self.kind, self.info = path, kind, info

    @classmethod
    def open(cls, path: Path, kinds: Sequence[str] = ()) -> Self:
        """Open the folder of a run, of one of these kinds where they are given.

        Raises:
            InputError: there is no such folder, it is partial, of a newer format, or of another kind.
        """
        wanted = f"a {' or '.join(kinds)} folder" if kinds else "a map or run folder of lhdmap"
        file = next((path / name for name in DESCRIPTIONS if (path / name).is_file()), None)
        if file is None:
            raise InputError(f"{path}: {_instead(path, wanted, kinds)}")
        info = _description(file, wanted)
        kind = kind_in(path, info)
        if kinds and kind not in kinds:
            raise InputError(
                f"{path}: {wanted} was wanted, this is a {kind} folder; lhdmap info tells what is in it{_inner(path, info)}"
            )
        return cls(path.absolute(), kind, info)

    def file(self, name: str) -> Path:
        """Return the path of one file of the folder.

        Raises:
            InputError: the folder has no such file.
        """
        path = self.path / name
        if not path.is_file():
            raise InputError(f"{self.path}: the {self.kind} folder has no {name}")
        return path

    def json(self, name: str) -> dict[str, Any]:
        """Return the table in one of the folder's JSON files.

        Raises:
            InputError: the file is missing, damaged, or holds no table.
        """
        return read_json(self.file(name), f"the content of {name}", f"make the {self.kind} folder again")

    def table(self, name: str, columns: Sequence[str]) -> dict[str, npt.NDArray[Any]]:
        """Return columns (N,) of one of the folder's Parquet files; texts as arrays of objects.

        Raises:
            InputError: the file is missing, damaged or lacks a column.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        path = self.file(name)
        try:
            with path.open("rb") as file:
                table = pq.read_table(file, columns=list(columns))
            return {column: table.column(column).to_numpy() for column in columns}
        except (pa.ArrowException, OSError, KeyError) as error:
            raise InputError(f"{path}: not readable as {path.stem} ({error})") from error

    @property
    def warnings(self) -> list[str]:
        """What concerned the input but did not stop the run."""
        return [str(text) for text in self.info.get("warnings", [])]

    def changed_files(self, *, by_size: bool = False) -> list[str]:
        """Return the names of files that are missing or differ from the description: by their hashes, or sizes alone."""
        recorded: Mapping[str, Any] = self.info.get("files", {})
        return [name for name, entry in recorded.items() if not _same(self.path / name, entry, by_size=by_size)]


def _same(path: Path, entry: Mapping[str, Any], *, by_size: bool) -> bool:
    if not path.is_file() or path.stat().st_size != entry["bytes"]:
        return False
    return by_size or sha256_of(path) == entry["sha256"]


def _description(file: Path, wanted: str) -> dict[str, Any]:
    advice = f"{wanted} was wanted"
    info = read_json(file, "the description of a map or run", advice)
    version = info.get("format_version", FORMAT_VERSION)
    if not isinstance(version, int):
        raise InputError(f"{file}: not the description of a map or run (format_version = {version!r}); {advice}")
    if version > FORMAT_VERSION:
        raise InputError(
            f"{file.parent}: format version {version}, this software reads up to {FORMAT_VERSION}; update it"
        )
    if not is_own(info):
        raise InputError(f"{file.parent}: {advice}, this {file.name} was not written by lhdmap")
    return info


def _instead(path: Path, wanted: str, kinds: Sequence[str]) -> str:
    """Return what is at a path that is no folder of lhdmap, and what to do with it."""
    if not path.exists():
        return f"no such file or folder; {wanted} was wanted"
    if path.is_dir() and path.name.endswith(PARTIAL_SUFFIX):
        names = ", ".join(sorted(one.name for one in path.iterdir() if not one.name.startswith("."))) or "nothing"
        return f"the run was interrupted before it was complete; run it again (in the folder: {names})"
    if looks_like_log(path):
        return f"is a log; lhdmap doctor tells what is in it, lhdmap build-map makes a map of it ({wanted} was wanted)"
    if path.suffix == ".rrd":
        return f"is a Rerun recording, lhdmap view opens it; {wanted} was wanted"
    if not path.is_dir():
        return f"{wanted} was wanted, this is a file"
    files = list(dict.fromkeys(map(description_name, kinds))) or list(DESCRIPTIONS)
    return f"{wanted} was wanted, it has no {' or '.join(files)}"


def _inner(path: Path, info: Mapping[str, Any]) -> str:
    return f"; the map in it: {path / str(info['map'])}" if "map" in info else ""


def _files(folder: Path) -> Iterator[Path]:
    """Yield the files of a folder; of a run's folder within it the description alone, which has the hashes of the rest."""
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if path.is_file():
            yield path
        elif path.is_dir() and described(path) is not None:
            yield next(path / name for name in DESCRIPTIONS if (path / name).is_file())
        elif path.is_dir():
            yield from _files(path)


def _name(path: Path, folder: Path) -> str:
    return path.relative_to(folder).as_posix()

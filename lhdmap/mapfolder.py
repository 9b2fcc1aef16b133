"""The map folder: written under a partial name, renamed when complete, over another one only with `force`; and its reader.

`MapFolderWriter` is a context manager. Each `write_…` leaves a whole file; `complete` hashes all files, writes
`map.json` and renames the folder. Left without `complete` (an error, Ctrl-C), the folder keeps its partial name, and
what was finished stays in it; without anything finished it is removed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from lhdmap.errors import InputError
from lhdmap.messages import FloatArray
from lhdmap.names import shown
from lhdmap.outputs import PARTIAL_SUFFIX, SOFTWARE, OutputFolder
from lhdmap.provenance import file_entry, sha256_of, source_entry
from lhdmap.trajectory import Trajectory, read_tum, write_tum

FORMAT_VERSION = 1
LOG_SUFFIXES = (".mcap", ".bag", ".db3", ".clf")
FRAMES = {
    "map": "gravity-aligned, z up; position and heading of base_link at the first scan are its origin",
    "base_link": "middle of the front axle on the floor, x forward, y left, z up; the poses of the trajectories",
}


def looks_like_log(path: Path) -> bool:
    """Return whether a path is that of a log, by its name, or by what is in the folder."""
    if path.is_dir():
        return (path / "metadata.yaml").is_file() or any(path.glob("*.mcap")) or any(path.glob("*.db3"))
    return path.name.lower().removesuffix(".gz").removesuffix(".bz2").endswith(LOG_SUFFIXES)


class Diagnostics(NamedTuple):
    """One row for each processed scan, M of them.

    `residual` (the matcher's, m), `inliers` (share or count, as the matcher gives it), `information_along`,
    `information_across` (1/m^2) and `information_heading` (1/rad^2) in the machine's frame, `degenerate` (an axis was
    not observed), `substitute` (what was used instead: `wheels`, `motion`, or empty), `slip` (skid factor of
    the wheels, Eq. (7) of the loading paper; NaN where not known), `wheels` (what became of the wheels' step before the scan,
    and why: `lhdmap.odometry.wheel_model`).
    """

    stamp_ns: npt.NDArray[np.int64]
    residual: FloatArray
    inliers: FloatArray
    information_along: FloatArray
    information_across: FloatArray
    information_heading: FloatArray
    degenerate: npt.NDArray[np.bool_]
    substitute: Sequence[str]
    slip: FloatArray
    wheels: Sequence[str]


_TEXTS = ("substitute", "wheels")


@dataclass(frozen=True, slots=True)
class MapInfo:
    """What `map.json` says besides versions and hashes of the folder's files."""

    sources: Sequence[Path]
    options: Mapping[str, Any] = field(default_factory=dict)
    counts: Mapping[str, Any] = field(default_factory=dict)
    warnings: Sequence[str] = ()
    frames: Mapping[str, str] = field(default_factory=lambda: dict(FRAMES))


class MapFolderWriter:
    """Writes one map folder; `path` is where it grows, `complete` returns where it ended."""

    def __init__(self, target: Path, *, force: bool = False, inputs: Sequence[Path] = ()) -> None:
        """Make the partial folder for `target`; `inputs` are what the map is made of, and never replaced.

        Raises:
            UsageError: the target is no name of a folder to make, or is there already, and must not be replaced.
            InputError: the folder cannot be made.
        """
        self._folder = OutputFolder(target, force=force, inputs=inputs)
        self.path = self._folder.path

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

    def write_trajectory(self, trajectory: Trajectory) -> Path:
        """Write `trajectory.tum`: base_link in map, final, one line for each scan of the front scanner."""
        return self._write_tum("trajectory.tum", trajectory)

    def write_odometry(self, trajectory: Trajectory) -> Path:
        """Write `odometry.tum`: the same from odometry alone."""
        return self._write_tum("odometry.tum", trajectory)

    def write_diagnostics(self, diagnostics: Diagnostics) -> Path:
        """Write `diagnostics.parquet`."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        texts = {name: pa.array(list(getattr(diagnostics, name)), pa.string()) for name in _TEXTS}
        columns = diagnostics._asdict() | texts
        path = self.path / "diagnostics.parquet"
        with path.open("wb") as file:
            pq.write_table(pa.table(columns), file, compression="zstd")
        return self.finished(path)

    def write_json(self, name: str, values: Mapping[str, Any]) -> Path:
        """Write another JSON file of the contract (`pile.json`, `topology.geojson`)."""
        return self.finished(_write_json(self.path / name, values))

    def complete(self, info: MapInfo, source_hashes: Mapping[Path, Any] | None = None) -> Path:
        """Write `map.json`, rename the folder and return its final path.

        `source_hashes` are those of `source_entry`, where the caller has them already (they are slow for large logs).

        Raises:
            UsageError: the name was taken meanwhile.
            InputError: a source cannot be read, or the folder cannot be renamed.
        """
        known = source_hashes or {}
        entries = [known[path] if path in known else source_entry(path) for path in info.sources]
        names = sorted(path for path in self.path.iterdir() if path.is_file() and not path.name.startswith("."))
        files = {path.name: file_entry(path) for path in names}
        _write_json(
            self.path / "map.json",
            {
                "format_version": FORMAT_VERSION,
                "software": SOFTWARE,
                "options": info.options,
                "sources": entries,
                "frames": info.frames,
                "counts": info.counts,
                "files": files,
                "warnings": list(info.warnings),
            },
        )
        return self._folder.complete()

    def _write_tum(self, name: str, trajectory: Trajectory) -> Path:
        write_tum(self.path / name, trajectory)
        return self.finished(self.path / name)


class MapFolder:
    """A complete map folder, opened with `MapFolder.open`; the files are read when they are asked for."""

    def __init__(self, path: Path, info: Mapping[str, Any]) -> None:
        self.path = path
        self.info = info

    @classmethod
    def open(cls, path: Path) -> Self:
        """Open a map folder.

        Raises:
            InputError: there is no map folder, it is partial, or of a newer format.
        """
        if not path.is_dir():
            found = "there is a file" if path.exists() else "there is nothing"
            found = "there is a log; lhdmap build-map makes a map of it" if looks_like_log(path) else found
            raise InputError(f"{path}: a map folder was wanted, {found}")
        file = path / "map.json"
        if not file.exists() and path.name.endswith(PARTIAL_SUFFIX):
            raise InputError(f"{path}: this map was interrupted before it was complete; run build-map again")
        try:
            info = json.loads(file.read_text(encoding="utf-8"))
            version = int(info["format_version"])
        except FileNotFoundError:
            raise InputError(f"{path}: a map folder was wanted, it has no map.json") from None
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{file}: not the description of a map ({error})") from error
        if version > FORMAT_VERSION:
            raise InputError(f"{path}: format version {version}, this software reads up to {FORMAT_VERSION}; update it")
        return cls(path, info)

    def trajectory(self) -> Trajectory:
        """Return the final trajectory, base_link in map."""
        return read_tum(self.file("trajectory.tum"))

    def odometry(self) -> Trajectory:
        """Return the trajectory from odometry alone."""
        return read_tum(self.file("odometry.tum"))

    def diagnostics(self) -> Diagnostics:
        """Return the diagnostics of each processed scan.

        Raises:
            InputError: the file is missing, damaged or lacks a column.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        path = self.file("diagnostics.parquet")
        try:
            with path.open("rb") as file:
                table = pq.read_table(file, columns=list(Diagnostics._fields))
            columns = {name: table.column(name).to_numpy() for name in Diagnostics._fields}
        except (pa.ArrowException, OSError, KeyError) as error:
            raise InputError(f"{path}: not readable as diagnostics ({error})") from error
        return Diagnostics(**columns | {name: [str(text) for text in columns[name]] for name in _TEXTS})

    def file(self, name: str) -> Path:
        """Return the path of one file of the folder.

        Raises:
            InputError: the folder has no such file.
        """
        path = self.path / name
        if not path.is_file():
            raise InputError(f"{self.path}: the map folder has no {name}")
        return path

    def changed_files(self) -> list[str]:
        """Return the names of files that are missing or differ from the hashes in `map.json`."""
        recorded = self.info.get("files", {})
        return [
            name
            for name, entry in recorded.items()
            if not (self.path / name).is_file() or sha256_of(self.path / name) != entry["sha256"]
        ]


def _write_json(path: Path, values: Mapping[str, Any]) -> Path:
    text = json.dumps(_plain(values), indent=2, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")
    return path


def _plain(value: Any) -> Any:
    """Return numpy values, paths and tuples as what JSON knows; what is not finite as null."""
    if isinstance(value, Mapping):
        return {shown(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, (bool, int, float)) else shown(value)

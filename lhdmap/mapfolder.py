"""The map folder: a run's folder (`lhdmap.runfolder`) with the files of a map and `map.json`; its writer and its reader."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from lhdmap.descriptions import MAP
from lhdmap.errors import InputError
from lhdmap.messages import FloatArray
from lhdmap.runfolder import RunFolder, RunFolderWriter, RunInfo
from lhdmap.trajectory import Trajectory, read_tum, write_tum

FRAMES = {
    "map": "gravity-aligned, z up; position and heading of base_link at the first scan are its origin",
    "base_link": "middle of the front axle on the floor, x forward, y left, z up; the poses of the trajectories",
}


class Diagnostics(NamedTuple):
    """One row for each processed scan, M of them.

    `residual` (the matcher's, m), `inliers` (share or count, as the matcher gives it), `information_along`,
    `information_across` (1/m^2) and `information_heading` (1/rad^2) in the machine's frame, `degenerate` (an axis was
    not observed), `substitute` (what was used instead: `wheels`, `motion`, or empty), `slip` (skid factor of
    the wheels, Eq. (7) of the loading paper; NaN where not known), `wheels` (what became of the wheels' step before the scan,
    and why: `lhdmap.odometry.wheels.model`). `std_along`, `std_across` (m), `std_heading` (rad): standard deviations of what the
    step from the processed scan before adds to the error of the path; None in maps that do not tell it.
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
    std_along: FloatArray | None = None
    std_across: FloatArray | None = None
    std_heading: FloatArray | None = None


_TEXTS = ("substitute", "wheels")
_COLUMNS = (
    [name for name in Diagnostics._fields if name not in Diagnostics._field_defaults],
    list(Diagnostics._field_defaults),
)


_OF_EVERY_MAP = ("topology.geojson", "free_space.npz", "landmarks.npz")  # but of those of before, and without topology


class MapFolderWriter:
    """Writes one map folder; `path` is where it grows, `complete` returns where it ended."""

    def __init__(self, target: Path, *, force: bool = False, inputs: Sequence[Path] = ()) -> None:
        """Make the partial folder for `target`; `inputs` are what the map is made of, and never replaced.

        Raises:
            UsageError: the target is no name of a folder to make, or is there already, and must not be replaced.
            InputError: the folder cannot be made.
        """
        self._run = RunFolderWriter(MAP, target, force=force, inputs=inputs)
        self.path = self._run.path

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Keep the partial folder as it is, if something in it was finished."""
        self._run.__exit__(kind, error, trace)

    def finished(self, path: Path) -> Path:
        """Note that a file of the folder is whole, and return its path: it is kept if the run ends before its time."""
        return self._run.finished(path)

    def write_trajectory(self, trajectory: Trajectory) -> Path:
        """Write `trajectory.tum`: base_link in map, final, one line for each scan of the front scanner."""
        return self._write_tum("trajectory.tum", trajectory)

    def write_odometry(self, trajectory: Trajectory) -> Path:
        """Write `odometry.tum`: the same from odometry alone."""
        return self._write_tum("odometry.tum", trajectory)

    def write_diagnostics(self, diagnostics: Diagnostics) -> Path:
        """Write `diagnostics.parquet`."""
        columns = {name: values for name, values in diagnostics._asdict().items() if values is not None}
        texts = {name: list(columns[name]) for name in _TEXTS}
        return self._run.write_table("diagnostics.parquet", columns | texts)

    def write_json(self, name: str, values: Mapping[str, Any]) -> Path:
        """Write another JSON file of the contract (`pile.json`, `topology.geojson`)."""
        return self._run.write_json(name, values)

    def complete(self, info: RunInfo, source_hashes: Mapping[Path, Any] | None = None) -> Path:
        """Write `map.json`, rename the folder and return its final path; as `RunFolderWriter.complete`.

        The frames are those of each map (`FRAMES`), but for what `info` says of them.

        Raises:
            UsageError: the name was taken meanwhile.
            InputError: a source cannot be read, or the folder cannot be renamed.
        """
        return self._run.complete(replace(info, frames=FRAMES | dict(info.frames)), source_hashes)

    def _write_tum(self, name: str, trajectory: Trajectory) -> Path:
        write_tum(self.path / name, trajectory)
        return self.finished(self.path / name)


class MapFolder:
    """A complete map folder, opened with `MapFolder.open`; the files are read when they are asked for."""

    def __init__(self, run: RunFolder) -> None:
        self.path, self.info = run.path, run.info
        self._run = run

    @classmethod
    def open(cls, path: Path) -> Self:
        """Open a map folder.

        Raises:
            InputError: there is no map folder, it is partial, or of a newer format.
        """
        return cls(RunFolder.open(path, [MAP]))

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
        columns: dict[str, Any] = self._run.table("diagnostics.parquet", *_COLUMNS)
        return Diagnostics(**columns | {name: [str(text) for text in columns[name]] for name in _TEXTS})

    def file(self, name: str) -> Path:
        """Return the path of one file of the folder.

        Raises:
            InputError: the folder has no such file.
        """
        if name in _OF_EVERY_MAP and not (self.path / name).is_file():
            raise InputError(
                f"{self.path}: the map has no {name}; build it again with lhdmap build-map (topology.method)"
            )
        return self._run.file(name)

    def json(self, name: str) -> dict[str, Any]:
        """Return the table in one of the folder's JSON files; raises InputError where it is missing or damaged."""
        return self._run.json(name)

    def changed_files(self) -> list[str]:
        """Return the names of files that are missing or differ from the hashes in `map.json`."""
        return self._run.changed_files()

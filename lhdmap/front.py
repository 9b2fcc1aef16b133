"""The front door for Python: `build_map` and `open_map` take plain paths and return a `Map`; `lhdmap` itself exports them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from lhdmap.config import Settings, load_settings, settings_from
from lhdmap.errors import InputError, UsageError
from lhdmap.integration.cloud import GridCloud
from lhdmap.machine import Machine, load_machine
from lhdmap.mapfolder import Diagnostics, MapFolder
from lhdmap.names import beside
from lhdmap.trajectory import Trajectory

AnyPath = str | os.PathLike[str]


class Map:
    """A map folder: what was found on a drive. Its files are read when they are asked for, and trajectories only once.

    Made by `build_map` and `open_map`. Lengths are metres, stamps integer nanoseconds, poses those of `base_link` (middle of
    the front axle, on the floor) in `map` (z up; its origin is the first pose).

    Attributes:
        folder: the map folder, an absolute path.
    """

    def __init__(self, folder: MapFolder) -> None:
        self.folder = folder.path
        self._files = folder

    @cached_property
    def trajectory(self) -> Trajectory:
        """The final trajectory, one pose for each of the N front scans.

        Its fields are `stamps_ns` (N,) int64, `positions_m` (N, 3) and `quaternions_xyzw` (N, 4); `T_map_base` gives the poses as
        matrices (N, 4, 4).

        Raises:
            InputError: the file is missing or damaged.
        """
        return self._files.trajectory()

    @cached_property
    def odometry(self) -> Trajectory:
        """The same from odometry alone, before loop closure; raises InputError as `trajectory` does."""
        return self._files.odometry()

    def cloud(self) -> GridCloud:
        """Read the cloud of N points; `.to_open3d()` makes an `open3d.geometry.PointCloud` of it.

        Its fields are `points_m` (N, 3) float32 in `map`, `normals` (N, 3) float32 towards the scanner (zero where unknown),
        `curvature` (N,) float32 (0 on a plane, at most 1/3), `stamps_ns` (N,) int64 and `hits` (N,) uint32.

        Raises:
            InputError: the file is missing or damaged.
        """
        from lhdmap.integration.cloud_io import read_cloud

        return read_cloud(self._files.file("cloud.ply"))

    def diagnostics(self) -> Diagnostics:
        """Read what each of the M processed scans saw and did not see: arrays (M,), `degenerate` marks the weak ones.

        Raises:
            InputError: the file is missing or damaged.
        """
        return self._files.diagnostics()

    @cached_property
    def pile(self) -> dict[str, Any] | None:
        """The ore pile as in `pile.json` (`status`, `width_m`, `inclination_deg`, …); None where none was looked for.

        Raises:
            InputError: the file is damaged.
        """
        return self._files.json("pile.json") if (self.folder / "pile.json").is_file() else None

    @property
    def report(self) -> Path:
        """Path of the report, one HTML page for a browser; raises InputError where it is missing."""
        return self._files.file("report.html")

    @property
    def warnings(self) -> list[str]:
        """What concerned the input but did not stop the run, each as a text for a person."""
        return [str(text) for text in self._files.info.get("warnings", [])]

    @property
    def summary(self) -> dict[str, Any]:
        """The figures of `lhdmap build-map --json`: `scans`, `distance_m`, `degenerate_share`, `realtime_factor`, ….

        `map` is the folder, `pile` the status of the pile or None, `warnings` the list of warnings.
        """
        return {**self._files.info.get("counts", {}), "map": str(self.folder), "warnings": self.warnings}

    def __repr__(self) -> str:
        found = self.summary
        drive = f"{found['distance_m']:.1f} m in {found['duration_s']:.1f} s" if "distance_m" in found else "a drive"
        return f"<Map '{self.folder.name}': {drive}, {found.get('scans', 0)} scans, {len(self.warnings)} warning(s)>"


def build_map(
    log: AnyPath | Sequence[AnyPath],
    out: AnyPath | None = None,
    *,
    settings: AnyPath | Mapping[str, Any] | Settings | None = None,
    topics: Mapping[str, str] | None = None,
    poses: AnyPath = "",
    machine: AnyPath | Machine | None = None,
    force: bool = False,
    helper: bool = False,
) -> Map:
    """Build the map of one drive, or of several that overlap: `lhdmap build-map` as a function, which prints nothing.

    Args:
        log: log file or bag folder; a list of several: parts of one drive, or drives that overlap.
        out: the map folder to make; without it `NAME_map` beside the log. A folder that exists is refused.
        settings: what differs from the defaults: `{"odometry.method": "range_flow"}`, `{"odometry": {"method": "range_flow"}}`,
            or a TOML file (`lhdmap config` prints all settings with their units).
        topics: topics by role where the log leaves a doubt, e.g. `{"front": "/scan"}`.
        poses: a TUM file of poses to integrate with instead of the odometry's, or `ground-truth` for those in the log.
        machine: machine file (TOML): dimensions, bodies, mounts; without it the mounts of the log, else those of an 11-t loader.
        force: replace `out` where it exists.
        helper: look for the pile, record and report in a second process: faster on drives of a minute and more, takes
            0.3 GiB more. The calling script must then have its `if __name__ == "__main__":`.

    Raises:
        InputError: a log (or a file of poses or machine) is missing or cannot be used, or holds no scan.
        UsageError: `out` exists or is no name of a folder, a role is unknown.
        ConfigError: a setting is unknown (the nearest name is given), or has the wrong type or range.
        KeyboardInterrupt: Ctrl-C; what was finished is in `out` + `.partial`.
    """
    from lhdmap.pipeline.build import BuildRequest
    from lhdmap.pipeline.join import build_drives

    logs = _logs(log)
    request = BuildRequest(
        logs=logs,
        target=beside(logs[0], "map") if out is None else _path(out, "out"),
        settings=_settings(settings),
        topics=dict(topics or {}),
        machine=machine if machine is None or isinstance(machine, Machine) else load_machine(_path(machine, "machine")),
        poses=str(_path(poses, "poses")) if poses else "",
        helper=helper,
        force=force,
    )
    return open_map(build_drives(request).folder)


def open_map(path: AnyPath) -> Map:
    """Open a map folder; nothing but its description (`map.json`) is read yet.

    Raises:
        InputError: there is no map folder at the path, it is not complete, or of a newer format.
    """
    return Map(MapFolder.open(_path(path, "map")))


def _logs(log: AnyPath | Sequence[AnyPath]) -> list[Path]:
    listed = [log] if isinstance(log, (str, os.PathLike)) or not isinstance(log, Sequence) else log
    if not listed:
        raise InputError("log: the list is empty; a log file, a bag folder or several of them were wanted")
    return [_path(one, "log") for one in listed]


def _path(given: AnyPath, name: str) -> Path:
    if not isinstance(given, (str, os.PathLike)):
        raise UsageError(f"{name} = {given!r}: a path was wanted, as text or pathlib.Path")
    if not os.fspath(given):
        raise UsageError(f"{name} is empty: a path was wanted")
    return Path(given).expanduser()


def _settings(given: AnyPath | Mapping[str, Any] | Settings | None) -> Settings:
    if given is None or isinstance(given, Settings):
        return given or Settings()
    return settings_from(given) if isinstance(given, Mapping) else load_settings(_path(given, "settings"))

"""A log read for Tables 3 and 4 of the navigation paper: signals in a first pass, walls beside the machine in a second."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from lhdmap.descriptions import described
from lhdmap.errors import InputError
from lhdmap.evaluation.navigation.drive import Samples, sampled, smoothness, table_3
from lhdmap.evaluation.navigation.path import WheelPath
from lhdmap.evaluation.navigation.rate_free import rate_free
from lhdmap.evaluation.navigation.row import Row, row_of
from lhdmap.evaluation.navigation.signals import ROLES, SignalCollector, Signals
from lhdmap.evaluation.navigation.walls import WallGauge, WallRow, wall_figures
from lhdmap.logs.source import LogSource
from lhdmap.machine import Machine
from lhdmap.messages import LaserScan, Mount
from lhdmap.pipeline.build import Progress
from lhdmap.pipeline.mounts import SensorMounts, machine_of

_SCANNERS = ("front", "rear")
_WITHOUT = {
    "tachometer": "no tachometer: speed, times, distances, state differences and walls are not known",
    "joints": "no joint angles: state differences and walls are not known",
    "command": "no commands: command differences are not known",
    "mode": "no mode: tele-operation time and autonomous distance are not known (--operation tells who drove)",
    "front": "no front scanner: walls are those that the rear one has seen",
    "rear": "no rear scanner: walls are those that the front one has seen",
}


@dataclass(frozen=True, slots=True)
class DriveRequest:
    """A log or the folder of a replay, and what is told of it: load `E` or `L`, who drove where the log has no mode."""

    log: Path
    load: str | None = None
    operation: str = ""
    topics: Mapping[str, str] = field(default_factory=dict)
    machine: Machine | None = None
    progress: Progress | None = None


class Drive(NamedTuple):
    """What was found of one log."""

    row: Row
    samples: Samples
    walls: list[WallRow]


def read_drive(request: DriveRequest) -> Drive:
    """Return the figures of one drive; what the log lacks is not known, and said in the row's warnings.

    Raises:
        InputError: the log cannot be read, or has nothing of a drive in it.
    """
    path, told_load = log_in(request.log)
    with LogSource(path, request.topics, force=True, needs_scanner=False) as source:
        lacking = [text for role, text in _WITHOUT.items() if role not in source.roles and role != "mode"]
        if "mode" not in source.roles and not request.operation:
            lacking.append(_WITHOUT["mode"])
        if not any(role in source.roles for role in ROLES):
            raise InputError(
                f"{path}: no tachometer, joint angles, commands or mode; lhdmap doctor tells what is in it"
            )
        signals = _signals(source)
        machine, known = request.machine or Machine(), machine_of(source, request.machine)
        samples = sampled(signals, machine, request.operation)
        walls, said = _walls(source, signals, machine if known else None, request.progress)
        warnings = [*lacking, *signals.remarks, *said, *source.warnings, *source.damage]
    figures: dict[str, Any] = {**table_3(samples, signals.length_s), **smoothness(samples), **rate_free(signals)}
    row = row_of(str(request.log), request.load or told_load, {**figures, **wall_figures(walls)}, warnings, signals)
    return Drive(row, samples, walls)


def log_in(path: Path) -> tuple[Path, str | None]:
    """Return the log of a path, which is that of a log or the folder of a replay, and the load that the replay tells.

    Raises:
        InputError: it is a folder of another run.
    """
    info = described(path) if path.is_dir() else None
    if info is None:
        return path, None
    if not (path / "run.mcap").is_file():
        raise InputError(f"{path}: a {info.get('kind', 'run')} folder without run.mcap; a log or a replay was wanted")
    return path / "run.mcap", _load(info)


def _load(info: Mapping[str, Any]) -> str | None:
    load_t = info.get("options", {}).get("scenario", {}).get("load")
    return None if load_t is None else "L" if load_t > 0.0 else "E"


def _signals(source: LogSource) -> Signals:
    collector = SignalCollector()
    for _, message in source.messages([role for role in ROLES if role in source.roles]):
        collector.update(message)
    return collector.signals(source.duration_s, source.start_ns or 0)


def _walls(
    source: LogSource, signals: Signals, machine: Machine | None, progress: Progress | None
) -> tuple[list[WallRow], list[str]]:
    """Return the distances to the walls over time and what was odd, both empty where they cannot be known."""
    wanted = [role for role in _SCANNERS if role in source.roles]
    if machine is None or not wanted or not len(signals.speed_mps.time_s) or not len(signals.articulation_rad.time_s):
        return [], [] if machine else ["no LHD by its topics: walls are not known (--machine FILE tells what it is)"]
    gauge, mounts = WallGauge(WheelPath(signals, machine), machine, signals.start_ns), SensorMounts(machine)
    messages: Iterable[Any] = source.messages(["tf_static", *wanted])
    for role, message in progress(messages, source.duration_s) if progress else messages:
        if isinstance(message, Mount):
            mounts.update(message)
        elif isinstance(message, LaserScan):
            gauge.update(message, mounts.of(message.frame_id, role))
    frozen = [f"{gauge.frozen} scans repeat the one before while the machine moves: not used for the walls"]
    return gauge.rows, [*mounts.warnings, *(frozen if gauge.frozen else ())]

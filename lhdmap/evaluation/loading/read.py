"""Loads of a log, or of the folder of a replay, whose journal says more than its signals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from lhdmap.descriptions import described
from lhdmap.errors import InputError
from lhdmap.evaluation.loading.journal import loads_in
from lhdmap.evaluation.loading.loads import Load
from lhdmap.evaluation.loading.segments import loads_of
from lhdmap.evaluation.loading.signals import ROLES, LoadingCollector, LoadingSignals
from lhdmap.loading.weighing_settings import WeighingSettings
from lhdmap.logs.source import LogSource

_WITHOUT = {
    "command": "no commands: digs cannot be found",
    "joints": "no joint angles: nothing is known of boom and bucket, and nothing is weighed",
    "transmission_pressure": "no transmission pressure: whatever tilts while driving forward counts as a dig",
    "lift_pressure": "no lift pressure: fills are not known",
    "tachometer": "no tachometer: that the machine stands while it weighs is not known",
    "mode": "no mode: who dug is not known",
}
BY_OPERATOR = ("teleoperated", "assisted", "manual")


@dataclass(frozen=True, slots=True)
class LoadingRequest:
    """A log or the folder of a replay, topics by role, the weighing model of the machine."""

    log: Path
    topics: Mapping[str, str] = field(default_factory=dict)
    weighing: WeighingSettings = field(default_factory=WeighingSettings)


class Found(NamedTuple):
    """What was found in one log."""

    loads: list[Load]
    warnings: list[str]


def read_loads(request: LoadingRequest) -> Found:
    """Return the loads of one log.

    Raises:
        InputError: it cannot be read, or has no dig in it.
    """
    folder = request.log if request.log.is_dir() and described(request.log) is not None else None
    if folder is not None and (folder / "journal.jsonl").is_file():
        loads = loads_in(folder / "journal.jsonl", str(request.log))
        if loads:
            return Found(loads, [])
    path = request.log if folder is None else folder / "run.mcap"
    if folder is not None and not path.is_file():
        raise InputError(f"{folder}: a run folder without run.mcap; a log or a replay of a loading was wanted")
    signals, warnings = _signals(path, request.topics)
    loads = loads_of(signals, str(request.log), request.weighing)
    if not loads:
        raise InputError(f"{path}: no dig in it (forward under a tilt or lift command, against a pressure)")
    return Found(loads, warnings + _said(loads))


def _signals(path: Path, topics: Mapping[str, str]) -> tuple[LoadingSignals, list[str]]:
    collector = LoadingCollector()
    with LogSource(path, topics, force=True, needs_scanner=False) as source:
        if "command" not in source.roles:
            raise InputError(f"{path}: no commands (lhd_msgs/MachineCommand): digs cannot be found")
        lacking = [text for role, text in _WITHOUT.items() if role not in source.roles]
        for role, message in source.messages([role for role in ROLES if role in source.roles]):
            collector.update(role, message)
        warnings = [*lacking, *source.warnings, *source.damage]
    signals = collector.signals()
    if signals is None:
        raise InputError(f"{path}: nothing finite in its commands, joints and pressures")
    return signals, warnings


def _said(loads: list[Load]) -> list[str]:
    """Return what must be said of the loads of a log."""
    unknown = sum(one.fill != one.fill for load in loads for one in load.attempts)
    by_hand = sum(one.mode in BY_OPERATOR for load in loads for one in load.attempts)
    said = [f"{unknown} digs without a weighing after them: their fills are not known"] if unknown else []
    return [*said, f"{by_hand} digs by an operator: they count as well"] if by_hand else said

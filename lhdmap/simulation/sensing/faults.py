"""Faults of sensors by name: a `[[fault]]` of a file, and the wrapper that makes a sensor have it.

A faulty sensor reads on: what it would have said only goes elsewhere, so that after a fault all is as if there had been none.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lhdmap.errors import ConfigError
from lhdmap.messages import Record
from lhdmap.roles import ROLES
from lhdmap.settings import REQUIRED, nearest, setting
from lhdmap.settings_tree import load_tree, part
from lhdmap.simulation.history import SECOND_NS, START_NS, History
from lhdmap.simulation.sensing.chance import Chance
from lhdmap.simulation.sensing.distortions import MEASURED, shifted, unreadable, with_noise
from lhdmap.simulation.sensing.sensor import Sensor
from lhdmap.simulation.surroundings import SurroundingsView

SENSOR_KINDS = ("dead", "frozen", "delayed", "biased", "noisy", "nan", "dropped", "jump")
REPLAY_KINDS = ("overrun", "link_lost", "link_degraded", "obstacle", "person", "steering_stuck")
_SIZED = {
    "delayed": "s",
    "biased": "m, rad, m/s or Pa",
    "noisy": "m, rad, m/s or Pa",
    "dropped": "a share",
    "jump": "s",
}


@dataclass(frozen=True, slots=True)
class FaultSettings:
    """Something that goes wrong."""

    at_s: float = setting(0.0, unit="s", minimum=0.0, doc="When it begins, after the start.")
    at: str = setting("", doc="Where it begins, instead: a node or place of the route; for 'lhdmap replay'.")
    kind: str = setting(REQUIRED, doc=f"What: {', '.join((*SENSOR_KINDS, *REPLAY_KINDS))}.")
    target: str = setting("", doc="Topic of a sensor, or a process of 'lhdmap replay'.")
    duration_s: float = setting(0.0, unit="s", minimum=0.0, doc="How long it lasts; 0: to the end.")
    size: float = setting(0.0, doc="How much: delay or step (s), bias or noise (m, rad, m/s, Pa), share of messages.")

    def __post_init__(self) -> None:
        """Check what a field alone cannot; raises ConfigError."""
        kinds = (*SENSOR_KINDS, *REPLAY_KINDS)
        if self.kind not in kinds:
            raise ConfigError(f"unknown kind '{self.kind}'{nearest(self.kind, kinds)}")
        if self.kind in _SIZED and self.size == 0.0:
            raise ConfigError(f"size is missing: '{self.kind}' wants one ({_SIZED[self.kind]})")
        most = 1.0 if self.kind == "dropped" else math.inf
        if self.kind in ("delayed", "noisy", "dropped") and not 0.0 < self.size <= most:
            raise ConfigError(
                f"size = {self.size:g}: '{self.kind}' wants {'a share, 0 to 1' if most == 1.0 else 'more than 0'}"
            )

    @property
    def of_sensor(self) -> bool:
        """Whether it is a fault of a sensor; the others belong to the replay engine."""
        return self.kind in SENSOR_KINDS


@dataclass(frozen=True, slots=True)
class _FaultFile:
    """A file of faults alone."""

    faults: tuple[FaultSettings, ...] = part(tuple, key="fault")


def load_faults(path: Path) -> tuple[FaultSettings, ...]:
    """Return the `[[fault]]`s of a file.

    Raises:
        InputError: the file cannot be read or is not TOML.
        ConfigError: a key or a value in it is wrong.
    """
    return load_tree(_FaultFile, path, "file of faults").faults


def with_faults(sensors: Sequence[Sensor], faults: Sequence[FaultSettings], *, seed: int) -> list[Sensor]:
    """Return the sensors with their faults; of several at one sensor, the first is nearest to it.

    Raises:
        ConfigError: a fault is not one of sensors, or there is no sensor that writes to its target, or it cannot have it.
    """
    faulty, topics = list(sensors), [sensor.topic for sensor in sensors]
    for number, fault in enumerate(faults, start=1):
        _check(fault, topics, f"[[fault]] {number}")
        for k, sensor in enumerate(faulty):
            if sensor.topic == fault.target:
                faulty[k] = _faulty(sensor, fault, Chance(seed, f"{sensor.name}, fault {number}"))
    return faulty


def _check(fault: FaultSettings, topics: list[str], place: str) -> None:
    if not fault.of_sensor or fault.at:
        what = f"kind = '{fault.kind}'" if not fault.of_sensor else f"at = '{fault.at}'"
        raise ConfigError(
            f"{place}: {what} belongs to 'lhdmap replay'; of a sensor, at_s and one of {', '.join(SENSOR_KINDS)}"
        )
    if fault.target not in topics:
        raise ConfigError(f"{place}: no sensor writes to target '{fault.target}'{nearest(fault.target, topics)}")
    told = {role.topic for role in ROLES.values() if role.message not in MEASURED}
    if fault.kind in ("biased", "noisy", "nan") and fault.target in told:
        raise ConfigError(
            f"{place}: '{fault.target}' has no figures that could be {fault.kind}: take dead, frozen or dropped"
        )


class _Window(NamedTuple):
    """When a fault holds, ns."""

    start_ns: int
    end_ns: float

    def holds(self, now_ns: int) -> bool:
        return self.start_ns <= now_ns < self.end_ns


def _window(fault: FaultSettings) -> _Window:
    start_ns = START_NS + round(fault.at_s * SECOND_NS)
    return _Window(start_ns, start_ns + round(fault.duration_s * SECOND_NS) if fault.duration_s > 0.0 else math.inf)


def _faulty(sensor: Sensor, fault: FaultSettings, chance: Chance) -> Sensor:
    if fault.kind == "delayed":
        return _Delayed(sensor, fault)
    return _Frozen(sensor, fault) if fault.kind == "frozen" else _Distorted(sensor, fault, chance)


class _Distorted:
    """A sensor whose readings are lost or changed one by one."""

    def __init__(self, sensor: Sensor, fault: FaultSettings, chance: Chance) -> None:
        self.name, self.topic = sensor.name, sensor.topic
        self._sensor, self._fault, self._window, self._chance, self._index = sensor, fault, _window(fault), chance, 0

    @property
    def next_ns(self) -> int:
        return self._sensor.next_ns

    def read(self, history: History, world: SurroundingsView) -> list[Record]:
        """Return what is left of the reading that is due."""
        now_ns = self._sensor.next_ns
        records = self._sensor.read(history, world)
        self._index += 1
        if not self._window.holds(now_ns):
            return records
        rng = self._chance.of(self._index)
        return [changed for record in records for changed in self._changed(record, rng)]

    def _changed(self, record: Record, rng: np.random.Generator) -> list[Record]:
        message, size = record.message, self._fault.size
        match self._fault.kind:
            case "dead":
                return []
            case "dropped":
                return [] if rng.random() < size else [record]
            case "biased":
                return [record._replace(message=shifted(message, size))]
            case "noisy":
                return [record._replace(message=with_noise(message, size, rng))]
            case "nan":
                return [record._replace(message=unreadable(message))]
        stamp_ns = message.stamp_ns + round(size * SECOND_NS)  # jump
        return [record._replace(message=message._replace(stamp_ns=stamp_ns))]


class _Frozen:
    """A sensor that says the same again and again, with new stamps."""

    def __init__(self, sensor: Sensor, fault: FaultSettings) -> None:
        self.name, self.topic = sensor.name, sensor.topic
        self._sensor, self._window = sensor, _window(fault)
        self._held: list[Record] = []

    @property
    def next_ns(self) -> int:
        return self._sensor.next_ns

    def read(self, history: History, world: SurroundingsView) -> list[Record]:
        """Return what is left of the reading that is due."""
        frozen = self._window.holds(self._sensor.next_ns)
        records = self._sensor.read(history, world)
        if not frozen or not self._held:
            self._held = records or self._held
            return records
        return [
            new._replace(message=held.message._replace(stamp_ns=new.message.stamp_ns))
            for new, held in zip(records, self._held, strict=False)
        ]


class _Delayed:
    """A sensor whose messages come late; their stamps are right. It is due when it reads, and when a message comes."""

    def __init__(self, sensor: Sensor, fault: FaultSettings) -> None:
        self.name, self.topic = sensor.name, sensor.topic
        self._sensor, self._window, self._delay_ns = sensor, _window(fault), round(fault.size * SECOND_NS)
        self._late: list[tuple[int, int, Record]] = []
        self._count = 0

    @property
    def next_ns(self) -> int:
        return min(self._sensor.next_ns, self._late[0][0]) if self._late else self._sensor.next_ns

    def read(self, history: History, world: SurroundingsView) -> list[Record]:
        """Return what is left of the reading that is due."""
        now_ns = self._sensor.next_ns
        if self._late and self._late[0][0] <= now_ns:
            return [heapq.heappop(self._late)[2]]
        records = self._sensor.read(history, world)
        if not self._window.holds(now_ns):
            return records
        for record in records:
            late_ns = record.log_time_ns + self._delay_ns
            heapq.heappush(self._late, (late_ns, self._count, record._replace(log_time_ns=late_ns)))
            self._count += 1
        return []

"""What is told and not measured: mounts, operation mode, node."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from lhdmap.machine import SensorMount
from lhdmap.messages import FloatArray, Mount, Record, Text
from lhdmap.roles import ROLES
from lhdmap.simulation.history import START_NS, History
from lhdmap.simulation.sensing.sensor import NEVER_NS
from lhdmap.simulation.surroundings import SurroundingsView

Told = Callable[[int, FloatArray], str]
"""A text for a stamp and the machine's state at it, shape (20,); empty for nothing to say."""


@dataclass(frozen=True, slots=True)
class Words:
    """Texts that something else knows; `Sampled` asks for them."""

    told: Told

    def __call__(self, stamp_ns: int, state: FloatArray, rng: np.random.Generator) -> Text | None:
        """Return what is said at a stamp."""
        text = self.told(stamp_ns, state)
        return Text(stamp_ns, text) if text else None


class Mounts:
    """The static transforms, once at the start."""

    def __init__(self, mounts: Mapping[str, SensorMount]) -> None:
        self.name, self.topic, self.next_ns = "tf_static", ROLES["tf_static"].topic, START_NS
        self._mounts = mounts

    def read(self, history: History, world: SurroundingsView) -> list[Record]:
        """Return all of them."""
        stamp_ns, self.next_ns = self.next_ns, NEVER_NS
        told = (Mount(stamp_ns, one.parent, name, one.T_parent_sensor) for name, one in self._mounts.items())
        return [Record(self.topic, stamp_ns, mount) for mount in told]

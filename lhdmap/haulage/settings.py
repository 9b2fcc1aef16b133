"""Settings of missions."""

from __future__ import annotations

from dataclasses import dataclass

from lhdmap.haulage.machine import Tries
from lhdmap.settings import setting

_TABLE = "haulage findings, section 4"


@dataclass(frozen=True, slots=True)
class HaulageSettings:
    """Missions: how often a task is tried before somebody is asked to help, and when sections are asked for."""

    dock_tries: int = setting(3, minimum=1, maximum=20, source=_TABLE, doc="How often docking at a point is tried.")
    load_tries: int = setting(3, minimum=1, maximum=20, source=_TABLE, doc="How often loading a bucket is tried.")
    dump_tries: int = setting(2, minimum=1, maximum=20, source=_TABLE, doc="How often dumping it is tried.")
    ask_m: float = setting(
        40.0,
        unit="m",
        minimum=0.0,
        maximum=500.0,
        doc="So far before the end of its section a machine asks for the next one: it brakes from 25 km/h in so much.",
    )

    @property
    def tries(self) -> Tries:
        """How often each task is tried."""
        return Tries(self.dock_tries, self.load_tries, self.dump_tries)

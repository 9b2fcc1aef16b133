"""What is counted of a mission, from its journal: cycles, tonnes, and where the time went."""

from __future__ import annotations

from typing import Any

from lhdmap.haulage.records import Phase
from lhdmap.replay.journal import Event
from lhdmap.replay.processes.executive import EXECUTIVE
from lhdmap.simulation.history import SECOND_NS, START_NS

_BEFORE = "idle"
_WAITS = (Phase.TRAFFIC, Phase.QUEUE_LOAD, Phase.QUEUE_DUMP)


class MissionTally:
    """A listener of the journal; each moment of the run counts for one phase."""

    def __init__(self) -> None:
        self.cycles, self.tonnes, self.assists = 0, 0.0, 0
        self._phase, self._since_ns = _BEFORE, START_NS
        self._ns_of: dict[str, int] = {}
        self._waits_ns, self.longest_wait_s = 0, 0.0
        """The longest time in one go that it stood for others."""

    def __call__(self, event: Event) -> None:
        """Take an event."""
        if event.process != EXECUTIVE:
            return
        if event.event == "cycle":
            self.cycles += 1
            self.tonnes += float(event.values.get("mass_t") or 0.0)
        elif event.event == "state":
            self._until(event.t_ns)
            self.assists += event.after == Phase.ASSISTANCE != self._phase  # of navigation or of a loading task
            self._phase = event.after

    def verdict(self, now_ns: int) -> dict[str, Any]:
        """Return what `verdict.json` says of the mission."""
        self._until(now_ns)
        by_phase = {name: ns / SECOND_NS for name, ns in sorted(self._ns_of.items())}
        helped = {"assists": self.assists, "assist_s": by_phase.get(Phase.ASSISTANCE, 0.0)}
        return {"cycles": self.cycles, "tonnes": self.tonnes, "time_by_phase_s": by_phase, **helped}

    def _until(self, now_ns: int) -> None:
        self._waits_ns = self._waits_ns + now_ns - self._since_ns if self._phase in _WAITS else 0
        self.longest_wait_s = max(self.longest_wait_s, self._waits_ns / SECOND_NS)
        self._ns_of[self._phase] = self._ns_of.get(self._phase, 0) + max(now_ns - self._since_ns, 0)
        self._since_ns = max(now_ns, self._since_ns)

"""All who judge a run: a monitor a machine, and who looks at their sections; the verdict of several machines as one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lhdmap.replay.mission_tally import MissionTally
from lhdmap.replay.processes.monitor import Monitor
from lhdmap.replay.processes.section_watch import SectionWatch
from lhdmap.simulation.history import SECOND_NS, START_NS

_SUMMED = ("distance_m", "stops", "assists", "assist_s", "cycles", "tonnes", "attempts", "charges", "early_triggers")
_OWN = ("ok", "reason", "arrived", "min_clearance_m", "max_speed_kmh", "fill", "fill_true", *_SUMMED)


class Judges:
    """The run ends with the first machine that fails, or once all are done; sharing a section is a failure, too."""

    def __init__(self, monitors: Mapping[str, Monitor], sections: SectionWatch | None = None) -> None:
        self._monitors, self._sections = monitors, sections
        for monitor in monitors.values():
            monitor.tally.company = [one.tally for one in monitors.values()]

    @property
    def _ended(self) -> dict[str, Monitor]:
        return {name: one for name, one in self._monitors.items() if one.ended}

    @property
    def _shared(self) -> Sequence[Mapping[str, Any]]:
        return () if self._sections is None else self._sections.shared

    @property
    def ended(self) -> bool:
        """Whether there is nothing more to wait for."""
        ended = self._ended
        return (
            len(ended) == len(self._monitors) or any(not one.tally.ok for one in ended.values()) or bool(self._shared)
        )

    @property
    def ok(self) -> bool:
        """Whether all has gone well."""
        return not self._shared and all(one.tally.ok for one in self._monitors.values())

    @property
    def reason(self) -> str:
        """Why the run has ended."""
        if self._shared:
            first = self._shared[0]
            return f"{' and '.join(first['machines'])} in section {first['section']} after {first['t_s']:.1f} s"
        bad = {name: one for name, one in self._ended.items() if not one.tally.ok}
        name, monitor = next(iter((bad or self._monitors).items()))
        return monitor.tally.reason if len(self._monitors) == 1 or not bad else f"{name}: {monitor.tally.reason}"

    def interrupt(self) -> None:
        """End the run because somebody wants it."""
        for monitor in self._monitors.values():
            monitor.tally.interrupt()

    def verdict(
        self,
        now_ns: int,
        faults: Sequence[Mapping[str, Any]],
        factor: float,
        journal_sha256: str,
        missions: Mapping[str, MissionTally],
    ) -> dict[str, Any]:
        """Return what `verdict.json` says."""
        each = {
            name: one.tally.verdict(now_ns, faults, factor, journal_sha256)
            | one.verdict()
            | (missions[name].verdict(now_ns) if name in missions else {})
            for name, one in self._monitors.items()
        }
        first = next(iter(each.values()))
        if len(each) == 1:
            return first
        waits = {"longest_wait_s": max((one.longest_wait_s for one in missions.values()), default=0.0)}
        return self._together(first, each, (now_ns - START_NS) / SECOND_NS) | waits

    def _together(
        self, first: Mapping[str, Any], each: Mapping[str, Mapping[str, Any]], duration_s: float
    ) -> dict[str, Any]:
        """Return the verdicts of all machines as one: sums, worst cases, and each by itself."""
        ones = list(each.values())
        whole = dict(first) | {"ok": self.ok, "reason": self.reason, "arrived": all(one["arrived"] for one in ones)}
        whole |= {key: sum(one[key] for one in ones) for key in _SUMMED if key in first}
        near = [one["min_clearance_m"] for one in ones if one["min_clearance_m"] is not None]
        whole["contacts"] = [{"machine": name, **contact} for name, one in each.items() for contact in one["contacts"]]
        whole["min_clearance_m"] = min(near, default=None)
        whole["max_speed_kmh"] = max(one["max_speed_kmh"] for one in ones)
        whole["mean_speed_kmh"] = 3.6 * whole["distance_m"] / max(duration_s * len(ones), 1e-9)
        phases = sorted({name for one in ones for name in one.get("time_by_phase_s", {})})
        whole["time_by_phase_s"] = {
            name: sum(one.get("time_by_phase_s", {}).get(name, 0.0) for one in ones) for name in phases
        }
        whole["sections_shared"] = list(self._shared)
        whole["machines"] = [
            {"machine": name}
            | {key: one[key] for key in _OWN if key in one}
            | {"contacts": len(one["contacts"]), "time_by_phase_s": one.get("time_by_phase_s", {})}
            for name, one in each.items()
        ]
        return whole

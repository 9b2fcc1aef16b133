"""The verdict on a run: what is counted while it goes on, when it ends, and what `verdict.json` says."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from lhdmap.replay.counts import ContactCount, DriveCount, MissionCount, place_of, seconds
from lhdmap.replay.faults import Position
from lhdmap.replay.parts import Nearness, State
from lhdmap.replay.scenario import Limits
from lhdmap.settings import figure
from lhdmap.simulation.history import SECOND_NS, START_NS

KEYS = (
    "ok", "reason", "kind", "arrived", "contacts", "min_clearance_m", "distance_m", "duration_s", "mean_speed_kmh",
    "max_speed_kmh", "stops", "assists", "assist_s", "faults", "realtime_factor", "journal_sha256",
)  # fmt: skip
INTERRUPTED = "interrupted"
_ROLL_OUT_NS = 10 * SECOND_NS  # after the end of the drive the machine may take so long to stand


class Tally:
    """Takes true states, contacts and what is said of the mission; `judge` decides whether the run has ended."""

    def __init__(self, kind: str, limits: Limits, goal_m: Position | None = None) -> None:
        self._kind, self._limits, self._goal_m = kind, limits, goal_m
        self.ok, self.reason, self.arrived, self.ended = False, "not ended", False, False
        self.drive, self.touched, self.mission = DriveCount(), ContactCount(), MissionCount()
        self.company: Sequence[Tally] = (self,)

    def at(self, state: State) -> None:
        """Take a true state."""
        self.drive.at(state, self._limits.no_progress_m)

    def near(self, now_ns: int, nearness: Nearness) -> None:
        """Take what is touched, and how near the walls are."""
        self.touched.near(now_ns, nearness, 0.0 if self.drive.state is None else self.drive.state.speed_mps)

    def said(self, now_ns: int, text: str) -> None:
        """Take how far the mission is."""
        self.mission.said(now_ns, text)

    def judge(self, now_ns: int) -> None:
        """End the run where there is a reason to."""
        limits = self._limits
        if self.ended:
            return
        if self.touched.count > limits.contacts:
            last = self.touched.last
            x, y, z = last["point_m"]
            self._end(f"contact: {last['body']} at ({x:.2f}, {y:.2f}, {z:.2f}) m after {last['t_s']:.1f} s")
        elif self.mission.aborted:
            self._end(self.mission.aborted)
        elif self.mission.done_ns is not None:
            self._judge_end(now_ns, self.mission.done_ns)
        elif self.drive.anchor is not None and now_ns - self._went_on_ns > limits.no_progress_s * SECOND_NS:
            x, y, z = self.drive.anchor[1]
            within = f"within {figure(limits.no_progress_m)} m of ({x:.1f}, {y:.1f}, {z:.1f}) m"
            self._end(f"no progress: {figure(limits.no_progress_s)} s {within}")
        elif now_ns - START_NS >= limits.time_s * SECOND_NS:
            self._end(self._late())

    @property
    def moved_ns(self) -> int:
        """When this machine moved on."""
        return 0 if self.drive.anchor is None else self.drive.anchor[0]

    @property
    def _went_on_ns(self) -> int:
        """When this machine moved on, or another one that it may have waited for."""
        return max((one.moved_ns for one in self.company if not one.ended), default=0)

    def _late(self) -> str:
        if self.drive.state is None:
            return "nothing could be judged: the truth was withheld"
        return f"time limit: not done after {figure(self._limits.time_s)} s"

    def _judge_end(self, now_ns: int, done_ns: int) -> None:
        stands = self.drive.stands
        if not stands and now_ns - done_ns < _ROLL_OUT_NS:
            return
        if not stands:
            self._end(f"still moving {figure(_ROLL_OUT_NS / SECOND_NS)} s after the drive was done")
            return
        off_m = 0.0
        if self._goal_m is not None and self.drive.state is not None:
            off_m = math.dist(place_of(self.drive.state), self._goal_m)
        self.arrived = off_m <= self._limits.arrival_m
        if self.arrived:
            self._end("arrived" if self._kind == "tram" else "done", ok=True)
        else:
            self._end(f"{off_m:.2f} m beside the goal: {figure(self._limits.arrival_m)} m was wanted")

    def _end(self, reason: str, *, ok: bool = False) -> None:
        self.ended, self.ok, self.reason = True, ok, reason

    def interrupt(self) -> None:
        """End the run because somebody wants it."""
        if not self.ended:
            self._end(INTERRUPTED)

    def verdict(
        self, now_ns: int, faults: Sequence[Mapping[str, Any]], realtime_factor: float, journal_sha256: str
    ) -> dict[str, Any]:
        """Return what `verdict.json` says."""
        duration_s, drive = seconds(now_ns), self.drive
        values = (
            self.ok, self.reason, self._kind, self.arrived, self.touched.contacts, self.touched.clearance_m,
            drive.distance_m, duration_s, 3.6 * drive.distance_m / duration_s if duration_s > 0.0 else 0.0,
            3.6 * drive.max_mps, drive.stops, self.mission.assists, self.mission.assist_s(now_ns), list(faults),
            realtime_factor, journal_sha256,
        )  # fmt: skip
        return dict(zip(KEYS, values, strict=True))

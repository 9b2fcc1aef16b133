"""The verdict on a run: what is counted while it goes on, when it ends, and what `verdict.json` says."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

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
_MOST_CONTACTS = 1000
_MOVING_MPS, _REST_MPS, _REST_NS = 0.1, 0.02, SECOND_NS // 2
_ASSISTANCE, _ABORTED = "assistance", "aborted"
_ROLL_OUT_NS = 10 * SECOND_NS  # after the end of the drive the machine may take so long to stand


class Tally:
    """Takes true states, contacts and what is said of the mission; `judge` decides whether the run has ended."""

    def __init__(self, kind: str, limits: Limits, goal_m: Position | None = None) -> None:
        self._kind, self._limits, self._goal_m = kind, limits, goal_m
        self.ok, self.reason, self.arrived, self.ended = False, "not ended", False, False
        self.contacts: list[dict[str, Any]] = []
        self.contact_count = 0
        self.min_clearance_m: float | None = None
        self.distance_m = self.max_mps = 0.0
        self.stops = self.assists = 0
        self._assist_ns = 0
        self._asked_ns: int | None = None
        self._touching: dict[str, dict[str, Any]] = {}
        self._state: State | None = None
        self._anchor: tuple[int, Position] | None = None
        self._rest_ns: int | None = None
        self._has_moved = False
        self._done_ns: int | None = None
        self._aborted = ""
        self.company: Sequence[Tally] = (self,)

    def at(self, state: State) -> None:
        """Take a true state."""
        place = _place(state)
        if self._state is not None:
            self.distance_m += math.dist(place, _place(self._state))
        speed = abs(state.speed_mps)
        self.max_mps = max(self.max_mps, speed)
        if self._anchor is None or math.dist(self._anchor[1], place) > self._limits.no_progress_m:
            self._anchor = (state.time_ns, place)
        self._count_stop(state.time_ns, speed)
        self._state = state

    def _count_stop(self, now_ns: int, speed_mps: float) -> None:
        """Count a rest once the machine goes on after it: neither that of the start nor that of the end is a stop."""
        if speed_mps < _REST_MPS:
            self._rest_ns = now_ns if self._rest_ns is None else self._rest_ns
        elif speed_mps > _MOVING_MPS:
            rested = self._rest_ns is not None and now_ns - self._rest_ns >= _REST_NS
            self.stops += int(rested and self._has_moved)
            self._rest_ns, self._has_moved = None, True

    def near(self, now_ns: int, nearness: Nearness) -> None:
        """Take what is touched, and how near the walls are; a body that goes on touching is one contact."""
        if nearness.clearance_m is not None:
            self._comes_near(nearness.clearance_m)
        for touch in nearness.touches:
            self._comes_near(0.0)
            known = self._touching.get(touch.body)
            if known is not None:
                known["depth_m"] = max(known["depth_m"], touch.depth_m)
                continue
            speed_mps = 0.0 if self._state is None else self._state.speed_mps
            entry = {"t_s": _seconds(now_ns), "body": touch.body, "point_m": list(touch.point_m)}
            entry |= {"depth_m": touch.depth_m, "speed_kmh": 3.6 * speed_mps}
            self._touching[touch.body] = entry
            self.contact_count += 1
            if len(self.contacts) < _MOST_CONTACTS:
                self.contacts.append(entry)
        bodies = {touch.body for touch in nearness.touches}
        self._touching = {body: entry for body, entry in self._touching.items() if body in bodies}

    def _comes_near(self, clearance_m: float) -> None:
        self.min_clearance_m = clearance_m if self.min_clearance_m is None else min(self.min_clearance_m, clearance_m)

    def said(self, now_ns: int, text: str) -> None:
        """Take how far the mission is."""
        asks = text.startswith(_ASSISTANCE)
        if asks and self._asked_ns is None:
            self.assists, self._asked_ns = self.assists + 1, now_ns
        elif not asks and self._asked_ns is not None:
            self._assist_ns, self._asked_ns = self._assist_ns + now_ns - self._asked_ns, None
        if text.startswith(_ABORTED):
            self._aborted = text
        if text == "done" and self._done_ns is None:
            self._done_ns = now_ns

    def judge(self, now_ns: int) -> None:
        """End the run where there is a reason to."""
        limits = self._limits
        if self.ended:
            return
        if self.contact_count > limits.contacts:
            last = next(reversed(self._touching.values()), self.contacts[-1])
            x, y, z = last["point_m"]
            self._end(f"contact: {last['body']} at ({x:.2f}, {y:.2f}, {z:.2f}) m after {last['t_s']:.1f} s")
        elif self._aborted:
            self._end(self._aborted)
        elif self._done_ns is not None:
            self._judge_end(now_ns, self._done_ns)
        elif self._anchor is not None and now_ns - self._went_on_ns > limits.no_progress_s * SECOND_NS:
            x, y, z = self._anchor[1]
            within = f"within {figure(limits.no_progress_m)} m of ({x:.1f}, {y:.1f}, {z:.1f}) m"
            self._end(f"no progress: {figure(limits.no_progress_s)} s {within}")
        elif now_ns - START_NS >= limits.time_s * SECOND_NS:
            self._end(self._late())

    @property
    def moved_ns(self) -> int:
        """When this machine moved on."""
        return 0 if self._anchor is None else self._anchor[0]

    @property
    def _went_on_ns(self) -> int:
        """When this machine moved on, or another one that it may have waited for."""
        return max((one.moved_ns for one in self.company if not one.ended), default=0)

    def _late(self) -> str:
        if self._state is None:
            return "nothing could be judged: the truth was withheld"
        return f"time limit: not done after {figure(self._limits.time_s)} s"

    def _judge_end(self, now_ns: int, done_ns: int) -> None:
        stands = self._state is None or abs(self._state.speed_mps) < _REST_MPS
        if not stands and now_ns - done_ns < _ROLL_OUT_NS:
            return
        if not stands:
            self._end(f"still moving {figure(_ROLL_OUT_NS / SECOND_NS)} s after the drive was done")
            return
        off_m = 0.0
        if self._goal_m is not None and self._state is not None:
            off_m = math.dist(_place(self._state), self._goal_m)
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
        duration_s = _seconds(now_ns)
        asked_ns = 0 if self._asked_ns is None else now_ns - self._asked_ns
        values = (
            self.ok, self.reason, self._kind, self.arrived, self.contacts, self.min_clearance_m, self.distance_m,
            duration_s, 3.6 * self.distance_m / duration_s if duration_s > 0.0 else 0.0, 3.6 * self.max_mps, self.stops,
            self.assists, (self._assist_ns + asked_ns) / SECOND_NS, list(faults), realtime_factor, journal_sha256,
        )  # fmt: skip
        return dict(zip(KEYS, values, strict=True))


def _place(state: State) -> Position:
    return state.x_m, state.y_m, state.z_m


def _seconds(now_ns: int) -> float:
    return (now_ns - START_NS) / SECOND_NS

"""What is counted of a run, each by itself: the drive, contacts, and what the mission says."""

from __future__ import annotations

import math
from typing import Any

from lhdmap.replay.faults import Position
from lhdmap.replay.parts import Nearness, State
from lhdmap.simulation.history import SECOND_NS, START_NS

_MOST_CONTACTS = 1000  # are told one by one; all are counted
# A machine drives from the first speed on, and rests below the second for as long as that: neither noise nor a change of gear.
_MOVING_MPS, _REST_MPS, _REST_NS = 0.1, 0.02, SECOND_NS // 2
_ASSISTANCE, _ABORTED = "assistance", "aborted"


class DriveCount:
    """How far, how fast, with how many stops; `state` is the newest true one, `anchor` when and where it moved on from last."""

    def __init__(self) -> None:
        self.distance_m = self.max_mps = 0.0
        self.stops = 0
        self.state: State | None = None
        self.anchor: tuple[int, Position] | None = None
        self._rest_ns: int | None = None
        self._has_moved = False

    def at(self, state: State, progress_m: float) -> None:
        """Take a true state; the machine has moved on once it is `progress_m` away."""
        place = place_of(state)
        if self.state is not None:
            self.distance_m += math.dist(place, place_of(self.state))
        speed = abs(state.speed_mps)
        self.max_mps = max(self.max_mps, speed)
        if self.anchor is None or math.dist(self.anchor[1], place) > progress_m:
            self.anchor = (state.time_ns, place)
        self._count_stop(state.time_ns, speed)
        self.state = state

    @property
    def stands(self) -> bool:
        """Whether the machine stands, or nothing is known of it."""
        return self.state is None or abs(self.state.speed_mps) < _REST_MPS

    def _count_stop(self, now_ns: int, speed_mps: float) -> None:
        """Count a rest once the machine goes on after it: neither that of the start nor that of the end is a stop."""
        if speed_mps < _REST_MPS:
            self._rest_ns = now_ns if self._rest_ns is None else self._rest_ns
        elif speed_mps > _MOVING_MPS:
            rested = self._rest_ns is not None and now_ns - self._rest_ns >= _REST_NS
            self.stops += int(rested and self._has_moved)
            self._rest_ns, self._has_moved = None, True


class ContactCount:
    """What was touched; a body that goes on touching is one contact. `clearance_m`: the least, None before the first."""

    def __init__(self) -> None:
        self.contacts: list[dict[str, Any]] = []
        self.count = 0
        self.clearance_m: float | None = None
        self._touching: dict[str, dict[str, Any]] = {}

    def near(self, now_ns: int, nearness: Nearness, speed_mps: float) -> None:
        """Take what is touched, and how near the walls are."""
        if nearness.clearance_m is not None:
            self._comes_near(nearness.clearance_m)
        for touch in nearness.touches:
            self._comes_near(0.0)
            known = self._touching.get(touch.body)
            if known is not None:
                known["depth_m"] = max(known["depth_m"], touch.depth_m)
                continue
            entry = {"t_s": seconds(now_ns), "body": touch.body, "point_m": list(touch.point_m)}
            entry |= {"depth_m": touch.depth_m, "speed_kmh": 3.6 * speed_mps}
            self._touching[touch.body] = entry
            self.count += 1
            if len(self.contacts) < _MOST_CONTACTS:
                self.contacts.append(entry)
        bodies = {touch.body for touch in nearness.touches}
        self._touching = {body: entry for body, entry in self._touching.items() if body in bodies}

    @property
    def last(self) -> dict[str, Any]:
        """The contact that goes on, else the last one that was told."""
        return next(reversed(self._touching.values()), self.contacts[-1])

    def _comes_near(self, clearance_m: float) -> None:
        self.clearance_m = clearance_m if self.clearance_m is None else min(self.clearance_m, clearance_m)


class MissionCount:
    """What is said of the mission: how often and how long it asked for help, when it was done, why it was aborted."""

    def __init__(self) -> None:
        self.assists = 0
        self.done_ns: int | None = None
        self.aborted = ""
        self._assist_ns = 0
        self._asked_ns: int | None = None

    def said(self, now_ns: int, text: str) -> None:
        """Take how far the mission is."""
        asks = text.startswith(_ASSISTANCE)
        if asks and self._asked_ns is None:
            self.assists, self._asked_ns = self.assists + 1, now_ns
        elif not asks and self._asked_ns is not None:
            self._assist_ns, self._asked_ns = self._assist_ns + now_ns - self._asked_ns, None
        if text.startswith(_ABORTED):
            self.aborted = text
        if text == "done" and self.done_ns is None:
            self.done_ns = now_ns

    def assist_s(self, now_ns: int) -> float:
        """Return for how long it has asked for help, that of now included."""
        asked_ns = 0 if self._asked_ns is None else now_ns - self._asked_ns
        return (self._assist_ns + asked_ns) / SECOND_NS


def place_of(state: State) -> Position:
    """Return where a machine is."""
    return state.x_m, state.y_m, state.z_m


def seconds(now_ns: int) -> float:
    """Return the time since the run began."""
    return (now_ns - START_NS) / SECOND_NS

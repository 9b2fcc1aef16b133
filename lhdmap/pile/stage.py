"""The pile as a stage: hits in, estimates and one decision out, while the machine drives."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lhdmap.messages import FloatArray
from lhdmap.pile.end_frame import Frame2
from lhdmap.pile.face import Registration
from lhdmap.pile.measure import measure
from lhdmap.pile.result import PileEstimate, PileReport, Snapshot
from lhdmap.pile.settings import PileSettings
from lhdmap.pile.surface import Scene, View, look
from lhdmap.pile.tilt import TiltCheck
from lhdmap.pile.window import HitWindow

_MOST_HISTORY = 400
_SURE_STD_DEG = 2.5
_ELSEWHERE_M = 5.0
_GRADE_M = 10.0
_IDLE = 3.0  # times the travel between estimates while nothing closes the drift
_AROUND_M, _MOST_AROUND = 10.0, 12_000
_TOE_STD_M = 0.5  # the deadline acts at the last estimate before it, of which the distance is not known better
_FORGET_M = 2.0  # travel without a face after which the last one was none
_NOTHING = 0.5  # probability of none above which nothing closes the drift
_BLURRED_DEG = 25.0  # an inclination that is less sure is none


class ScanHits(NamedTuple):
    """One scan of the front scanner in the map: hits (N, 3) in the order of the beams, and the machine then.

    `T_map_base`: x, y, z (m), heading (rad), shape (4,).
    """

    stamp_ns: int
    points_map: FloatArray
    T_map_base: FloatArray


class PileStage:
    """`update` with each scan; `report` at any time. The cost of an update does not grow with the drive."""

    def __init__(self, settings: PileSettings, registration: Registration | None = None) -> None:
        self._settings = settings
        self._registration = registration or Registration(settings.scale_std, math.radians(settings.pitch_std_deg))
        self._window = HitWindow(settings.reach_m)
        self._travelled_m = 0.0
        self._position: FloatArray | None = None
        self._estimated_m = -math.inf
        self._scene: Scene | None = None
        self._idle = False
        self._tilt = TiltCheck(self._registration.pitch_rad)
        self._path: deque[tuple[float, float]] = deque()
        self._history: list[Snapshot] = []
        self._decision: Snapshot | None = None
        self._best: Snapshot | None = None
        self._found_m = 0.0

    def update(self, scan: ScanHits) -> Snapshot | None:
        """Take one scan; return the new estimate where the machine has moved far enough for one."""
        position = scan.T_map_base[:3]
        if self._position is not None:
            self._travelled_m += _forward(position - self._position, float(scan.T_map_base[3]))
        self._position = position
        self._path.append((self._travelled_m, float(position[2])))
        while abs(self._path[0][0] - self._travelled_m) > _GRADE_M:
            self._path.popleft()
        self._window.add(scan.points_map, position, self._travelled_m)
        wait_m = self._settings.update_m * (_IDLE if self._idle else 1.0)
        if abs(self._travelled_m - self._estimated_m) < wait_m:
            return None
        backs_out = self._travelled_m < self._estimated_m
        self._estimated_m = self._travelled_m
        if backs_out and self._decision is not None:
            return None  # nothing new is seen of the pile, and what was leaves the window
        return self._estimate(scan)

    def report(self) -> PileReport:
        """Return what there is so far."""
        around = self._around(self._best.estimate) if self._best is not None else np.zeros((0, 3))
        return PileReport(self._decision, self._best, tuple(self._history), self._settings.method, around)

    def _around(self, pile: PileEstimate) -> FloatArray:
        """Return the hits around the pile (N, 3), thinned, for pictures."""
        across = pile.left_limit_m - pile.right_limit_m
        heading = math.atan2(-float(across[0]), float(across[1]))
        start = Frame2(pile.center_m, heading).map(np.array([-_AROUND_M, 0.0, 0.0]))
        hits = self._window.hits(np.array([*start, heading]), self._travelled_m)
        hits = hits[hits[:, 0] < 2.0 * _AROUND_M][:, :3]
        return Frame2(start, heading).map(hits[:: max(1, len(hits) // _MOST_AROUND)])

    def _estimate(self, scan: ScanHits) -> Snapshot | None:
        base = Frame2(scan.T_map_base[:3], float(scan.T_map_base[3]))
        hits = self._window.hits(scan.T_map_base, self._travelled_m)
        rng = np.random.default_rng(len(hits))
        self._tilt.update(hits, self._travelled_m)
        tilt = self._tilt.tilt()
        registration = self._registration._replace(pitch_rad=tilt.std_rad)
        view = View(base, self._grade(), registration, self._scene, self._travelled_m, tilt)
        scene = look(hits, view, self._settings.reach_m, rng)
        if scene is None or scene.face.inclination_std_deg > _BLURRED_DEG:
            self._scene = None
            return self._take(Snapshot(scan.stamp_ns, math.nan, PileEstimate()))
        self._scene = scene
        warning = tilt.warning()
        warnings = [] if warning is None else [warning]
        if not scene.floor_seen:
            warnings.append(
                "the floor before the pile was not seen: the toe is where the machine's path would reach the face"
            )
        estimate = replace(measure(scene), warnings=tuple(warnings))
        distance = float(np.linalg.norm(estimate.toe_m - scan.T_map_base[:3], axis=1).min())
        return self._take(Snapshot(scan.stamp_ns, distance, estimate))

    def _grade(self) -> float:
        """Return how the path rose over the last metres (m/m)."""
        first, last = self._path[0], self._path[-1]
        length = abs(last[0] - first[0])
        return (last[1] - first[1]) / length if length > 0.3 * _GRADE_M else 0.0

    def _take(self, snapshot: Snapshot) -> Snapshot:
        """Keep the estimate, and decide: when sure enough, at the latest at the deadline."""
        self._history.append(snapshot)
        if len(self._history) > _MOST_HISTORY:
            del self._history[1::2]
        estimate = snapshot.estimate
        self._idle = not estimate.found or estimate.probabilities["none"] > _NOTHING
        if not estimate.found:
            self._forget()
            return snapshot
        if snapshot.distance_m >= self._settings.closest_m:
            self._best, self._found_m = snapshot, self._travelled_m
            self._withdraw(estimate)
        if self._decision is None and self._sure(snapshot):
            self._decision = snapshot
        return snapshot

    def _forget(self) -> None:
        """Drop an estimate of something that is not seen any more, unless the bucket hides it."""
        if self._best is None:
            return
        moved_m = self._travelled_m - self._found_m
        if abs(moved_m) > _FORGET_M and self._best.distance_m - moved_m > self._settings.closest_m:
            self._best = self._decision = None

    def _withdraw(self, now: PileEstimate) -> None:
        """Take the decision back where what it was on is not the end: the drift goes on behind it, or nothing closes it."""
        decided = self._decision
        if decided is not None and (now.status == "none" or _elsewhere(decided.estimate, now)):
            self._decision = None

    def _sure(self, snapshot: Snapshot) -> bool:
        estimate, settings = snapshot.estimate, self._settings
        if estimate.status == "none":
            return False
        chance = estimate.probabilities[estimate.status]
        if snapshot.distance_m <= settings.deadline_m + settings.update_m + _TOE_STD_M:
            return chance >= settings.likely
        return chance >= settings.sure and estimate.inclination_std_deg <= _SURE_STD_DEG


def _forward(step: FloatArray, heading_rad: float) -> float:
    """Return the travel of a step (3,), negative in reverse."""
    length = float(np.hypot(step[0], step[1]))
    return math.copysign(length, math.cos(heading_rad) * step[0] + math.sin(heading_rad) * step[1])


def _elsewhere(decided: PileEstimate, now: PileEstimate) -> bool:
    return bool(np.hypot(*(now.center_m - decided.center_m)[:2]) > _ELSEWHERE_M)

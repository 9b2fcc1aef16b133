"""The pile as a stage: hits in, estimates and decisions out, while the machine drives."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lhdmap.geometry.frame import UprightFrame
from lhdmap.messages import FloatArray
from lhdmap.pile.approach import Approaches
from lhdmap.pile.face import FaceRegistration
from lhdmap.pile.measure import measure
from lhdmap.pile.result import PileEstimate, PileReport, Snapshot
from lhdmap.pile.settings import PileSettings
from lhdmap.pile.surface import PileScene, PileView, look
from lhdmap.pile.tilt import TiltCheck
from lhdmap.pile.window import HitWindow

_GRADE_M = 10.0
_IDLE = 3.0  # times the travel between estimates while nothing closes the drift
_AROUND_M, _MOST_AROUND = 10.0, 12_000
_NOTHING = 0.5  # probability of none above which nothing closes the drift
_BLURRED_DEG = 25.0  # an inclination that is less sure is none


class ScanHits(NamedTuple):
    """One scan of the front scanner in the map: hits (N, 3) in the order of the beams, and the machine then.

    `pose_map_base`: x, y, z (m), heading (rad), shape (4,).
    """

    stamp_ns: int
    points_map: FloatArray
    pose_map_base: FloatArray


class PileStage:
    """`update` with each scan; `report` at any time. The cost of an update does not grow with the drive."""

    def __init__(self, settings: PileSettings, registration: FaceRegistration | None = None) -> None:
        self._settings = settings
        self._registration = registration or FaceRegistration(settings.scale_std, math.radians(settings.pitch_std_deg))
        self._window = HitWindow(settings.reach_m)
        self._travelled_m = 0.0
        self._position: FloatArray | None = None
        self._estimated_m = -math.inf
        self._scene: PileScene | None = None
        self._tilt = TiltCheck(self._registration.pitch_rad)
        self._path: deque[tuple[float, float]] = deque()
        self._idle = False
        self._approaches = Approaches(settings)

    def update(self, scan: ScanHits) -> Snapshot | None:
        """Take one scan; return the new estimate where the machine has moved far enough for one."""
        position = scan.pose_map_base[:3]
        if self._position is not None:
            self._travelled_m += _forward(position - self._position, float(scan.pose_map_base[3]))
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
        if backs_out and self._approaches.decided:
            self._back_out()
            return None
        snapshot = self._estimate(scan)
        self._approaches.take(snapshot, self._travelled_m)
        return snapshot

    def report(self) -> PileReport:
        """Return what there is so far."""
        return self._approaches.report(self._around(self._approaches.best))

    def _back_out(self) -> None:
        """Keep the pile as it was seen; what is loaded of it changes it: the next approach looks anew."""
        if self._approaches.backed_out(self._travelled_m):
            self._approaches.keep(self._around(self._approaches.best))
            self._window, self._scene = HitWindow(self._settings.reach_m), None

    def _around(self, pile: PileEstimate | None) -> FloatArray:
        """Return the hits around the pile (N, 3), thinned, for pictures."""
        if pile is None:
            return np.zeros((0, 3))
        across = pile.left_limit_m - pile.right_limit_m
        heading = math.atan2(-float(across[0]), float(across[1]))
        start = UprightFrame(pile.center_m, heading).map(np.array([-_AROUND_M, 0.0, 0.0]))
        hits = self._window.hits(np.array([*start, heading]), self._travelled_m)
        hits = hits[hits[:, 0] < 2.0 * _AROUND_M][:, :3]
        return UprightFrame(start, heading).map(hits[:: max(1, len(hits) // _MOST_AROUND)])

    def _estimate(self, scan: ScanHits) -> Snapshot:
        base = UprightFrame(scan.pose_map_base[:3], float(scan.pose_map_base[3]))
        hits = self._window.hits(scan.pose_map_base, self._travelled_m)
        rng = np.random.default_rng(len(hits))
        self._tilt.update(hits, self._travelled_m)
        tilt = self._tilt.tilt()
        registration = self._registration._replace(pitch_rad=tilt.std_rad)
        view = PileView(base, self._grade(), registration, self._scene, self._travelled_m, tilt)
        scene = look(hits, view, self._settings.reach_m, rng)
        if scene is None or scene.face.inclination_std_deg > _BLURRED_DEG:
            self._scene, self._idle = None, True
            return Snapshot(scan.stamp_ns, math.nan, PileEstimate())
        self._scene = scene
        warning = tilt.warning()
        warnings = [] if warning is None else [warning]
        if not scene.floor_seen:
            warnings.append(
                "the floor before the pile was not seen: the toe is where the machine's path would reach the face"
            )
        estimate = replace(measure(scene), warnings=tuple(warnings))
        distance = float(np.linalg.norm(estimate.toe_m - scan.pose_map_base[:3], axis=1).min())
        self._idle = estimate.probabilities["none"] > _NOTHING
        return Snapshot(scan.stamp_ns, distance, estimate)

    def _grade(self) -> float:
        """Return how the path rose over the last metres (m/m)."""
        first, last = self._path[0], self._path[-1]
        length = abs(last[0] - first[0])
        return (last[1] - first[1]) / length if length > 0.3 * _GRADE_M else 0.0


def _forward(step: FloatArray, heading_rad: float) -> float:
    """Return the travel of a step (3,), negative in reverse."""
    length = float(np.hypot(step[0], step[1]))
    return math.copysign(length, math.cos(heading_rad) * step[0] + math.sin(heading_rad) * step[1])

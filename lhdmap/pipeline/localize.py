"""`Localizer`: messages in, where the machine is on a map out; the same object for a log and for a running machine.

messages -> MappingPipeline (odometry alone) -> steps -> Tracker against the map's walls
-> GlobalSearch where the place is not known, or lost
"""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np

from lhdmap.config import Settings
from lhdmap.geometry import se2
from lhdmap.landmarks.model import Landmarks
from lhdmap.landmarks.store import read_landmarks
from lhdmap.localization.fixed_lag import Belief, FixedLag, Step, placed_row
from lhdmap.localization.place_on_map import Placer
from lhdmap.localization.rows import CANDIDATE, LOST, NOWHERE, TRACKING, UNKNOWN, Row
from lhdmap.localization.search import Found, GlobalSearch, RecentWay
from lhdmap.localization.tracker import Tracker
from lhdmap.localization.walls import MapWalls
from lhdmap.machine import Machine
from lhdmap.mapfolder import MapFolder
from lhdmap.messages import FloatArray, Message
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.topology.files import read_topology
from lhdmap.topology.model import TopologicalMap
from lhdmap.topology.sheet import Sheet, read_sheets

_LEAST_SUPPORT = 0.35  # where a node's own scans tell of none


class KnownMap(NamedTuple):
    """What of a map localization needs."""

    topology: TopologicalMap
    landmarks: Landmarks
    sheets: list[Sheet]

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read it from a map folder; raises InputError where something is missing."""
        folder = MapFolder.open(path)
        sheets = read_sheets(folder.file("free_space.npz"))
        return cls(read_topology(path), read_landmarks(folder.file("landmarks.npz")), sheets)


class Where(NamedTuple):
    """Where the machine is now: status, pose (x, y, z, yaw) in `map`, covariance (3, 3) of x, y, yaw; None where not known."""

    status: str
    pose: FloatArray | None
    covariance: FloatArray | None


@dataclass(slots=True)
class _Trial:
    """A place under trial: since where on the way, and the support since."""

    since_m: float
    margin: float
    supports: list[float] = field(default_factory=list)


class Localizer:
    """Takes messages by role in time order; `rows` is what it said of each front scan, `where` the newest.

    `start` (4,): x, y, yaw (rad) and height about where the machine begins; None: it is searched for. With `smoother` a row's pose
    is that of the fixed-lag smoother once the machine is some metres farther. A context manager.
    """

    def __init__(
        self,
        known: KnownMap,
        settings: Settings,
        machine: Machine | None = None,
        start: FloatArray | None = None,
        *,
        smoother: bool = False,
    ) -> None:
        self._lag = FixedLag() if smoother else None
        # What lies beyond the map does not count: no loop is closed, no pile looked for.
        settings = replace(settings, pile=replace(settings.pile, method="off"))
        self._settings = settings.localization
        self.pipeline = MappingPipeline(settings, machine, cloud=False, on_step=self._take)
        self._walls, self._placer = MapWalls(known.topology, known.landmarks), Placer(known.topology)
        self._search = GlobalSearch(known.sheets, self._walls, self._settings)
        self._way = RecentWay(self._settings.window_m)
        self._tracker = None if start is None else self._started(start)
        self._turnable = start is not None  # a waypoint's heading is its node's: the machine may face the other way
        self._status = UNKNOWN if start is None else TRACKING
        self._trial: _Trial | None = None
        self._supports: deque[float] = deque(maxlen=self._settings.support_scans)
        self._before: FloatArray | None = None
        self._travelled_m = self._searched_m = 0.0
        self._probability = 0.0 if start is None else 1.0
        self._information = 0.0
        self.withheld, self.lost_stretches = 0, 0
        self.first_fix: tuple[float, float] | None = None  # seconds, metres
        self._began_ns: int | None = None
        self.rows: list[Row] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Let go of what is held."""
        self.pipeline.__exit__(kind, error, trace)

    def update(self, role: str, message: Message) -> None:
        """Take one message."""
        self.pipeline.update(role, message)

    def finish(self) -> None:
        """Say that the log has ended."""
        self.pipeline.finish()
        for one in self._lag.restart() if self._lag is not None else ():
            self.rows[one.row] = placed_row(self.rows[one.row], one, self._placer)

    def pose_at(self, now_ns: int) -> Where:
        """Return where the machine is now: the newest place carried on as the odometry is (`MappingPipeline.pose_at`)."""
        tracker, now = self._tracker, self.pipeline.pose_at(now_ns)
        if tracker is None or now is None or self._before is None or self._status in (UNKNOWN, LOST):
            return Where(self._status, None, None)
        planar = np.array([now.T_odom_base[0, 3], now.T_odom_base[1, 3], math.atan2(*now.T_odom_base[[1, 0], 0])])
        pose = se2.compose(tracker.pose, se2.between(self._before, planar))
        return Where(self._status, np.array([pose[0], pose[1], tracker.height_m, pose[2]]), tracker.P)

    def _started(self, start: FloatArray) -> Tracker:
        std = np.array([self._settings.start_std_m] * 2 + [math.radians(self._settings.start_std_deg)])
        height = float(start[3]) if len(start) > 3 else 0.0
        return Tracker(self._walls, self._settings, start[:3], np.diag(std**2), height)

    def _take(self, stamp_ns: int, step: OdometryStep, odometry: PlanarOdometry) -> None:
        """Take what the odometry says of a front scan."""
        began = time.perf_counter()
        self._began_ns = stamp_ns if self._began_ns is None else self._began_ns
        if self._before is not None:
            moved = se2.between(self._before, step.T_odom_base)
            self._travelled_m += math.hypot(moved[0], moved[1])
            if self._tracker is not None:
                self._tracker.predict(moved, step.error.covariance if step.processed else np.zeros((3, 3)))
        self._before = step.T_odom_base.copy()
        predicted = self._belief()
        source = ""
        if step.processed:
            points, front = self._hits(odometry)
            self._way.add(self._travelled_m, step.T_odom_base, points)
            source = self._correct(points, front)
            self._judge(stamp_ns)
            self._look_around(step)
        self.rows.append(self._row(stamp_ns, step, source, 1e3 * (time.perf_counter() - began)))
        if self._lag is not None:
            said = Step(len(self.rows) - 1, step.T_odom_base, step.error.covariance, odometry.gyro.turn_rad)
            self._smooth(self._lag, said, predicted)

    def _belief(self) -> Belief | None:
        return None if self._tracker is None else Belief(self._tracker.pose.copy(), self._tracker.P.copy())

    def _smooth(self, lag: FixedLag, step: Step, predicted: Belief | None) -> None:
        """Hand a scan to the smoother; rewrite the rows that are final."""
        believed = self._belief()
        if believed is None or predicted is None or self._status != TRACKING:
            final = lag.restart()
        else:
            final = lag.take(step, predicted, believed)
        for one in final:
            self.rows[one.row] = placed_row(self.rows[one.row], one, self._placer)

    def _hits(self, odometry: PlanarOdometry) -> tuple[FloatArray, int]:
        """Return hits (N, 2) of both scanners near the machine, thinned, and how many are the front one's."""
        parts = []
        for points in (odometry.points, odometry.points_behind):
            near = points[np.hypot(points[:, 0], points[:, 1]) < self._settings.range_m, :2]
            parts.append(near[:: max(-(-2 * len(near) // self._settings.hits), 1)])
        return np.concatenate(parts), len(parts[0])

    def _correct(self, points: FloatArray, front: int) -> str:
        tracker = self._tracker
        if tracker is None or self._status == LOST or len(points) < 10:
            return "odometry" if tracker is not None else ""
        if self._turnable:
            self._turnable = False
            tracker.turn_if_better(points)
        place = self._placer.at(tracker.pose, tracker.height_m, 1.0)
        said = tracker.correct(points, front or len(points), self._walls.quality(place.node))
        tracker.height_m = self._placer.height_m(tracker.pose[0], tracker.pose[1], tracker.height_m)
        self._supports.append(said.support)
        self._information = said.information_along
        return "walls" if said.support > 0.0 else "odometry"

    def _judge(self, stamp_ns: int) -> None:
        """Decide by the support whether the place still holds, or holds at last."""
        if self._tracker is None or self._status == LOST or not self._supports:
            return
        place = self._placer.at(self._tracker.pose, self._tracker.height_m, 1.0)
        least = self._walls.quality(place.node).support_least
        wanted = (least if math.isfinite(least) else _LEAST_SUPPORT) - self._settings.support_drop
        holds = float(np.mean(self._supports)) >= max(wanted, 0.15)
        if not holds and len(self._supports) == self._supports.maxlen:
            self._drop()
        elif self._trial is not None and self._travelled_m - self._trial.since_m >= self._settings.confirm_m:
            self._status, self._trial = TRACKING, None
            self._probability = 1.0
        if self._status == TRACKING and self.first_fix is None and self._began_ns is not None:
            self.first_fix = ((stamp_ns - self._began_ns) * 1e-9, self._travelled_m)

    def _drop(self) -> None:
        """Give a place up: a trial that failed, or one that was lost."""
        self._supports.clear()
        self._probability = 0.0
        self._searched_m = self._travelled_m - self._settings.search_m + 1.0  # search again soon
        if self._trial is not None:
            self.withheld += 1
            self._trial, self._tracker = None, None
            self._status = UNKNOWN if self.first_fix is None else LOST
            return
        self.lost_stretches += 1
        self._status = LOST
        self._way = RecentWay(self._settings.window_m)  # what was seen before may be of another place

    def _look_around(self, step: OdometryStep) -> None:
        """Search the whole map, where the place is not known and the machine has moved on since the last search."""
        wanted_m = min(self._settings.search_m, self._settings.window_m - 1.0)
        if self._status not in (UNKNOWN, LOST) or self._way.length_m < wanted_m:
            return
        if self._travelled_m - self._searched_m < self._settings.search_m:
            return
        self._searched_m = self._travelled_m
        found = self._search.places(self._way, step.T_odom_base)
        if not found or found[0].margin < self._settings.margin:
            self.withheld += bool(found)
            return
        self._try(found[0])

    def _try(self, found: Found) -> None:
        std = np.array([0.1, 0.1, math.radians(1.0)])
        height = self._placer.height_m(found.pose[0], found.pose[1], found.height_m)
        self._tracker = Tracker(self._walls, self._settings, found.pose, np.diag(std**2), height)
        self._trial = _Trial(self._travelled_m, found.margin)
        self._status, self._probability = CANDIDATE, min(max(found.margin, 0.0), 1.0)
        self._supports.clear()

    def _row(self, stamp_ns: int, step: OdometryStep, source: str, latency_ms: float) -> Row:
        row = NOWHERE._replace(
            stamp_ns=stamp_ns, status=self._status, probability=self._probability, source=source, latency_ms=latency_ms
        )
        tracker = self._tracker
        if tracker is None:
            return row
        place = self._placer.at(tracker.pose, tracker.height_m, float(step.velocity[0]))
        along, across, heading = tracker.deviations.tolist()
        return row._replace(
            node=place.node,
            rho_m=place.rho_m,
            lateral_m=place.lateral_m,
            heading_rad=place.heading_rad,
            x_m=float(tracker.pose[0]),
            y_m=float(tracker.pose[1]),
            z_m=tracker.height_m,
            yaw_rad=math.remainder(float(tracker.pose[2]), 2.0 * math.pi),
            std_along_m=along,
            std_across_m=across,
            std_heading_rad=heading,
            information_along=self._information,
            next_point=place.next_point,
            next_point_m=place.next_m,
        )

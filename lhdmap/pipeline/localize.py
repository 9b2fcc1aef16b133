"""`Localizer`: messages in, where the machine is on a map out; the same object for a log and for a running machine.

messages -> MappingPipeline (odometry alone) -> steps -> MapTracker against the map's walls
-> Finder: searches in a thread of their own where the place is not known, or lost, and checks of the one that is tracked
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np

from lhdmap.config import Settings
from lhdmap.geometry import se2
from lhdmap.localization.changes import WorldChanges
from lhdmap.localization.finder import Finder
from lhdmap.localization.fixed_lag import Belief, FixedLag, LagStep, placed_row
from lhdmap.localization.method import Tracks
from lhdmap.localization.paper import PaperTracker
from lhdmap.localization.paper_nodes import PaperNodes
from lhdmap.localization.place_on_map import Placer
from lhdmap.localization.rows import CANDIDATE, LOST, NOWHERE, TRACKING, UNKNOWN, LocalizationRow
from lhdmap.localization.search import CHECK, CONFIRM, FIND, PlaceCandidate, Search
from lhdmap.localization.starting import BestStart, best_start
from lhdmap.localization.tracker import MapTracker
from lhdmap.localization.walls import MapWalls
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, Message
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.pipeline.localizer_inputs import FromOdometry
from lhdmap.pipeline.localizer_says import Fix, Where, row_of
from lhdmap.pipeline.look_near import NearLook
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.pile import PileSink

_HITS_ABOVE_M = 1.0  # hits are flat: where they are shown over the floor
_LEAST_LEFT = 0.25  # of the hits must be of walls that the map has, or nothing corrects the place
_DENIALS = 2  # checks in a row
_HELD = 1.0 / 0.02**2  # 1/m²: less along the machine, and walls hardly hold it
# Deviations (m, m, rad) of a place that a search, or a look near by, has found.
_SEARCHED_STD = np.array([0.1, 0.1, math.radians(1.0)])
_FOUND_NEAR_STD = np.array([0.15, 0.15, math.radians(1.0)])
_LEAST_SUPPORT = 0.35  # where a node's own scans tell of none


Listener = Callable[[int, OdometryStep, PlanarOdometry], None]
"""Told of each front scan: stamp, step, odometry."""


class LocalizerOptions(NamedTuple):
    """How a `Localizer` runs.

    `live`: a running machine, where nothing waits for a search; of a log each is waited for, so that the rows are the same each
    time. With `smoother` a row's pose is that of the fixed-lag smoother once the machine is some metres farther. `listener` is
    told of each front scan. `pile`: what looks for piles on the way, if anything does.
    """

    live: bool = False
    smoother: bool = False
    listener: Listener | None = None
    pile: PileSink | None = None


_AS_OF_A_LOG = LocalizerOptions()


class Localizer:
    """Takes messages by role in time order; `rows` is what it said of each front scan, `where` the newest.

    `start` (4,): x, y, yaw (rad) and height about where the machine begins, or several (K, 4) of which the first scan chooses;
    None: it is searched for. A context manager.
    """

    def __init__(
        self,
        known: KnownMap,
        settings: Settings,
        machine: Machine | None = None,
        start: FloatArray | None = None,
        options: LocalizerOptions = _AS_OF_A_LOG,
    ) -> None:
        self._lag, self._listener = FixedLag() if options.smoother else None, options.listener
        if options.pile is None:  # what lies beyond the map does not count: no loop is closed, no pile looked for
            settings = replace(settings, pile=replace(settings.pile, method="off"))
        self._settings = settings.localization
        self.pipeline = MappingPipeline(settings, machine, cloud=False, pile=options.pile, on_step=self.take)
        self._odometry = FromOdometry(self.pipeline, self._settings, settings.odometry.min_height_m)
        self._walls, self._placer = MapWalls(known.topology, known.landmarks), Placer(known.topology)
        search = known.search(self._walls, settings)
        self.world = WorldChanges(known.topology, known.sheets, self._walls)
        self._finder = Finder(search, self._settings, settings.landmarks, waits=not options.live)
        paper = self._settings.method == "paper"
        self._paper = PaperNodes(known.topology, known.landmarks, settings.landmarks) if paper else None
        self._tracker: Tracks | None = None if start is None else self._started(start)
        self._turnable = start is not None  # a waypoint's heading is its node's: the machine may face the other way
        self._starts = None if start is None or start.ndim == 1 else start
        self._status = UNKNOWN if start is None else TRACKING
        self._trial_m: float | None = None  # since where on the path a place is under trial
        self._denials = 0
        self._supports: deque[float] = deque(maxlen=self._settings.support_scans)
        self._before: FloatArray | None = None
        self._near = NearLook(self._walls)
        self._time_ns = 0
        self.digs = False  # what is seen is known to differ from the map then: a place is not given up for that
        self.start: BestStart | None = None  # which of several it was
        self._travelled_m = 0.0
        self._probability = 0.0 if start is None else 1.0
        self._information = 0.0
        self.withheld, self.lost_stretches = 0, 0
        self.first_fix: tuple[float, float] | None = None  # seconds, metres
        self._began_ns: int | None = None
        self._stamp_ns = 0
        self.rows: list[LocalizationRow] = []
        self.reasons: list[tuple[int, str]] = []  # when a place was given up, and why
        self.newest: tuple[int, FloatArray] | None = (
            None  # stamp and hits (N, 3) in `map` of the newest scan with a place
        )

    @property
    def searches(self) -> list[Search]:
        """What each search over the map said: places, their probabilities, and why none was believed."""
        return list(self._finder.searches)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Let go of what is held."""
        self._finder.close()
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

    @property
    def fix(self) -> Fix | None:
        """The newest place, whatever its status; None where there is none."""
        if self._tracker is None or self._before is None or not self.rows:
            return None
        stamp_ns, status = self.rows[-1].stamp_ns, self._status
        pose, height = self._tracker.pose.copy(), self._tracker.height_m
        return Fix(stamp_ns, status, pose, self._before.copy(), self._tracker.P.copy(), height)

    @property
    def support(self) -> float | None:
        """Share of the newest scan's hits that agreed with the walls; None before the first that was matched."""
        return self._supports[-1] if self._supports else None

    def _started(self, start: FloatArray) -> Tracks:
        std = np.array([self._settings.start_std_m] * 2 + [math.radians(self._settings.start_std_deg)])
        start = start if start.ndim == 1 else start[0]
        height = float(start[3]) if len(start) > 3 else 0.0
        return self._tracks(start[:3], std, height)

    def _tracks(self, pose: FloatArray, std: FloatArray, height_m: float) -> Tracks:
        """Return what tracks by the method of the settings from a pose (3,) with these deviations (3,)."""
        tracker = MapTracker(self._walls, self._settings, pose, np.diag(std**2), height_m)
        return tracker if self._paper is None else PaperTracker(self._paper, self._placer, tracker)

    def take(self, stamp_ns: int, step: OdometryStep, odometry: PlanarOdometry) -> None:
        """Take what the odometry says of a front scan."""
        began, waited_s = time.perf_counter(), self._finder.waited_s
        self._stamp_ns = stamp_ns
        self._began_ns = stamp_ns if self._began_ns is None else self._began_ns
        if self._before is not None:
            moved = se2.between(self._before, step.pose_odom_base)
            self._travelled_m += math.hypot(moved[0], moved[1])
            if self._tracker is not None:
                self._tracker.predict(moved, *self._odometry.motion(step, self._time_ns))
        self._time_ns = step.time_ns
        self._before = step.pose_odom_base.copy()
        predicted = self._belief()
        source, points = "", np.zeros((0, 2))
        if step.processed:
            points, front = self._odometry.hits(step, odometry, well_held=self._information > _HELD)
            told, told_front = self._of_the_map(points, front)
            self._finder.add(step.pose_odom_base, told)
            source = self._correct(told, told_front) if len(told) > _LEAST_LEFT * len(points) else "odometry"
            self._judge()
            self._look_near(stamp_ns, told)
            self._look_around(stamp_ns, step)
            if self._status == TRACKING and self.first_fix is None:
                self.first_fix = ((stamp_ns - self._began_ns) * 1e-9, self._travelled_m)
        self.rows.append(
            self._row(stamp_ns, step, source, 1e3 * (time.perf_counter() - began - self._finder.waited_s + waited_s))
        )
        if self._lag is not None:
            said = LagStep(len(self.rows) - 1, step.pose_odom_base, step.error.covariance, odometry.gyro.turn_rad)
            self._smooth(self._lag, said, predicted)
        self._set_against_the_map(stamp_ns, points)  # the place has not waited for it
        if self._listener is not None:
            self._listener(stamp_ns, step, odometry)

    def _belief(self) -> Belief | None:
        return None if self._tracker is None else Belief(self._tracker.pose.copy(), self._tracker.P.copy())

    def _smooth(self, lag: FixedLag, step: LagStep, predicted: Belief | None) -> None:
        """Hand a scan to the smoother; rewrite the rows that are final."""
        believed = self._belief()
        if believed is None or predicted is None or self._status != TRACKING:
            final = lag.restart()
        else:
            final = lag.take(step, predicted, believed)
        for one in final:
            self.rows[one.row] = placed_row(self.rows[one.row], one, self._placer)

    def _set_against_the_map(self, stamp_ns: int, points: FloatArray) -> None:
        """Note what is not as in the map, where the place is known, or was until a moment ago."""
        tracker, known = self._tracker, self._status == TRACKING
        if tracker is not None and len(points):
            in_map = se2.transform(tracker.pose, points)
            self.newest = stamp_ns, np.column_stack([in_map, np.full(len(in_map), tracker.height_m + _HITS_ABOVE_M)])
        if tracker is not None and (known or self._status == LOST):
            holds = bool(self._supports) and self._supports[-1] >= self._wanted_support()
            place = tracker.pose, tracker.height_m
            self.world.update(stamp_ns, self._travelled_m, place, points, known=known, holds=holds)

    def _of_the_map(self, points: FloatArray, front: int) -> tuple[FloatArray, int]:
        """Return the hits without those of what surely came since the map was made: they say nothing of the place."""
        if self._tracker is None or self._status != TRACKING:
            return points, front
        kept = ~self.world.stands_in(self._tracker.pose, self._tracker.height_m, points)
        return points[kept], int(kept[:front].sum())

    def _correct(self, points: FloatArray, front: int) -> str:
        tracker = self._tracker
        if tracker is None or self._status == LOST or len(points) < 10:
            return "odometry" if tracker is not None else ""
        if self._turnable:
            self._turnable = False
            if self._starts is None:
                tracker.turn_if_better(points)
            else:
                self.start = best_start(self._walls, self._starts, points)
                tracker.pose, tracker.height_m = self.start.pose.copy(), self.start.height_m
        node = self._placer.node_at(tracker.pose, tracker.height_m)
        said = tracker.correct(points, front or len(points), self._walls.quality(node))
        tracker.height_m = self._placer.height_m(tracker.pose[0], tracker.pose[1], tracker.height_m)
        self._supports.append(said.support)
        self._information = said.information_along
        return said.source if said.support > 0.0 else "odometry"

    def _judge(self) -> None:
        """Decide by the support whether the place still holds."""
        if self._tracker is None or self._status == LOST or not self._supports or self.digs:
            return
        holds = float(np.mean(self._supports)) >= self._wanted_support()
        if not holds and len(self._supports) == self._supports.maxlen:
            mean, wanted = float(np.mean(self._supports)), self._wanted_support()
            self._drop(f"the map's walls agree with {mean:.0%} of the hits, {wanted:.0%} were wanted")

    def _look_near(self, stamp_ns: int, points: FloatArray) -> None:
        """Take a lost place up again near where the odometry has carried it."""
        tracker = self._tracker
        if self._status != LOST or tracker is None:
            return
        found = self._near.look(stamp_ns, self._travelled_m, tracker, points, self._wanted_support)
        if found is not None:
            self._tracker, self._status = self._tracks(found, _FOUND_NEAR_STD, tracker.height_m), TRACKING
            self._supports.clear()

    def _wanted_support(self) -> float:
        """Return the share of hits that must agree with the walls where the machine is."""
        assert self._tracker is not None  # noqa: S101  # asked where there is one
        node = self._placer.node_at(self._tracker.pose, self._tracker.height_m)
        least = self._walls.quality(node).support_least
        return max((least if math.isfinite(least) else _LEAST_SUPPORT) - self._settings.support_drop, 0.15)

    def _drop(self, why: str) -> None:
        """Give a place up: a trial that failed, or one that was lost."""
        self.reasons.append((self._stamp_ns, why))
        self._supports.clear()
        self._denials = 0
        self._probability = 0.0
        self._finder.again()
        if self._trial_m is not None:
            self.withheld += 1
            self._trial_m, self._tracker = None, None
            self._status = UNKNOWN if self.first_fix is None else LOST
            return
        self.lost_stretches += 1
        self._near.lost(self._stamp_ns, self._travelled_m)
        self._status = LOST
        self._finder.forget()

    def _look_around(self, stamp_ns: int, step: OdometryStep) -> None:
        """Take over what a search has said, and begin the next one that is due."""
        said = self._finder.answer(stamp_ns, step.pose_odom_base)
        if said is not None and said.purpose == self._purpose:
            self._take_over(said)
        if self._trial_m is not None and self._travelled_m - self._trial_m < self._settings.confirm_m:
            return
        tracker = None if self._purpose == FIND else self._tracker
        claimed = None if tracker is None else np.append(tracker.pose, tracker.height_m)
        came = None
        if self._status == TRACKING and tracker is not None:
            pose_map_odom = se2.compose(tracker.pose, se2.inverse(step.pose_odom_base))
            came = partial(self.world.stands_in, pose_map_odom, tracker.height_m)
        self._finder.ask(self._purpose, stamp_ns, self._travelled_m, step.pose_odom_base, claimed, came)

    @property
    def _purpose(self) -> str:
        return {TRACKING: CHECK, CANDIDATE: CONFIRM}.get(self._status, FIND)

    def _take_over(self, said: Search) -> None:
        """Try the place that was found, keep or drop the one on trial, drop the tracked one that is contradicted."""
        if said.claimed is not None:
            self._probability = said.claimed.probability
        if said.purpose == FIND and not said.refused:
            self._try(said.candidates[0])
        elif said.purpose == FIND:
            self.withheld += bool(said.candidates)
        elif said.purpose == CONFIRM and said.confirms:
            self._status, self._trial_m = TRACKING, None
        elif said.purpose == CONFIRM or (self._denied_again(said) and not self.digs):
            self._drop(said.denied or said.refused or "a search finds another place")

    def _denied_again(self, said: Search) -> bool:
        """Return whether two checks in a row say that the machine is not where it is tracked: one may be of a bend or a niche.

        That another place fits counts always; that this one does not, where the walls are smooth: in others their support tells.
        """
        tells = not said.refused or self._information < _HELD
        self._denials = self._denials + 1 if said.denied and tells else 0
        return self._denials >= _DENIALS

    def _try(self, found: PlaceCandidate) -> None:
        height = self._placer.height_m(found.pose[0], found.pose[1], found.height_m)
        if self._tracker is not None:
            self.world.found(self._travelled_m, self._tracker.pose, found.pose)
        self._tracker = self._tracks(found.pose, _SEARCHED_STD, height)
        self._trial_m = self._travelled_m
        self._status, self._probability = CANDIDATE, found.probability
        self._supports.clear()

    def _row(self, stamp_ns: int, step: OdometryStep, source: str, latency_ms: float) -> LocalizationRow:
        row = NOWHERE._replace(
            stamp_ns=stamp_ns, status=self._status, probability=self._probability, source=source, latency_ms=latency_ms
        )
        tracker = self._tracker
        if tracker is None:
            return row
        place = self._placer.at(tracker.pose, tracker.height_m, float(step.velocity[0]))
        return row_of(row._replace(information_along=self._information), place, tracker)

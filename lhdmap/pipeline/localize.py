"""`Localizer`: messages in, where the machine is on a map out; the same object for a log and for a running machine.

messages -> MappingPipeline (odometry alone) -> steps -> MapTracker against the map's walls -> LocalizerRows
-> PlaceKeeper, Finder: searches in a thread of their own where the place is not known, or lost, and checks of the tracked one
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np

from lhdmap.config import Settings
from lhdmap.geometry import se2
from lhdmap.localization.changes import WorldChanges
from lhdmap.localization.finder import Finder
from lhdmap.localization.fixed_lag import FixedLag
from lhdmap.localization.rows import LOST, TRACKING, UNKNOWN, LocalizationRow
from lhdmap.localization.search import Search
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray, Message
from lhdmap.odometry.planar import PlanarOdometry
from lhdmap.odometry.steps import OdometryStep
from lhdmap.pipeline.known_map import KnownMap
from lhdmap.pipeline.localizer_inputs import FromOdometry
from lhdmap.pipeline.localizer_rows import LocalizerRows
from lhdmap.pipeline.localizer_says import Fix, Where
from lhdmap.pipeline.localizer_start import StartChoice
from lhdmap.pipeline.mapping import MappingOptions, MappingPipeline
from lhdmap.pipeline.pile import PileSink
from lhdmap.pipeline.place_held import HeldPlace, LocalizationFacts
from lhdmap.pipeline.place_keeper import PlaceKeeper
from lhdmap.pipeline.tracks_on_map import TracksOnMap
from lhdmap.pipeline.way_driven import WayDriven

_HITS_ABOVE_M = 1.0  # hits are flat: where they are shown over the floor
_FEWEST_HITS = 10  # three unknowns, and walls to two sides at least: fewer hits are dust
_BESIDE_M = 2.0  # of `base_link`: hits farther ahead of a machine that digs are its pile's, which the map has as it was
_LEAST_LEFT = 0.25  # of the hits must be of walls that the map has, or nothing corrects the place


Listener = Callable[[int, OdometryStep, PlanarOdometry], None]
"""Told of each front scan: stamp, step, odometry."""


class LocalizerOptions(NamedTuple):
    """How a `Localizer` runs.

    `live`: a running machine, where nothing waits for a search; of a log each is waited for, so that the rows are the same each
    time. With `smoother` a row's pose is that of the fixed-lag smoother once the machine is some metres farther. `listener` is
    told of each front scan. `pile`: what looks for piles on the way, if anything does. `newest_only`: nobody asks for more
    than the newest row (without `smoother`): nothing of the drive is kept, and changes of the world are not counted.
    """

    live: bool = False
    smoother: bool = False
    listener: Listener | None = None
    pile: PileSink | None = None
    newest_only: bool = False


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
        if options.pile is None:  # what lies beyond the map does not count: no loop is closed, no pile looked for
            settings = replace(settings, pile=replace(settings.pile, method="off"))
        own = settings.localization
        mapping = MappingOptions(cloud=False, pile=options.pile, on_step=self.take, kept=not options.newest_only)
        self.pipeline, self._listener = MappingPipeline(settings, machine, mapping), options.listener
        self._odometry = FromOdometry(self.pipeline, own, settings.odometry.min_height_m)
        self._on_map = on_map = TracksOnMap(known, settings)
        self.world = WorldChanges(known.topology, known.sheets, on_map.walls, told=not options.newest_only)
        search = known.search(on_map.walls, settings)
        self._finder = Finder(search, own, settings.landmarks, waits=not options.live)
        self._start = StartChoice(on_map.walls, start)
        self._place = HeldPlace(None if start is None else on_map.begun(start), own.support_scans)
        self._way = WayDriven()
        self.keeper = PlaceKeeper(self._place, on_map, self._finder, self.world, self._way, own.confirm_m)
        lag = FixedLag() if options.smoother else None
        self._told = LocalizerRows(on_map.placer, lag, newest_only=options.newest_only)
        # Stamp and hits (N, 3) in `map` of the newest scan with a place.
        self.newest: tuple[int, FloatArray] | None = None

    @property
    def rows(self) -> list[LocalizationRow]:
        """What was said of each front scan; with `newest_only` of the newest."""
        return self._told.rows

    @property
    def facts(self) -> LocalizationFacts:
        """What was counted over the drive."""
        return self._place.facts

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
        self._told.finish()

    def pose_at(self, now_ns: int) -> Where:
        """Return where the machine is now: the newest place carried on as the odometry is (`MappingPipeline.pose_at`)."""
        tracker, status, before = self._place.tracker, self._place.status, self._way.pose
        now = self.pipeline.pose_at(now_ns)
        if tracker is None or now is None or before is None or status in (UNKNOWN, LOST):
            return Where(status, None, None)
        planar = np.array([now.T_odom_base[0, 3], now.T_odom_base[1, 3], math.atan2(*now.T_odom_base[[1, 0], 0])])
        pose = se2.compose(tracker.pose, se2.between(before, planar))
        return Where(status, np.array([pose[0], pose[1], tracker.height_m, pose[2]]), tracker.P)

    @property
    def fix(self) -> Fix | None:
        """The newest place, whatever its status; None where there is none."""
        tracker, before = self._place.tracker, self._way.pose
        if tracker is None or before is None or not self.rows:
            return None
        pose, height = tracker.pose.copy(), tracker.height_m
        return Fix(self.rows[-1].stamp_ns, self._place.status, pose, before.copy(), tracker.P.copy(), height)

    @property
    def support(self) -> float | None:
        """Share of the newest scan's hits that agreed with the walls; None before the first that was matched."""
        return self._place.support.newest

    def take(self, stamp_ns: int, step: OdometryStep, odometry: PlanarOdometry) -> None:
        """Take what the odometry says of a front scan."""
        began, waited_s, place = time.perf_counter(), self._finder.waited_s, self._place
        moved, since_ns = self._way.go_on(stamp_ns, step)
        if moved is not None and place.tracker is not None:
            place.tracker.predict(*self._odometry.motion(moved, step, since_ns))
        predicted = place.belief
        source, points = "", np.zeros((0, 2))
        if step.processed:
            points, front = self._odometry.hits(step, odometry, well_held=place.support.well_held)
            source = self._match(step, points, front)
        latency_ms = 1e3 * (time.perf_counter() - began - self._finder.waited_s + waited_s)
        self._told.add(stamp_ns, place, step, source, latency_ms)
        self._told.smooth(step, odometry.gyro.turn_rad, predicted, place)
        self._set_against_the_map(stamp_ns, points)  # the place has not waited for it
        if self._listener is not None:
            self._listener(stamp_ns, step, odometry)

    def _match(self, step: OdometryStep, points: FloatArray, front: int) -> str:
        """Correct the place by hits (N, 2), judge it, look for it where it is not known; return what corrected it."""
        told, told_front = self._of_the_map(points, front)
        self._finder.add(step.pose_odom_base, told)
        source = self._correct(told, told_front) if len(told) > _LEAST_LEFT * len(points) else "odometry"
        self.keeper.judge()
        self.keeper.look_near(told)
        self.keeper.look_around(step)
        if self._place.status == TRACKING and self.facts.first_fix is None:
            self.facts.first_fix = self._way.since_start
        return source

    def _set_against_the_map(self, stamp_ns: int, points: FloatArray) -> None:
        """Note what is not as in the map, where the place is known, or was until a moment ago."""
        tracker, known = self._place.tracker, self._place.status == TRACKING
        if tracker is not None and len(points):
            in_map = se2.transform(tracker.pose, points)
            self.newest = stamp_ns, np.column_stack([in_map, np.full(len(in_map), tracker.height_m + _HITS_ABOVE_M)])
        if tracker is not None and (known or self._place.status == LOST):
            support = self.support
            holds = support is not None and support >= self._on_map.wanted_support(tracker)
            place = tracker.pose, tracker.height_m
            self.world.update(stamp_ns, self._way.travelled_m, place, points, known=known, holds=holds)

    def _of_the_map(self, points: FloatArray, front: int) -> tuple[FloatArray, int]:
        """Return the hits without those of what came since the map was made, or of a pile: they say nothing of the place."""
        tracker = self._place.tracked
        if tracker is None:
            return points, front
        kept = ~self.world.stands_in(tracker.pose, tracker.height_m, points)
        if self.keeper.digs:
            kept &= points[:, 0] < _BESIDE_M
        return points[kept], int(kept[:front].sum())

    def _correct(self, points: FloatArray, front: int) -> str:
        """Correct the place by hits (N, 2) of the map's walls, the first `front` of the front scanner; return what did."""
        tracker, on_map = self._place.tracker, self._on_map
        if tracker is None or self._place.status == LOST or len(points) < _FEWEST_HITS:
            return "odometry" if tracker is not None else ""
        self._start.choose(tracker, points)
        said = tracker.correct(points, front or len(points), on_map.quality(tracker))
        tracker.height_m = on_map.height_m(tracker.pose, tracker.height_m)
        if said.support < on_map.wanted_support(tracker):
            told = self.keeper.support_told(said.support, tracker.pose, tracker.height_m, points)
            said = said._replace(support=told)
        self._place.support.add(said)
        return said.source if said.support > 0.0 else "odometry"

"""Looks on while the stages run: pose, latency, what was odd; told at an interval, and kept as figures."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

from lhdmap.live.inbox import Inbox
from lhdmap.live.latency import Latency
from lhdmap.logs.source import LogSource
from lhdmap.messages import FloatArray, LaserScan, Message, PointCloud
from lhdmap.pipeline.localize import Localizer
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.track import Track

_SAME_CLOCK_NS = 60_000_000_000  # stamps that are farther from now are of another clock, or of an old log
_SETTLED = 5  # messages that may wait once what was received during the start has been worked off


class Status(NamedTuple):
    """What is told at an interval.

    `pose`: x, y, z (m), heading (rad) in `odom`, or in `map` where it is known there; None before the first. `weak_share`: of the
    processed scans; `weak`: whether the newest is; `place`: of a localizer; `latency_ms`: of the newest pose, NaN where stamps are
    of another clock.
    """

    elapsed_s: float
    pose: tuple[float, float, float, float] | None
    frame: str
    place: str
    scans: int
    distance_m: float
    weak: bool
    weak_share: float
    lost_stretches: int
    waiting: int
    dropped: int
    missed: int
    gaps: int
    reconnects: int
    pile: str
    latency_ms: float


class Watch:
    """Goes through the messages as they come; `show` is called with a status at an interval, `say` with what happened."""

    def __init__(
        self,
        inbox: Inbox,
        show: Callable[[Status], None],
        interval_s: float,
        now_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._inbox, self._show, self._interval_s, self._now_ns = inbox, show, interval_s, now_ns
        self._began_s = self._shown_s = time.monotonic()
        self.pose_latency, self.scan_latency = Latency(), Latency()
        self.caught_up_s: float | None = None
        self._stages: MappingPipeline | Localizer | None = None
        self._source: LogSource | None = None
        self._steps = 0
        self._last_track_ns: int | None = None
        self._distance_m = 0.0
        self._at_m: tuple[float, ...] | None = None
        self._pile = ""

    def through(
        self, source: LogSource, messages: Iterable[tuple[str, Message]], stages: MappingPipeline | Localizer
    ) -> Iterator[tuple[str, Message]]:
        """Yield the messages; each has been taken by the stages when the next is asked for."""
        self._stages, self._source = stages, source
        primary = "front" if _pipeline(stages).clouds is None else "points"
        for role, message in messages:
            yield role, message
            if role == primary and isinstance(message, (LaserScan, PointCloud)):
                self._scan_done(stages, message.stamp_ns)
            self.look()
        self._tell()

    def look(self) -> None:
        """Tell the status where it is time to; called also while nothing comes."""
        now_s = time.monotonic()
        if now_s - self._shown_s < self._interval_s:
            return
        self._tell()

    def _tell(self) -> None:
        """Tell what was odd since the last time, and the status."""
        self._shown_s = time.monotonic()
        steps = [] if self._source is None else self._source.clock_steps
        for step in steps[self._steps :]:
            start_ns = None if self._source is None else self._source.start_ns
            self._inbox.say(step.text(start_ns or 0))
        self._steps = len(steps)
        self._show(self.status())

    def status(self) -> Status:
        """Return how things are."""
        tally, stages = self._inbox.tally, self._stages
        counts = len(self._inbox), tally.dropped.total(), tally.missed.total(), tally.gaps, tally.reconnects
        elapsed_s, late_ms = time.monotonic() - self._began_s, self.pose_latency.last_ms
        if stages is None:
            return Status(elapsed_s, None, "odom", "", 0, 0.0, False, 0.0, 0, *counts, "", math.nan)
        pipeline = _pipeline(stages)
        records, place = pipeline.records, _place(stages)
        seen = records.scans, self._distance_m, records.weak_now, records.degenerate_share, records.lost_stretches
        pose, frame = _newest(stages)
        return Status(elapsed_s, pose, frame, place, *seen, *counts, self._pile, late_ms)

    def figures(self) -> dict[str, Any]:
        """Return what `--json` prints of the stream.

        `pose`: from the stamp of a scan to the pose of that time, carried on by the sensors; `scan`: until the scan itself is
        matched, and its pose final in odometry. Counted once the messages of the start were worked off.
        """
        tally = self._inbox.tally
        return {
            "messages": tally.messages,
            "bytes": tally.bytes,
            "dropped": dict(tally.dropped),
            "missed": dict(tally.missed),
            "gaps": tally.gaps,
            "longest_gap_s": tally.longest_gap_s,
            "reconnects": tally.reconnects,
            "backlogs_given_up": tally.backlogs,
            "clock_steps": 0 if self._source is None else len(self._source.clock_steps),
            "caught_up_s": self.caught_up_s,
            "latency": {"pose": self.pose_latency.to_json(), "scan": self.scan_latency.to_json()},
        }

    def _scan_done(self, stages: MappingPipeline | Localizer, stamp_ns: int) -> None:
        """Note how late the pose of a scan is, and that of the newest one that is matched."""
        stages.pose_at(stamp_ns)
        now_ns = self._now_ns()
        self._go_on(_pipeline(stages).track)
        if abs(now_ns - stamp_ns) > _SAME_CLOCK_NS:
            return
        if self.caught_up_s is None:
            if len(self._inbox) > _SETTLED:
                return
            self.caught_up_s = time.monotonic() - self._began_s
        self.pose_latency.add((now_ns - stamp_ns) * 1e-6)
        last_ns = _pipeline(stages).track.last_ns
        if last_ns is not None and last_ns != self._last_track_ns:
            self._last_track_ns = last_ns
            self.scan_latency.add((now_ns - last_ns) * 1e-6)

    def _go_on(self, track: Track) -> None:
        """Add up the way."""
        if track.last_ns is not None:
            at_m = track.newest[:3]
            self._distance_m += 0.0 if self._at_m is None else math.dist(self._at_m, at_m)
            self._at_m = at_m


def _pipeline(stages: MappingPipeline | Localizer) -> MappingPipeline:
    return stages.pipeline if isinstance(stages, Localizer) else stages


def _place(stages: MappingPipeline | Localizer) -> str:
    if not isinstance(stages, Localizer) or not stages.rows:
        return ""
    return stages.rows[-1].status


def _newest(stages: MappingPipeline | Localizer) -> tuple[tuple[float, float, float, float] | None, str]:
    """Return the newest pose and its frame."""
    track = _pipeline(stages).track
    if track.last_ns is None:
        return None, "odom"
    if isinstance(stages, Localizer):
        where: FloatArray | None = stages.pose_at(track.last_ns).pose
        if where is not None:
            x, y, z, yaw = (float(value) for value in where)
            return (x, y, z, yaw), "map"
    x, y, z, _, _, heading = track.newest
    return (x, y, z, heading), "odom"

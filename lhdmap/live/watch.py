"""Looks on while the stages run: pose, latency, what was odd; told at an interval, and kept as figures."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

from lhdmap.live.inbox import Inbox
from lhdmap.live.lateness import Lateness
from lhdmap.live.pile_now import PileNow
from lhdmap.logs.source import LogSource
from lhdmap.messages import LaserScan, Message, PointCloud
from lhdmap.pipeline.localize import Localizer
from lhdmap.pipeline.mapping import MappingPipeline
from lhdmap.pipeline.track import Track


class Status(NamedTuple):
    """What is told at an interval.

    `pose`: x, y, z (m), heading (rad) in `frame`, None before the first; `place`: what a localizer says of it. `weak_share`: of
    the processed scans; `weak`: whether the newest is. `latency_ms`: of the newest pose, NaN where stamps are of another clock.
    `dropped` to `reconnects`: as in `Tally`; `waiting`: messages in the queue.
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
    """Goes through the messages as they come; `show` is called with a status at an interval."""

    def __init__(self, inbox: Inbox, show: Callable[[Status], None], interval_s: float) -> None:
        self._inbox, self._show, self._interval_s = inbox, show, interval_s
        self._began_s = self._shown_s = time.monotonic()
        self._lateness, self._way, self._pile = Lateness(), _Way(), PileNow()
        self._stages: MappingPipeline | Localizer | None = None
        self._source: LogSource | None = None
        self._steps = 0

    def through(
        self, source: LogSource, messages: Iterable[tuple[str, Message]], stages: MappingPipeline | Localizer
    ) -> Iterator[tuple[str, Message]]:
        """Yield the messages; each has been taken by the stages when the next is asked for."""
        self._stages, self._source = stages, source
        pipeline = _pipeline(stages)
        primary = "front" if pipeline.clouds is None else "points"
        try:
            for role, message in messages:
                yield role, message
                if role == primary and isinstance(message, (LaserScan, PointCloud)):
                    stages.pose_at(message.stamp_ns)
                    self._lateness.take(message.stamp_ns, pipeline.track.last_ns, len(self._inbox))
                    self._way.go_on(pipeline.track)
                self.look()
        finally:
            self._pile.close()
        self._tell()

    def look(self) -> None:
        """Tell the status where it is time to; called also while nothing comes."""
        if time.monotonic() - self._shown_s >= self._interval_s:
            self._pile.look(self._stages)
            self._tell()

    def status(self) -> Status:
        """Return how things are."""
        tally, stages = self._inbox.tally, self._stages
        counts = len(self._inbox), tally.dropped.total(), tally.missed.total(), tally.gaps, tally.reconnects
        elapsed_s = time.monotonic() - self._began_s
        if stages is None:
            return Status(elapsed_s, None, "odom", "", 0, 0.0, False, 0.0, 0, *counts, "", math.nan)
        records = _pipeline(stages).records
        seen = records.scans, self._way.distance_m, records.weak_now, records.degenerate_share, records.lost_stretches
        place = stages.rows[-1].status if isinstance(stages, Localizer) and stages.rows else ""
        pose, frame = _newest(stages)
        return Status(elapsed_s, pose, frame, place, *seen, *counts, self._pile.words, self._lateness.pose.last_ms)

    def figures(self) -> dict[str, Any]:
        """Return what `--json` prints of the stream."""
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
            "caught_up_s": self._lateness.caught_up_s,
            "latency": self._lateness.to_json(),
        }

    def _tell(self) -> None:
        """Tell what was odd since the last time, and the status."""
        self._shown_s = time.monotonic()
        if self._source is not None:
            steps = self._source.clock_steps
            for step in steps[self._steps :]:
                self._inbox.say(step.text(self._source.start_ns or 0))
            self._steps = len(steps)
        self._show(self.status())


class _Way:
    """Adds up how far the machine has come, from scan to scan."""

    def __init__(self) -> None:
        self.distance_m = 0.0
        self._at_m: tuple[float, ...] | None = None

    def go_on(self, track: Track) -> None:
        if track.last_ns is not None:
            at_m = track.newest[:3]
            self.distance_m += 0.0 if self._at_m is None else math.dist(self._at_m, at_m)
            self._at_m = at_m


def _pipeline(stages: MappingPipeline | Localizer) -> MappingPipeline:
    return stages.pipeline if isinstance(stages, Localizer) else stages


def _newest(stages: MappingPipeline | Localizer) -> tuple[tuple[float, float, float, float] | None, str]:
    """Return the newest pose and its frame."""
    track = _pipeline(stages).track
    if track.last_ns is None:
        return None, "odom"
    if isinstance(stages, Localizer):
        where = stages.pose_at(track.last_ns).pose
        if where is not None:
            x, y, z, yaw = (float(value) for value in where)
            return (x, y, z, yaw), "map"
    x, y, z, _, _, heading = track.newest
    return (x, y, z, heading), "odom"

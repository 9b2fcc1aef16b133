"""Who drives on a surface site: what the executive orders, tracked; commands to the machine."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lhdmap.driving.motion import Setpoint, Setpoints
from lhdmap.messages import Command
from lhdmap.replay.journal import Scribe
from lhdmap.replay.process import MILLISECOND_NS, NAVIGATING, ORDERS, WAY, Outgoing, Process, Received
from lhdmap.replay.processes.site_feed import SITE_TOPICS, SiteFeed
from lhdmap.replay.processes.told import Navigating, Orders, WayNow
from lhdmap.replay.site_drive import DRIVING, SiteDrive
from lhdmap.replay.site_sight import SiteSight
from lhdmap.roles import ROLES
from lhdmap.tracking.tracker import Tracker

SITE_DRIVER = "driver"
COMMAND, POINTS = ROLES["command"].topic, ROLES["points"].topic
BLOCKED = "blocked"
_TRACK_NS = 50 * MILLISECOND_NS
_AHEAD_NS = 100 * MILLISECOND_NS
_KEPT = 120


class SiteDriver(Process):
    """Commands each 25 ms, the tracker each 50 ms."""

    name, period_ns, latency_ns, priority = SITE_DRIVER, 25 * MILLISECOND_NS, 2 * MILLISECOND_NS, 20
    reads = (*SITE_TOPICS, POINTS, ORDERS)

    def __init__(self, drive: SiteDrive, tracker: Tracker, sight: SiteSight, top_mps: float, scribe: Scribe) -> None:
        self._drive, self._tracker, self._sight, self._top_mps, self._scribe = drive, tracker, sight, top_mps, scribe
        self._feed, self._orders, self._number = SiteFeed(), Orders(0, 0, "", loaded=False), 0
        self._sent: list[Setpoint] = []
        self._points: Setpoints = ()
        self._stepped_ns, self._told = 0, (0, False)

    def step(self, now_ns: int, inbox: Sequence[Received]) -> Iterator[Outgoing]:
        """Take what has come; drive."""
        for received in inbox:
            if received.topic == ORDERS:
                self._orders = received.message
            elif received.topic == POINTS:
                if self._feed.motion is not None:
                    self._sight.take(received.message, self._feed.motion)
            else:
                self._feed.take(received)
        if now_ns - self._stepped_ns >= _TRACK_NS and self._feed.motion is not None:
            self._stepped_ns = now_ns
            yield from self._track(now_ns)
        if self._points:
            yield Outgoing(COMMAND, self._command(now_ns))

    def _track(self, now_ns: int) -> Iterator[Outgoing]:
        drive, orders, motion = self._drive, self._orders, self._feed.motion
        assert motion is not None  # noqa: S101  # asked for by the caller
        if orders.number != self._number and orders.goal and self._tracker.filter.known:
            self._number = orders.number
            drive.begin(orders.goal, loaded=orders.loaded)
        step = drive.step(now_ns, motion, self._sent)
        self._points = step.setpoints
        state = BLOCKED if drive.blocked(self._sight) else drive.state
        self._scribe.goes(state, drive.reason, goal=drive.goal)
        told = self._number, drive.docks
        if told != self._told and drive.state == DRIVING:
            self._told = told
            self._scribe.event("dock" if drive.docks else "way", drive.goal, edges=len(drive.edges))
            yield Outgoing(WAY, WayNow(now_ns, drive.edges, drive.docks))
        yield Outgoing(NAVIGATING, Navigating(now_ns, state, self._number, drive.goal, drive.reason, step.left_m))

    def _command(self, now_ns: int) -> Command:
        """Return the command of now, the drive's lag fed forward; the brakes hold a machine that is to stand."""
        speed, rate = _at(self._points, now_ns)
        later, _ = _at(self._points, now_ns + _AHEAD_NS)
        orders, stands = self._orders, self._stops() or (speed == 0.0 and later == 0.0)
        speed += self._tracker.model.drive_lag_s * (later - speed) / (_AHEAD_NS * 1e-9)
        if stands:
            speed, rate = 0.0, 0.0
        self._sent.append(Setpoint(now_ns + self.latency_ns, speed, rate))
        del self._sent[:-_KEPT]
        tilt, lift = -1.0 if orders.dumping and stands else 0.0, 1.0 if orders.loading and stands else 0.0
        return Command(now_ns, speed / self._top_mps, rate, tilt, lift, False, stands)

    def _stops(self) -> bool:
        """Return whether the machine is to stand whatever the tracker says."""
        return not self._orders.goal or self._sight.stops


def _at(points: Setpoints, at_ns: int) -> tuple[float, float]:
    """Return speed and rate at a time, interpolated."""
    before = points[0]
    for point in points:
        if point.at_ns > at_ns:
            span = point.at_ns - before.at_ns
            share = min(max((at_ns - before.at_ns) / span, 0.0), 1.0) if span > 0 else 1.0
            speed = before.speed_mps + share * (point.speed_mps - before.speed_mps)
            return speed, before.steering_rate_rps + share * (point.steering_rate_rps - before.steering_rate_rps)
        before = point
    return before.speed_mps, before.steering_rate_rps

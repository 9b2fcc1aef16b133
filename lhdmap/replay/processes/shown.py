"""What an attendant is shown of a machine: its state, where it is on its plan, the open request with its evidence."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.console.messages import Ask, Plan, Points, Pose, Status
from lhdmap.geometry import se2
from lhdmap.loading.assistance import Request
from lhdmap.messages import FloatArray
from lhdmap.navigation.along import Located
from lhdmap.pile.result import Snapshot
from lhdmap.pipeline.pose_now import PoseNow
from lhdmap.replay.parts import Parts
from lhdmap.replay.process import LOADING, LOCATED, MACHINE_SAYS, MISSION, PILE, POSE, SEEN, Received
from lhdmap.replay.processes.told import Health, LoadingNow, Seen
from lhdmap.simulation.history import SECOND_NS, START_NS

READS = (MACHINE_SAYS, POSE, LOCATED, SEEN, PILE, LOADING, MISSION)
_HITS = 500  # enough to see walls and pile by
_ASKS = "see to it that the machine can go on, then say so; or abort"
_PREFIX = "assistance: "


class _RequestNumbers:
    """Counts the open requests of a run, of the loading task and of navigation alike."""

    def __init__(self) -> None:
        self.count = 0
        self._open, self._ended = "", ""

    def key(self, request: Request | None, asks: str) -> str:
        """Return what tells a request from others; empty where none is open."""
        if request is not None:
            self._ended = request.why
            return f"{request.number}: {request.why}"
        if asks == self._ended:
            return ""  # what the machine says is a little older than what the task says
        self._ended = ""
        return asks

    def is_new(self, key: str) -> bool:
        """Return whether it is another one than before, which is counted then."""
        new = key != self._open
        if new:
            self._open = key
            self.count += bool(key)
        return new


class Shown:
    """Takes the machine's messages; of the simulator's truth it gets nothing."""

    def __init__(self, *, on_map: bool) -> None:
        self.health: Health | None = None
        self.loading: LoadingNow | None = None
        self._on_map, self._mission = on_map, ""
        self._pose: PoseNow | None = None
        self._located: Located | None = None
        self._seen: Seen | None = None
        self._pile: Snapshot | None = None
        self._numbers = _RequestNumbers()
        self.task_number = 0  # of the open request, as the loading task counts; 0: it is navigation's
        self._ask: Ask | None = None

    def take(self, received: Received) -> None:
        """Take a message of one of the topics in `READS`."""
        topic, _, message = received
        if topic == MACHINE_SAYS:
            self.health = message
        elif topic == POSE:
            self._pose = message
        elif topic == LOCATED:
            self._located = message
        elif topic == SEEN:
            self._seen = message
        elif topic == PILE:
            self._pile = message
        elif topic == LOADING:
            self.loading = message
        else:
            self._mission = message.text

    def status(self, now_ns: int) -> Status:
        """Return what the machine is and does."""
        health, time_s = self.health, (now_ns - START_NS) / SECOND_NS
        doing = "" if self.loading is None else self.loading.state
        if health is None:
            return Status(time_s, False, "", False, (), self._mission, doing, self._place())
        return Status(
            time_s, health.armed, health.mode, health.standing, health.causes, self._mission, doing, self._place()
        )

    def request(self) -> Ask | None:
        """Return the open request: the loading task's, else what navigation asks for. Its number is that of this run."""
        request = None if self.loading is None else self.loading.request
        asks = "" if self.health is None else self.health.asks.removeprefix(_PREFIX)
        key = self._numbers.key(request, asks)
        if self._numbers.is_new(key):
            self.task_number = 0 if request is None else request.number
            self._ask = self._ask_of(request, asks) if key else None
        return self._ask

    def _ask_of(self, request: Request | None, asks: str) -> Ask:
        hits, pile = self._hits(), self._toe()
        if request is None:
            return Ask(self._numbers.count, "navigation", self._mission, asks, _ASKS, cloud_m=hits, pile_m=pile)
        evidence = tuple(
            (name, value if isinstance(value, str) else f"{value:.4g}") for name, value in request.evidence.items()
        )
        told = (request.kind, request.during, request.why, request.asks, request.tried)
        return Ask(self._numbers.count, *told, evidence, hits, pile)

    def _place(self) -> Pose | None:
        """Return the pose of now (x, y, heading) on the plan."""
        if self._pose is None:
            return None
        pose = _planar(self._pose.T_odom_base)
        if self._on_map:
            if self._located is None or self._located.status != "tracking":
                return None
            pose = se2.compose(se2.inverse(self._located.pose_odom_map), pose)
        x, y, heading = (round(value, 4) for value in pose.tolist())
        return (x, y, heading) if all(map(math.isfinite, (x, y, heading))) else None

    def _hits(self) -> Points:
        return () if self._seen is None else points_of(self._seen.points_m, _HITS)

    def _toe(self) -> Points:
        if self._pile is None or self._pose is None or not len(self._pile.estimate.toe_m):
            return ()
        T_base_odom = se2.inverse(_planar(self._pose.T_odom_base))
        return points_of(se2.transform(T_base_odom, self._pile.estimate.toe_m[:, :2]), _HITS)


def points_of(points_m: FloatArray, most: int) -> Points:
    """Return points (N, 2) thinned to `most`, centimetres kept, without those that are not finite."""
    kept = points_m[np.isfinite(points_m).all(axis=1)]
    kept = kept[:: max(1, math.ceil(len(kept) / most))]
    return tuple((round(x, 2), round(y, 2)) for x, y in kept[:, :2].tolist())


def plan_of(parts: Parts) -> Plan:
    """Return what the machine knows to be drawn on: centre lines and places of its map, or the way that it was taught."""
    if parts.autonomous is not None:
        topology = parts.autonomous.known.topology
        lines = [points_of(tunnel.line_m[:, :2], 200) for tunnel in topology.tunnels]
        lines += [points_of(one.outline_m, 60) for one in topology.intersections]
        places = tuple((one.name or one.id, float(one.pose[0]), float(one.pose[1])) for one in topology.waypoints)
        return Plan("map", tuple(lines), places)
    way = None if parts.loading is None else parts.loading.way
    lines = [] if way is None else [points_of(way.path[:, :2], 200)]
    return Plan("odom", tuple(lines))


def _planar(T_odom_base: FloatArray) -> FloatArray:
    """Return a pose (4, 4) as (3,): x, y, heading."""
    return np.array([*T_odom_base[:2, 3], math.atan2(T_odom_base[1, 0], T_odom_base[0, 0])])

"""What a machine that drives itself plans and believes, as the film sees it: beside the truth, and in its frame.

The map is aligned with the truth once, where the machine stands at the start, and for the picture alone. Plans are drawn from
where the machine truly is.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from typing import Any

import numpy as np

from lhdmap.geometry import se2
from lhdmap.guidance.directive import WAY, Directive, moved
from lhdmap.guidance.planner import Plan
from lhdmap.messages import FloatArray
from lhdmap.navigation.control import Located
from lhdmap.replay.parts import State
from lhdmap.replay.process import DIRECTIVE, LOCATED, PLAN, POSE
from lhdmap.replay.series import Series
from lhdmap.report.replay_data import PLACE_COLUMNS, PLAN_COLUMNS, DriveData
from lhdmap.report.route_legs import Leg
from lhdmap.simulation.history import SECOND_NS, START_NS
from lhdmap.topology.carried import carried
from lhdmap.topology.model import TopologicalMap

TOPICS = (POSE, LOCATED, DIRECTIVE, PLAN)
_EACH_NS = SECOND_NS // 5
_ABOVE_M = 0.4
_KEPT = 400  # true states: four seconds
_MOST_HORIZONS, _MOST_LEGS, _MOST_FIXES = 300, 500, 100
_ON_PATH_M = 0.05


class Truth:
    """The true poses (x, y, z, yaw) of the last seconds."""

    def __init__(self) -> None:
        self._times: list[int] = []
        self._rows: list[tuple[float, float, float, float]] = []

    def add(self, state: State) -> None:
        """Take a state."""
        self._times.append(state.time_ns)
        self._rows.append((state.x_m, state.y_m, state.z_m, state.yaw_rad))
        if len(self._times) > 2 * _KEPT:
            del self._times[:_KEPT], self._rows[:_KEPT]

    def at(self, time_ns: int) -> FloatArray | None:
        """Return the pose (4,) at a time; None before and after what is known."""
        k = bisect_left(self._times, time_ns)
        if k == len(self._times) or (k == 0 and self._times[0] != time_ns):
            return None
        if self._times[k] == time_ns:
            return np.array(self._rows[k])
        before, after = np.array(self._rows[k - 1]), np.array(self._rows[k])
        turn = math.remainder(after[3] - before[3], 2.0 * math.pi)
        share = (time_ns - self._times[k - 1]) / (self._times[k] - self._times[k - 1])
        pose: FloatArray = before + share * np.array([*(after[:3] - before[:3]), turn])
        return pose


class DriveFilm:
    """Takes true states and messages of `TOPICS`; `look` gives each 0.2 s what is to be drawn of the newest plan."""

    def __init__(self, topology: TopologicalMap | None) -> None:
        self._topology = topology
        self.truth = Truth()
        self.map: TopologicalMap | None = None
        self.planned_mps = self.predicted_m = math.nan
        self._plans, self._places = Series(len(PLAN_COLUMNS)), Series(len(PLACE_COLUMNS))
        self._limits: dict[str, int] = {}
        self._horizons, self._looked_ns = _Thinned(_MOST_HORIZONS), 0
        self._fixes: list[tuple[FloatArray, Located]] = []
        self._T_true_map: FloatArray | None = None
        self._T_true_odom: FloatArray | None = None
        self._located: Located | None = None
        self._legs: list[tuple[str, list[FloatArray]]] = []
        self._leg: tuple[int, float] = (0, 0.0)
        self._along_m = -math.inf
        self._plan: Plan | None = None

    def take(self, topic: str, message: Any) -> None:
        """Take a message."""
        if topic == POSE:
            self._pose(message.stamp_ns, message.T_odom_base)
        elif topic == LOCATED:
            self._place(message)
        elif topic == DIRECTIVE and message.directive is not None:
            self._ask(message.directive)
        elif topic == PLAN:
            self._plan = message if isinstance(message, Plan) else None
            self.planned_mps = self.predicted_m = math.nan
            if self._plan is not None:
                self.planned_mps = self._plan.gear * float(self._plan.speeds.speed_mps[0])
                self.predicted_m = self._plan.clearance_m

    def look(self, now_ns: int, pitch_rad: float) -> FloatArray | None:
        """Return the way (K, 3) that is predicted now, where one is due; empty where nothing is planned any more."""
        if now_ns - self._looked_ns < _EACH_NS:
            return None
        self._looked_ns = now_ns
        plan, here = self._plan, self.truth.at(now_ns)
        if plan is None or here is None or self._T_true_odom is None:
            return np.empty((0, 3))
        limit = self._limits.setdefault(plan.speeds.by, len(self._limits))
        time_s = (now_ns - START_NS) / SECOND_NS
        self._plans.add((time_s, self.planned_mps, plan.clearance_m, plan.speeds.sight_m, float(limit)))
        way = se2.transform(self._T_true_odom, np.ascontiguousarray(plan.solution.states[:, :2]))
        ahead = (way - here[:2]) @ np.array([math.cos(here[3]), math.sin(here[3])])
        line = np.column_stack([way, here[2] + _ABOVE_M - math.sin(pitch_rad) * ahead])
        self._horizons.add(line)
        return line

    def leg(self) -> Leg | None:
        """Return the leg that is driven, as far as it has been asked for."""
        legs = self._drawn_legs(self._legs[-1:])
        return legs[0] if legs else None

    def data(self) -> DriveData:
        """Return all of it."""
        rows, places = self._plans.rows(), self._places.rows()
        return DriveData(self.map, self._drawn_legs(self._legs), rows, tuple(self._limits), self._horizons.kept, places)

    def _pose(self, stamp_ns: int, T_odom_base: FloatArray) -> None:
        true = self.truth.at(stamp_ns)
        if true is not None:
            heading = math.atan2(T_odom_base[1, 0], T_odom_base[0, 0])
            believed = np.array([T_odom_base[0, 3], T_odom_base[1, 3], heading])
            self._T_true_odom = se2.compose(true[[0, 1, 3]], se2.inverse(believed))

    def _place(self, located: Located) -> None:
        self._located = located
        true = self.truth.at(located.stamp_ns)
        if true is None or located.status == "lost":
            return
        if self._T_true_map is None:
            self._fixes = [*self._fixes, (true, located)][-_MOST_FIXES:]
            return
        apart = se2.between(true[[0, 1, 3]], se2.compose(self._T_true_map[[0, 1, 3]], located.pose_map))
        deviation = math.sqrt(max(float(np.linalg.eigvalsh(located.covariance[:2, :2])[-1]), 0.0))
        self._places.add(((located.stamp_ns - START_NS) / SECOND_NS, *apart.tolist(), deviation))

    def _ask(self, asked: Directive) -> None:
        """Keep what is new of the path that is asked for; with the first one the start is over."""
        if self._T_true_map is None:
            self._align()
        if self._located is None or self._T_true_map is None:
            return
        way, leg = asked.path[:, WAY], (asked.gear, round(asked.stop_m, 2))
        if leg != self._leg:
            self._leg = leg
            self._along_m = self._begin_m(asked)
            if len(self._legs) < _MOST_LEGS:
                self._legs.append(("forward" if asked.gear > 0 else "reverse", []))
        new = (way > self._along_m) & (way < asked.stop_m + _ON_PATH_M)
        if new.any():
            T_map_odom = se2.compose(self._located.pose_map, se2.inverse(self._located.pose_odom))
            T_true_odom = se2.compose(self._T_true_map[[0, 1, 3]], T_map_odom)
            self._legs[-1][1].append(moved(asked.path[new], T_true_odom)[:, :2])
            self._along_m = float(way[new][-1])

    def _begin_m(self, asked: Directive) -> float:
        """Return how far along the path the machine is."""
        assert self._located is not None  # noqa: S101  # looked at by the caller
        x, y = self._located.pose_odom[:2]
        near = int(np.hypot(asked.path[:, 0] - x, asked.path[:, 1] - y).argmin())
        return float(asked.path[near, WAY]) - 1e-6

    def _align(self) -> None:
        """Align map and truth at the start: by all places that were told while the machine stood there."""
        if not self._fixes:
            return
        true = np.array([one for one, _ in self._fixes])
        told = np.array([[*one.pose_map, one.height_m] for _, one in self._fixes])
        turns = true[:, 3] - told[:, 2]
        yaw = math.atan2(float(np.sin(turns).mean()), float(np.cos(turns).mean()))
        c, s = math.cos(yaw), math.sin(yaw)
        (x, y), (tx, ty) = told[:, :2].mean(axis=0), true[:, :2].mean(axis=0)
        z = float((true[:, 2] - told[:, 3]).mean())
        self._T_true_map = np.array([tx - c * x + s * y, ty - s * x - c * y, z, yaw])
        self._fixes = []
        if self._topology is not None:
            self.map = carried(self._topology, self._T_true_map)

    def _drawn_legs(self, legs: list[tuple[str, list[FloatArray]]]) -> list[Leg]:
        """Return legs with lines (N, 3), on the floor of the map's nearest tunnel point."""
        floor = np.zeros((1, 3)) if self.map is None else np.concatenate([one.line_m for one in self.map.connections])
        drawn = []
        for gear, parts in legs:
            if parts:
                line = np.concatenate(parts)
                near = [int(np.hypot(floor[:, 0] - x, floor[:, 1] - y).argmin()) for x, y in line]
                drawn.append(Leg(gear, np.column_stack([line, floor[near, 2]])))
        return drawn


class _Thinned:
    """Lines, evenly thinned: when there are too many, every other one goes."""

    def __init__(self, most: int) -> None:
        self.kept: list[FloatArray] = []
        self._most, self._step, self._seen = most, 1, 0

    def add(self, line: FloatArray) -> None:
        """Take a line, or leave it out."""
        if self._seen % self._step == 0:
            self.kept.append(line)
            if len(self.kept) >= self._most:
                self.kept, self._step = self.kept[::2], 2 * self._step
        self._seen += 1

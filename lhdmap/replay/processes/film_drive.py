"""What a machine that drives itself plans and believes, as the film sees it: beside the truth, and in its frame.

Map and truth are laid over each other for the picture alone: while it goes on where the machine stood at the start, at the end
as they fit best over the drive. Plans are drawn from where the machine truly is.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from typing import Any

import numpy as np

from lhdmap.driving.bodies import bodies_of
from lhdmap.geometry import se2
from lhdmap.guidance.directive import WAY, Directive, moved
from lhdmap.guidance.planner import Plan
from lhdmap.kinematics import T_base_rear
from lhdmap.machine import Machine
from lhdmap.messages import FloatArray
from lhdmap.navigation.along import Located
from lhdmap.replay.parts import State
from lhdmap.replay.process import DIRECTIVE, LOCATED, PLAN, POSE
from lhdmap.replay.series import Series
from lhdmap.report.replay_data import COLUMNS, PLACE_COLUMNS, PLAN_COLUMNS, DriveData
from lhdmap.report.route_legs import Leg
from lhdmap.simulation.history import SECOND_NS, START_NS
from lhdmap.topology.carried import carried, carried_points
from lhdmap.topology.model import TopologicalMap

TOPICS = (POSE, LOCATED, DIRECTIVE, PLAN)
_EACH_NS = SECOND_NS // 5
_ABOVE_M = 0.4
_KEPT = 400  # true states: four seconds
_MOST_HORIZONS, _MOST_LEGS = 300, 500
_ON_PATH_M, _BODIES_M = 0.05, 15.0
_PLACED = 10  # time, true pose (x, y, z, yaw), place on the map (x, y, yaw, z), deviation
_HEADING_M = 2.0  # so far from a place its heading counts as much as the place itself


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


class PlanFilm:
    """The plans of guidance: `planned_mps` and `predicted_m` (clearance) of the newest; NaN where there is none."""

    def __init__(self) -> None:
        self.planned_mps = self.predicted_m = math.nan
        self._plan: Plan | None = None
        self._rows = Series(len(PLAN_COLUMNS))
        self._limits: dict[str, int] = {}
        self._horizons = _Thinned(_MOST_HORIZONS)

    def take(self, plan: Plan | None) -> None:
        """Take a plan; None: nothing is planned any more."""
        self._plan = plan
        self.planned_mps = self.predicted_m = math.nan
        if plan is not None:
            self.planned_mps = plan.gear * float(plan.speeds.speed_mps[0])
            self.predicted_m = plan.clearance_m

    def look(self, now_ns: int, here: FloatArray, T_true_odom: FloatArray, pitch_rad: float) -> FloatArray:
        """Return the way (K, 3) that is predicted now from the true pose `here` (4,); empty where nothing is planned."""
        plan = self._plan
        if plan is None:
            return np.empty((0, 3))
        limit = self._limits.setdefault(plan.speeds.by, len(self._limits))
        time_s = (now_ns - START_NS) / SECOND_NS
        self._rows.add((time_s, self.planned_mps, plan.clearance_m, plan.speeds.sight_m, float(limit)))
        way = se2.transform(T_true_odom, np.ascontiguousarray(plan.solution.states[:, :2]))
        ahead = (way - here[:2]) @ np.array([math.cos(here[3]), math.sin(here[3])])
        line = np.column_stack([way, here[2] + _ABOVE_M - math.sin(pitch_rad) * ahead])
        self._horizons.add(line)
        return line

    @property
    def rows(self) -> FloatArray:
        """Rows of `PLAN_COLUMNS`."""
        return self._rows.rows()

    @property
    def limits(self) -> tuple[str, ...]:
        """What limited the speed, by the number in the rows."""
        return tuple(self._limits)

    @property
    def horizons(self) -> list[FloatArray]:
        """Ways (K, 3) that were predicted, evenly thinned."""
        return self._horizons.kept


class DriveFilm:
    """Takes true states and messages of `TOPICS`; `look` gives each 0.2 s what is to be drawn of the newest plan."""

    def __init__(self, topology: TopologicalMap | None) -> None:
        self._topology = topology
        self.truth = Truth()
        self.map: TopologicalMap | None = None
        self.plans, self._places = PlanFilm(), Series(_PLACED)
        self._looked_ns = 0
        self._T_true_map: FloatArray | None = None
        self._T_true_odom: FloatArray | None = None
        self._located: Located | None = None
        self._legs: list[tuple[str, list[FloatArray]]] = []
        self._leg: tuple[int, float] = (0, 0.0)
        self._along_m = -math.inf

    def take(self, topic: str, message: Any) -> None:
        """Take a message."""
        if topic == POSE:
            self._pose(message.stamp_ns, message.T_odom_base)
        elif topic == LOCATED:
            self._place(message)
        elif topic == DIRECTIVE and message.directive is not None:
            self._ask(message.directive)
        elif topic == PLAN:
            self.plans.take(message if isinstance(message, Plan) else None)

    def look(self, now_ns: int, pitch_rad: float) -> FloatArray | None:
        """Return the way (K, 3) that is predicted now, where one is due; empty where nothing is planned any more."""
        if now_ns - self._looked_ns < _EACH_NS:
            return None
        self._looked_ns = now_ns
        here = self.truth.at(now_ns)
        if here is None or self._T_true_odom is None:
            return np.empty((0, 3))
        return self.plans.look(now_ns, here, self._T_true_odom, pitch_rad)

    def leg(self) -> Leg | None:
        """Return the leg that is driven, as far as it has been asked for."""
        legs = self._drawn_legs(self._legs[-1:])
        return legs[0] if legs else None

    def data(self, rows: FloatArray, machine: Machine) -> DriveData:
        """Return all of it; `rows` (N, 10) of the replay, for the bodies of the machine on its way."""
        told, places = self._places.rows(), np.empty((0, len(PLACE_COLUMNS)))
        if len(told):
            self._align(told)
        if self._T_true_map is not None:
            places = _off(told, self._T_true_map)
        bodies = outlines(rows, machine, _BODIES_M) if len(rows) else []
        plans, legs = self.plans, self._drawn_legs(self._legs)
        return DriveData(self.map, legs, plans.rows, plans.limits, plans.horizons, places, bodies)

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
        deviation = math.sqrt(max(float(np.linalg.eigvalsh(located.covariance[:2, :2])[-1]), 0.0))
        time_s = (located.stamp_ns - START_NS) / SECOND_NS
        self._places.add((time_s, *true.tolist(), *located.pose_map.tolist(), located.height_m, deviation))

    def _ask(self, asked: Directive) -> None:
        """Keep what is new of the path that is asked for; with the first one the start is over."""
        if self._T_true_map is None and len(self._places.rows()):
            self._align(self._places.rows())
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
            pose_map_odom = se2.compose(self._located.pose_map, se2.inverse(self._located.pose_odom))
            self._legs[-1][1].append(moved(asked.path[new], pose_map_odom)[:, :2])
            self._along_m = float(way[new][-1])

    def _begin_m(self, asked: Directive) -> float:
        """Return how far along the path the machine is."""
        assert self._located is not None  # noqa: S101  # looked at by the caller
        x, y = self._located.pose_odom[:2]
        near = int(np.hypot(asked.path[:, 0] - x, asked.path[:, 1] - y).argmin())
        return float(asked.path[near, WAY]) - 1e-6

    def _align(self, rows: FloatArray) -> None:
        """Lay map and truth over each other by rows (N, 10) of true poses and places on the map."""
        self._T_true_map = _fitted(rows)
        if self._topology is not None:
            self.map = carried(self._topology, self._T_true_map)

    def _drawn_legs(self, legs: list[tuple[str, list[FloatArray]]]) -> list[Leg]:
        """Return legs with lines (N, 3) in the frame of the truth, on the floor of the nearest way of the map."""
        if self.map is None or self._T_true_map is None:
            return []
        floor = np.concatenate([np.zeros((1, 3)), *(one.line_m for one in self.map.connections)])
        drawn = []
        for gear, parts in legs:
            if parts:
                line = carried_points(np.concatenate(parts), self._T_true_map)
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


def _fitted(rows: FloatArray) -> FloatArray:
    """Return T_true_map (4,: x, y, z, yaw) that fits best to rows of true poses and places on the map; headings count, too."""
    true, told = rows[:, 1:5], rows[:, 5:9]
    p, q = told[:, :2] - told[:, :2].mean(axis=0), true[:, :2] - true[:, :2].mean(axis=0)
    turn = true[:, 3] - told[:, 2]
    sine = float((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] + _HEADING_M**2 * np.sin(turn)).sum())
    cosine = float((p * q).sum() + (_HEADING_M**2 * np.cos(turn)).sum())
    yaw = math.atan2(sine, cosine)
    at = np.array([0.0, 0.0, 0.0, yaw])
    shift = (true[:, :2] - carried_points(told[:, :2], at)).mean(axis=0)
    return np.array([*shift, float((true[:, 2] - told[:, 3]).mean()), yaw])


def _off(rows: FloatArray, T_true_map: FloatArray) -> FloatArray:
    """Return rows of `PLACE_COLUMNS`: the place on the map less the true one in the axes of the machine."""
    true, yaw = rows[:, 1:5], rows[:, 4]
    apart = carried_points(rows[:, 5:7], T_true_map) - true[:, :2]
    along, across = (
        np.cos(yaw) * apart[:, 0] + np.sin(yaw) * apart[:, 1],
        np.cos(yaw) * apart[:, 1] - np.sin(yaw) * apart[:, 0],
    )
    turn = rows[:, 7] + T_true_map[3] - yaw
    return np.column_stack([rows[:, 0], along, across, np.arctan2(np.sin(turn), np.cos(turn)), rows[:, 9]])


def outlines(rows: FloatArray, machine: Machine, each_m: float) -> list[FloatArray]:
    """Return both bodies of a machine as lines (5, 2) after each `each_m` of its way and at its end; rows as of the replay."""
    x, y, yaw, bend = (rows[:, COLUMNS.index(name)] for name in ("x_m", "y_m", "yaw_rad", "articulation_rad"))
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    wanted = np.searchsorted(way, np.arange(0.0, way[-1], each_m))
    bodies, drawn = bodies_of(machine), []
    for row in sorted({*wanted.tolist(), len(way) - 1}):
        T_base = np.array([x[row], y[row], yaw[row]])
        T = T_base_rear(float(bend[row]), machine)
        T_rear = se2.compose(T_base, np.array([T[0, 3], T[1, 3], math.atan2(T[1, 0], T[0, 0])]))
        for pose, ((x0, y0), (x1, y1)) in ((T_base, bodies.front_box_m), (T_rear, bodies.rear_box_m)):
            drawn.append(se2.transform(pose, np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)])))
    return drawn

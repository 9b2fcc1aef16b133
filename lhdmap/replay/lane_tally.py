"""What is counted of a machine on a surface site, from the truth: both axles beside the way, bodies in the lane, docks."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from lhdmap.docking.room import Room
from lhdmap.driving.bodies import Bodies
from lhdmap.haulage.layout import GOALS
from lhdmap.haulage.ways import LANES, pose_at_end, way_of
from lhdmap.messages import FloatArray
from lhdmap.replay.parts import Nearness, Touch
from lhdmap.replay.processes.told import WayNow
from lhdmap.replay.site_drive import SiteGround
from lhdmap.simulation.vehicle.kinematic import KinematicState
from lhdmap.tracking.path import STEP_M, beside, path_of

_EVERY, _LOOK = 5, 2  # states of 10 ms: both axles at 20 Hz, bodies at 10 Hz
_STILL_MPS = 0.3
_BEYOND_M = 8.0
_NEAR_M = 6.0


class Truth(NamedTuple):
    """The way that is driven and the middle of its lane, as rows of `beside`; the edge at each row of the way."""

    rows: FloatArray
    lane: FloatArray
    edges: FloatArray


class Docked(NamedTuple):
    """How a machine stood at a place: its name, metres and degrees off, metres aside."""

    place: str
    off_m: float
    aside_m: float
    off_deg: float


class LaneTally:
    """Takes ways as the driver tells them, and true states; half a lane is `half_m` wide."""

    def __init__(self, ground: SiteGround, half_m: float) -> None:
        self._ground, self._half_m = ground, half_m
        self._way: WayNow | None = None
        self._truth: Truth | None = None
        self._near = np.zeros(2)
        self._count = 0
        self._state: KinematicState | None = None
        self._sums: tuple[list[float], list[float]] = [], []  # in areas, in lanes
        self._most = np.zeros(3)  # |z0|, |z1|, half of the lane that is used
        self._rooms: dict[str, Room] = {}
        self.docks: list[Docked] = []

    def way(self, told: WayNow) -> None:
        """Take another way; the one before has ended where the machine stands."""
        self._note_dock()
        self._way, self._truth = told, None
        if not told.dock:
            layout = self._ground.layout
            way, lane = way_of(layout, told.edges), way_of(layout, told.edges, 0.0)
            path = path_of(way.points_m, 0.0, _BEYOND_M)
            on = np.arange(len(path.points)) * STEP_M - path.begin_m
            along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way.points_m, axis=0).T))])
            index = np.clip(np.searchsorted(along, on, side="right") - 1, 0, len(along) - 1)
            self._truth = Truth(path.points, path_of(lane.points_m, 0.0, _BEYOND_M).points, way.edges[index])
            self._near = np.full(2, math.nan)

    def at(self, state: KinematicState) -> Nearness | None:
        """Take a true state; return how near the bodies come to the edge of what is theirs, None: it is not looked at now."""
        self._state = state
        self._count += 1
        if self._count % _EVERY or self._way is None:
            return None
        x1, y1, back, _, _ = state.rear(self._ground.models[0])
        edge = self._way.edges[0]
        if self._truth is not None:
            edge = self._beside(state, x1, y1)
        if self._count % (_EVERY * _LOOK):
            return None
        if self._truth is not None and self._ground.layout.edges[edge].kind in LANES:
            return self._in_lane(state, (x1, y1, back))
        return self._on_apron(state, edge)

    def _beside(self, state: KinematicState, x1: float, y1: float) -> int:
        """Note both offsets; return the edge that the front axle is on."""
        assert self._truth is not None  # noqa: S101  # asked for by the caller
        rows = self._truth.rows
        places = ((state.x_m, state.y_m), (x1, y1))
        if math.isnan(self._near[0]):
            for k, place in enumerate(places):
                self._near[k] = STEP_M * float(np.argmin(np.hypot(*(rows[: len(rows) // 2, :2] - place).T)))
        z = [0.0, 0.0]
        for k, (x, y) in enumerate(places):
            self._near[k], z[k], _, _ = beside(rows, x, y, float(self._near[k]), _NEAR_M, _NEAR_M)
        edge = int(self._truth.edges[min(max(round(float(self._near[0]) / STEP_M), 0), len(rows) - 1)])
        if abs(state.speed_mps) > _STILL_MPS:
            in_lane = self._ground.layout.edges[edge].kind in LANES
            self._sums[in_lane].append(z[0] + z[1])
            self._most[:2] = np.maximum(self._most[:2], np.abs(z))
        return edge

    def _in_lane(self, state: KinematicState, rear: tuple[float, float, float]) -> Nearness:
        assert self._truth is not None  # noqa: S101  # asked for by the caller
        touches, widest = [], 0.0
        bodies: Bodies = self._ground.bodies
        front = (state.x_m, state.y_m, state.yaw_rad)
        for k, (name, pose, outline) in enumerate(
            (("front_body", front, bodies.front_m), ("rear_body", rear, bodies.rear_m))
        ):
            c, s = math.cos(pose[2]), math.sin(pose[2])
            points = outline @ np.array([[c, s], [-s, c]]) + pose[:2]
            off = [
                abs(beside(self._truth.lane, x, y, float(self._near[k]) + ahead, 6.0, 6.0)[1])
                for (x, y), ahead in zip(points.tolist(), outline[:, 0].tolist(), strict=True)
            ]
            worst = int(np.argmax(off))
            widest = max(widest, off[worst])
            if off[worst] > self._half_m:
                touches.append(
                    Touch(f"{name} beside the lane", (*points[worst].tolist(), 0.0), off[worst] - self._half_m)
                )
        self._most[2] = max(self._most[2], widest)
        return Nearness(tuple(touches), max(self._half_m - widest, 0.0))

    def _on_apron(self, state: KinematicState, edge: int) -> Nearness | None:
        area = self._ground.layout.edges[edge].area
        if not area:
            return None
        if area not in self._rooms:
            self._rooms[area] = self._ground.room(area, 0.0)
        pose = np.array(state.rear(self._ground.models[0])[:4])
        misses = not self._rooms[area].free(pose[None])
        place = (state.x_m, state.y_m, 0.0)
        return Nearness((Touch(f"machine beside the apron {area}", place, 0.0),) if misses else ())

    def _note_dock(self) -> None:
        """Note where the machine stands at the end of a way to a place."""
        if self._way is None or self._state is None:
            return
        layout, state, edge = self._ground.layout, self._state, self._way.edges[-1]
        name = layout.edges[edge].end
        if layout.point[name].purpose not in GOALS or (
            np.isfinite(layout.edges[edge].reverse_from_m) and not self._way.dock
        ):
            return
        x, y, heading = pose_at_end(layout, edge).tolist()
        gap = state.x_m - x, state.y_m - y
        aside = abs(math.cos(heading) * gap[1] - math.sin(heading) * gap[0])
        turned = math.remainder(state.yaw_rad - heading, 2.0 * math.pi)
        self.docks.append(Docked(name, math.hypot(*gap), aside, math.degrees(abs(turned))))

    def verdict(self) -> dict[str, Any]:
        """Return what `verdict.json` says of lane and docks."""
        self._note_dock()
        self._way = None
        inside, lanes = self._sums
        return {
            **_told("sum", inside + lanes),
            **_told("lane_sum", lanes),
            "front_max_m": float(self._most[0]),
            "rear_max_m": float(self._most[1]),
            "half_lane_used_m": float(self._most[2]),
            "half_lane_m": self._half_m,
            "docks": [one._asdict() for one in self.docks],
        }


def _told(name: str, values: list[float]) -> dict[str, float | None]:
    """Return rms and largest of values, None of none."""
    if not values:
        return {f"{name}_rms_m": None, f"{name}_max_m": None}
    both = np.array(values)
    return {f"{name}_rms_m": float(np.sqrt(np.mean(both**2))), f"{name}_max_m": float(np.abs(both).max())}

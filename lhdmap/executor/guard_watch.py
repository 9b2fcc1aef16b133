"""The guard in use: the newest points of all scanners, looked at each 50 ms, and believed when they are seen twice."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion
from lhdmap.executor.guard import Guard, Swept
from lhdmap.executor.notes import Notes
from lhdmap.executor.settings import ExecutorSettings
from lhdmap.geometry import se2
from lhdmap.geometry.polygon import inside
from lhdmap.messages import FloatArray

_GUARD_NS = 50_000_000
_SAME_M = 1.5  # two stops nearer to each other are at one place
_HELD_NS = 12_000_000_000  # longer than navigation waits before it takes a machine for stuck (8 s)
_ROLLS_MPS = 0.05  # slower, the sign of a speed is noise
_MORE_M = 0.06  # of margin near a place where the guard has stopped it: rock stands out where no scanner sees it
_LOOKS = 2  # in a row, before a point within the margin is believed: a single one is noise


class _Again:
    """Stops of the guard at one place: who creeps from one into the next comes to touch what the scanners do not see.

    After the second one the gear is held, until the machine has gone elsewhere, the other gear is asked for, or after a while:
    who drives takes the machine for stuck by then, backs up, and tries again or asks.
    """

    def __init__(self) -> None:
        self._stop: tuple[Motion, float] | None = None
        self._until_ns = 0

    def stopped(self, now_ns: int, motion: Motion, way: float) -> None:
        """Take a stop; `way`: sign of the speed that was asked for or driven."""
        if self.near(motion, way):
            self._until_ns = now_ns + _HELD_NS
        self._stop = motion, way

    def holds(self, now_ns: int, motion: Motion, way: float) -> bool:
        """Return whether this way is still held."""
        if self._stop is None or now_ns >= self._until_ns:
            return False
        before, held = self._stop
        if (way and way == -held) or _apart_m(before, motion) >= _SAME_M:
            self._until_ns = 0
            return False
        return True

    def near(self, motion: Motion, way: float) -> bool:
        """Return whether it has been stopped on this way near here."""
        return self._stop is not None and self._stop[1] == way and _apart_m(self._stop[0], motion) < _SAME_M

    def forget(self) -> None:
        """Begin anew."""
        self._stop, self._until_ns = None, 0


class GuardWatch:
    """Give it `points` as they come, and ask `holds` in each step; `swept` is what the guard said last."""

    def __init__(self, model: DriveModel, bodies: Bodies, settings: ExecutorSettings) -> None:
        self.guard = Guard(model, bodies, settings, period_s=_LOOKS * _GUARD_NS * 1e-9)
        self.swept: Swept | None = None
        self.notes = Notes()
        self.touched_m: FloatArray | None = None  # corners (4, 2) in `odom` of where the bucket is to touch
        self._points: dict[str, tuple[Motion, FloatArray]] = {}
        self._looked_ns: int | None = None
        self._blocked, self._near = False, 0
        self._again = _Again()
        wary = replace(settings, margin_m=settings.margin_m + _MORE_M)
        self._wary = Guard(model, bodies, wary, period_s=_LOOKS * _GUARD_NS * 1e-9)

    def points(self, name: str, points_m: FloatArray, motion: Motion) -> None:
        """Take the points (N, 2) of a scanner in `base_link`, and the motion at their stamp; what is not finite goes."""
        self._points[name] = motion, points_m[np.isfinite(points_m).all(axis=1)]

    def is_due(self, now_ns: int) -> bool:
        """Return whether it is time to look again."""
        return self._looked_ns is None or now_ns - self._looked_ns >= _GUARD_NS

    @property
    def holds(self) -> bool:
        """Whether the guard holds the machine, as it was last looked at."""
        return self._blocked

    def look(
        self,
        now_ns: int,
        motion: Motion,
        commanded_mps: float | None,
        plan: FloatArray | None,
        pull_mps2: float,
        *,
        standing: bool,
        digs: bool = False,
    ) -> None:
        """Look along the braking path; a machine that was stopped goes on from standstill alone, and not again and again."""
        self._looked_ns = now_ns
        points = self._beside(self._seen_from(motion), motion)
        way = _way(commanded_mps, motion)
        guard = self._wary if self._again.near(motion, way) else self.guard
        found = guard.sweep(motion, points, commanded_mps=commanded_mps, plan=plan, pull_mps2=pull_mps2)
        self.swept = found
        self._near = self._near + 1 if found.contact else 0
        seen = found.hit or self._near >= _LOOKS
        if digs:
            self._again.forget()
        elif seen and not self._blocked:
            self._again.stopped(now_ns, motion, way)
        held = self._blocked and self._again.holds(now_ns, motion, way)
        blocked = seen or (self._blocked and not standing) or held
        if blocked != self._blocked:
            before, self._blocked = ("blocked" if self._blocked else "free"), blocked
            self.notes.add(
                "guard",
                before,
                "blocked" if blocked else "free",
                "points on the braking path",
                free_m=found.free_m,
                stop_m=found.stop_m,
                at_m=found.at_m,
                own=found.own,
            )

    def _seen_from(self, motion: Motion) -> FloatArray:
        """Return all points in `base_link` of a motion: the machine has moved since they were seen."""
        seen = [_moved(points, at, motion) for at, points in self._points.values()]
        return np.concatenate(seen) if seen else np.zeros((0, 2))

    def _beside(self, points: FloatArray, motion: Motion) -> FloatArray:
        """Return points in `base_link` without those that the bucket is to touch."""
        if self.touched_m is None:
            return points
        T_base_odom = se2.inverse(np.array([motion.x_m, motion.y_m, motion.heading_rad]))
        beside: FloatArray = points[~inside(points, se2.transform(T_base_odom, self.touched_m))]
        return beside


def _way(commanded_mps: float | None, motion: Motion) -> float:
    """Return the sign of the speed that is asked for, else of that which is driven; 0: neither is."""
    speed_mps = commanded_mps or (motion.speed_mps if abs(motion.speed_mps) > _ROLLS_MPS else 0.0)
    return math.copysign(1.0, speed_mps) if speed_mps else 0.0


def _apart_m(one: Motion, other: Motion) -> float:
    return math.hypot(one.x_m - other.x_m, one.y_m - other.y_m)


def _moved(points: FloatArray, before: Motion, after: Motion) -> FloatArray:
    """Return points (N, 2) of `base_link` at one motion in that of another."""
    turn = before.heading_rad - after.heading_rad
    c, s = math.cos(after.heading_rad), math.sin(after.heading_rad)
    dx, dy = before.x_m - after.x_m, before.y_m - after.y_m
    shift = np.array([c * dx + s * dy, c * dy - s * dx])
    ct, st = math.cos(turn), math.sin(turn)
    moved: FloatArray = points @ np.array([[ct, st], [-st, ct]]) + shift
    return moved

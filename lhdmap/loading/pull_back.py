"""Pull back: the bucket is retracted, guidance drives back by the way the machine came, the bucket is shaken (section 3.5)."""

from __future__ import annotations

import math

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.lead import lead_of
from lhdmap.driving.model import DriveModel
from lhdmap.driving.motion import Motion
from lhdmap.guidance.directive import WAY, Directive
from lhdmap.loading.moment import Moment, Step
from lhdmap.loading.positioning_path import back_path
from lhdmap.loading.signals import Controller, Pedals
from lhdmap.loading.states import Event
from lhdmap.loading.task_settings import LoadingSettings
from lhdmap.messages import FloatArray

RACK, BACK, SHAKE = "rack", "back", "shake"
_ARRIVED_M = 0.5
_CLEAR_M = 0.5  # from the way that a charge needs at least
_TRAIL_M, _STEP_M, _GAP_M = 60.0, 0.25, 1.0


class Trail:
    """The way the machine came by: its motions each 0.25 m, the oldest forgotten."""

    def __init__(self) -> None:
        self.motions: list[Motion] = []

    def add(self, motion: Motion) -> None:
        """Take a motion."""
        last = self.motions[-1] if self.motions else None
        if last is None or np.hypot(motion.x_m - last.x_m, motion.y_m - last.y_m) >= _STEP_M:
            self.motions.append(motion)
            del self.motions[: -round(_TRAIL_M / _STEP_M)]

    def behind(self, motion: Motion) -> list[Motion]:
        """Return what lies behind a motion: the trail up to its place nearest to there, back to where it has a gap.

        After a pull back the trail goes on from farther back: what it had before is another pass.
        """
        found = self.motions[: self._nearest(motion) + 1]
        for k in range(len(found) - 1, 0, -1):
            if np.hypot(found[k].x_m - found[k - 1].x_m, found[k].y_m - found[k - 1].y_m) > _GAP_M:
                return found[k:]
        return found

    def back_m(self, motion: Motion) -> float:
        """Return how far a motion is from the trail's end: so much of a pull back is done already."""
        last = self.motions[-1] if self.motions else motion
        return float(np.hypot(motion.x_m - last.x_m, motion.y_m - last.y_m))

    def straight_m(self, most_rad: float) -> float:
        """Return how far back from its end the machine stood as straight as that all the while, joint and heading."""
        way_m = 0.0
        for one, before in zip(self.motions[::-1], self.motions[-2::-1], strict=False):
            turned = math.remainder(before.heading_rad - self.motions[-1].heading_rad, math.tau)
            step_m = float(np.hypot(one.x_m - before.x_m, one.y_m - before.y_m))
            if max(abs(turned), abs(before.articulation_rad)) > most_rad or step_m > _GAP_M:
                break
            way_m += step_m
        return way_m

    def cut(self, motion: Motion) -> None:
        """Forget what lies ahead of a motion, to which the machine has gone back."""
        self.motions = self.behind(motion)

    def off_m(self, motion: Motion) -> float:
        """Return how far a motion is from the trail; infinite where there is none."""
        if not self.motions:
            return float("inf")
        near = self.motions[self._nearest(motion)]
        return float(np.hypot(motion.x_m - near.x_m, motion.y_m - near.y_m))

    def forget(self) -> None:
        """Begin anew."""
        self.motions = []

    def _nearest(self, motion: Motion) -> int:
        if not self.motions:
            return -1
        places = np.array([[one.x_m, one.y_m] for one in self.motions])
        return int(np.hypot(places[:, 0] - motion.x_m, places[:, 1] - motion.y_m).argmin())


class PullBack:
    """Three phases; the limit of the state counts over all of them."""

    def __init__(
        self, model: DriveModel, bodies: Bodies, settings: LoadingSettings, shake: Controller, trail: Trail
    ) -> None:
        self._rear, self._lip_m = lead_of(-1, model, bodies), float(bodies.front_box_m[1, 0])
        self._settings, self._shake, self._trail = settings, shake, trail
        self.phase = RACK
        self._since_ns = 0
        self._path: FloatArray | None = None
        self._stop_m = 0.0

    def begin(self, moment: Moment) -> None:
        """Begin with retracting the bucket."""
        self.phase, self._since_ns, self._path = RACK, moment.now_ns, None

    def step(self, moment: Moment) -> Step:
        """Return what is to be done now."""
        if self.phase == RACK:
            return self._rack(moment)
        return self._back(moment) if self.phase == BACK else self._shaken(moment)

    def _rack(self, moment: Moment) -> Step:
        """Retract the bucket; one that is buried too deep is pulled out as it is."""
        settings = self._settings
        over = moment.now_ns - self._since_ns > round(settings.rack_s * 1e9)
        if moment.signals.bucket_rad < -settings.racked_rad and not over:
            return Step(RACK, pedals=Pedals(tilt=1.0, full_rpm=True, brake=True))
        self.phase = BACK
        return self._back(moment)

    def _back(self, moment: Moment) -> Step:
        """Drive back by guidance over the set distance."""
        motion, settings = moment.motion, self._settings
        if self._path is None:
            trail = self._trail.behind(motion)
            self._path = back_path(motion, trail, self._rear, settings.pull_back_m, settings.back_kmh / 3.6)
            self._stop_m = self._along_m(motion) + max(self._way_m(moment) - self._trail.back_m(motion), 0.0)
        left_m = self._stop_m - self._along_m(motion)
        if left_m < _ARRIVED_M and abs(motion.speed_mps) < settings.standing_mps:
            self.phase = SHAKE
            self._trail.cut(motion)
            self._shake.begin(moment.signals)
            return self._shaken(moment)
        return Step(BACK, directive=Directive(moment.now_ns, -1, self._path, self._stop_m, leaves=True))

    def _way_m(self, moment: Moment) -> float:
        """Return how far back of the trail's end: the set way, less where the machine came round a bend before its pile.

        Who stops in the midst of the bend that leads into a draw point has no room to turn the other way out of it. So far that
        another charge may begin from there it goes in any case.
        """
        settings, target = self._settings, moment.target
        end = self._trail.motions[-1] if self._trail.motions else moment.motion
        if target is None:
            return settings.pull_back_m
        axis = np.array([math.cos(target.heading_rad), math.sin(target.heading_rad)])
        deep_m = float((np.array([end.x_m, end.y_m]) - target.limits_m.mean(axis=0)) @ axis) + self._lip_m
        least_m = deep_m + settings.charge_from_m + _CLEAR_M
        straight_m = self._trail.straight_m(math.radians(settings.square_deg))
        return min(settings.pull_back_m, max(straight_m, least_m))

    def _along_m(self, motion: Motion) -> float:
        assert self._path is not None  # noqa: S101  # in this phase
        x, y, *_ = self._rear.state(motion)
        near = int(np.hypot(self._path[:, 0] - x, self._path[:, 1] - y).argmin())
        heading = self._path[near, 2]
        ahead = np.cos(heading) * (x - self._path[near, 0]) + np.sin(heading) * (y - self._path[near, 1])
        return float(self._path[near, WAY] + ahead)

    def _shaken(self, moment: Moment) -> Step:
        """Shake what lies loose off the bucket's rim."""
        turn = self._shake.step(moment.signals)
        event = Event.BACKED if turn.ended else None
        return Step(SHAKE, event, turn.ended, pedals=turn.pedals._replace(propel=0.0, brake=True), values=turn.values)

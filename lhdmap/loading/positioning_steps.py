"""Positioning: guided to a set distance without stopping, steering corrected until the charge lands, bucket down (Figs. 11 to 14).

approach -> align -> lower: the bucket goes down only once the machine is aimed and stands.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.model import DriveModel
from lhdmap.geometry import se2
from lhdmap.guidance.directive import WAY, Directive
from lhdmap.loading.drift_walls import axis_rad, from_wall_to_wall, wall_lines
from lhdmap.loading.identification import joint_of, target_of
from lhdmap.loading.lowering import Lowering
from lhdmap.loading.moment import Moment, Step, Target, pose_of
from lhdmap.loading.positioning_align import Aim, Aligner
from lhdmap.loading.positioning_path import approach_path
from lhdmap.loading.signals import Pedals
from lhdmap.loading.states import Event
from lhdmap.loading.task_settings import LoadingSettings
from lhdmap.messages import FloatArray

APPROACH, ALIGN, LOWER = "approach", "align", "lower"
_REPLAN_M, _BACKSTOP_M = 0.3, 0.5
_REPLAN_RAD, _ASKEW_RAD = math.radians(3.0), math.radians(25.0)
_LOOK_NS = 200_000_000
_REACHED_RAD = math.radians(0.4)
_GAIN_PS = 1.0  # rate per angle: the joint answers after dead time and lag, 0.45 s
_STILL_RPS = math.radians(0.5)
_CRAWL_MPS, _CRAWLS_NS = 0.3, 4_000_000_000
_EARLY_M = 3.0  # before `reach_m`: so far off it may be aimed where guidance only crawls between a pile's banks


class _Pace(NamedTuple):
    """When the machine last rolled at all, and last was faster than a crawl."""

    rolled_ns: int
    brisk_ns: int

    def at(self, now_ns: int, speed_mps: float, standing_mps: float) -> _Pace:
        """Return it with a speed of now."""
        speed_mps = abs(speed_mps)
        return _Pace(
            now_ns if speed_mps > standing_mps else self.rolled_ns, now_ns if speed_mps > _CRAWL_MPS else self.brisk_ns
        )


class Positioning:
    """Brings the machine before the pile so that driving straight on with the joint held ends in it."""

    def __init__(self, model: DriveModel, bodies: Bodies, settings: LoadingSettings) -> None:
        self._model, self._settings, self._lip_m = model, settings, float(bodies.front_box_m[1, 0])
        self._aligner, self._lowering = Aligner(model, bodies, settings), Lowering(settings)
        self.phase = APPROACH
        self._path: FloatArray | None = None
        self._planned: Target | None = None
        self._aim, self._aimed_ns, self._pace = Aim(None), 0, _Pace(0, 0)
        self._hit_ns: int | None = None

    def begin(self, moment: Moment) -> None:
        """Begin with the approach."""
        self.phase, self._path, self._planned = APPROACH, None, None
        self._pace, self._hit_ns = _Pace(moment.now_ns, moment.now_ns), None

    def step(self, moment: Moment) -> Step:
        """Return what is to be done now."""
        target = self._refreshed(moment)
        if target is None:
            return Step(self.phase, Event.MISSED, "no pile to aim at")
        if self.phase == APPROACH:
            step = self._approach(moment, target)
        elif self.phase == ALIGN:
            step = self._align(moment, target)
        else:
            step = self._lower(moment, target)
        return step._replace(target=target)

    def _refreshed(self, moment: Moment) -> Target | None:
        """Return the pile; newer while perception sees it from afar, near it as it was at first, but between the walls of now."""
        known, pile = moment.target, moment.pile
        if known is None:
            return None
        if self.phase == APPROACH and pile is not None and pile.stamp_ns > known.stamp_ns:
            newer = target_of(pile.estimate, pile.stamp_ns)
            if newer is not None and math.dist(newer.center_m, known.center_m) <= self._settings.pile_moved_m:
                known = newer
        return _along_drift(known, moment)

    def _approach(self, moment: Moment, target: Target) -> Step:
        """Drive on by guidance until the joint is at the set distance from the centre, nearer where it is not square yet."""
        settings = self._settings
        far_m = float(np.hypot(*(target.center_m - joint_of(pose_of(moment.motion), self._model))))
        self._pace = self._pace.at(moment.now_ns, moment.motion.speed_mps, settings.standing_mps)
        if self._there(moment, target, far_m) or self._crawls(moment, target, far_m):
            self.phase, self._aimed_ns = ALIGN, -_LOOK_NS
            return self._align(moment, target)
        if moment.now_ns - self._pace.rolled_ns > round(settings.stuck_s * 1e9):
            return Step(APPROACH, Event.BLOCKED, f"guidance does not drive on, {far_m:.1f} m before the pile")
        before_m = settings.reach_m - self._model.front_m
        if self._path is None or self._planned is None or _is_moved(target, self._planned):
            self._path = approach_path(moment.motion, target, before_m, settings.approach_kmh / 3.6)
            self._planned = target
        left = np.hypot(*(self._path[:, :2] - target.limits_m.mean(axis=0)).T)
        stop_m = float(self._path[int(left.argmin()), WAY]) - self._lip_m - settings.run_up_m + _BACKSTOP_M
        return Step(APPROACH, directive=Directive(moment.now_ns, 1, self._path, stop_m))

    def _there(self, moment: Moment, target: Target, far_m: float) -> bool:
        """Return whether it is near enough to be aimed, and stands straight, or has no room left for that."""
        near = far_m <= self._settings.reach_m
        return near and (self._square(moment, target) or self._room_m(moment, target) < self._settings.run_up_m)

    def _crawls(self, moment: Moment, target: Target, far_m: float) -> bool:
        """Return whether guidance hardly drives on, but a charge from here lands: banks of the pile are in its way."""
        slow = moment.now_ns - self._pace.brisk_ns > _CRAWLS_NS and far_m <= self._settings.reach_m + _EARLY_M
        if not slow or moment.now_ns - self._aimed_ns < _LOOK_NS:
            return False
        self._aimed_ns = moment.now_ns
        limits = target.limits_in(moment.motion)
        return self._aimed(moment, target, limits).bend_rad is not None

    def _aimed(self, moment: Moment, target: Target, limits_m: FloatArray) -> Aim:
        into = math.remainder(target.heading_rad - moment.motion.heading_rad, math.tau)
        return self._aligner.aim(moment.motion.articulation_rad, limits_m, moment.walls_m, into)

    def _square(self, moment: Moment, target: Target) -> bool:
        """Return whether the machine stands straight before the pile: a bent one digs towards a wall."""
        motion, most = moment.motion, math.radians(self._settings.square_deg)
        off = math.remainder(motion.heading_rad - target.heading_rad, math.tau)
        return abs(off) < most and abs(motion.articulation_rad) < most

    def _room_m(self, moment: Moment, target: Target) -> float:
        """Return the way of the lip to the line through the limits, in the direction of the pile."""
        axis = np.array([math.cos(target.heading_rad), math.sin(target.heading_rad)])
        return float((target.limits_m.mean(axis=0) - pose_of(moment.motion)[:2]) @ axis) - self._lip_m

    def _align(self, moment: Moment, target: Target) -> Step:
        """Turn the joint until both sides land, creeping on while there is room; Eq. (6) all the while."""
        settings, motion, bend = self._settings, moment.motion, moment.motion.articulation_rad
        limits = target.limits_in(motion)
        if not self._aligner.boxes_free(bend, limits, moment.walls_m):
            return self._hit(moment)
        self._hit_ns = None
        if moment.now_ns - self._aimed_ns >= _LOOK_NS:
            self._aim, self._aimed_ns = self._aimed(moment, target, limits), moment.now_ns
        if self._aim.bend_rad is None:
            return self._cannot(moment)
        off = self._aim.bend_rad - bend
        landed = self._aligner.lands(bend, limits)
        if landed.good and landed.way_m < settings.charge_from_m:
            return Step(ALIGN, Event.MISSED, f"too near to the pile: {landed.way_m:.1f} m")
        still = abs(motion.articulation_rate_rps) < _STILL_RPS
        if abs(off) < _REACHED_RAD and still and landed.good:
            self.phase = LOWER
            self._lowering.begin(moment.signals)
            return self._lower(moment, target)
        most = math.radians(settings.align_dps)
        rate = 0.0 if abs(off) < _REACHED_RAD else min(max(_GAIN_PS * off, -most), most)
        room = landed.way_m > settings.run_up_m
        pedals = Pedals(settings.creep if room else 0.0, brake=not room, steering_rate_rps=rate)
        return Step(ALIGN, pedals=pedals)

    def _hit(self, moment: Moment) -> Step:
        """Stand still for a look: a wall that is still in a box then is one, a point that is gone was noise."""
        self._hit_ns = moment.now_ns if self._hit_ns is None else self._hit_ns
        if moment.now_ns - self._hit_ns >= _LOOK_NS:
            return Step(ALIGN, Event.BLOCKED, "a wall point is inside a body's box")
        return Step(ALIGN, pedals=Pedals(brake=True))

    def _cannot(self, moment: Moment) -> Step:
        """Say so once it stands: what is seen while it rolls may look otherwise from where it stops."""
        if abs(moment.motion.speed_mps) > self._settings.standing_mps:
            return Step(ALIGN, pedals=Pedals(brake=True))
        if self._aim.walled:
            return Step(ALIGN, Event.BLOCKED, "each angle that lands on the pile touches a wall")
        return Step(ALIGN, Event.MISSED, "no joint angle within reach lands both sides on the pile")

    def _lower(self, moment: Moment, target: Target) -> Step:
        """Lower the bucket at rest; at last look at the charge once more."""
        turn = self._lowering.step(moment.signals)
        standing = abs(moment.motion.speed_mps) < self._settings.standing_mps
        if not turn.ended or not standing:
            return Step(LOWER, pedals=turn.pedals._replace(brake=True))
        limits, bend = target.limits_in(moment.motion), moment.motion.articulation_rad
        landed = self._aligner.lands(bend, limits)
        if not landed.good or not self._aligner.free(bend, limits, moment.walls_m):
            self.phase, self._aimed_ns = ALIGN, -_LOOK_NS
            return Step(ALIGN, pedals=Pedals(brake=True))
        values = (*turn.values, ("bend_rad", bend), ("way_m", landed.way_m), ("middle", landed.middle))
        return Step(LOWER, Event.PLACED, turn.ended, pedals=Pedals(brake=True), values=values)


def _is_moved(target: Target, planned: Target) -> bool:
    """Return whether a pile is so far from where the path leads that another one is due."""
    turned = math.remainder(target.heading_rad - planned.heading_rad, math.tau)
    return float(np.abs(target.limits_m - planned.limits_m).max()) > _REPLAN_M or abs(turned) > _REPLAN_RAD


def _along_drift(target: Target, moment: Moment) -> Target:
    """Return a pile with its drift's direction, from wall to wall, where both are seen: one that has been dug looks askew."""
    limits_m, pose = target.limits_in(moment.motion), pose_of(moment.motion)
    lines = wall_lines(moment.walls_m, limits_m)
    axis = axis_rad(lines)
    heading = moment.motion.heading_rad
    if axis is None or abs(math.remainder(heading + axis - target.heading_rad, math.tau)) > _ASKEW_RAD:
        return target
    drawn_m = se2.transform(pose, from_wall_to_wall(limits_m, lines))
    return target._replace(heading_rad=heading + axis, limits_m=drawn_m)

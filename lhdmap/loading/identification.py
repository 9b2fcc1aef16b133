"""Rock pile identification: the machine rolls on while perception looks; the pile is known in time, or help is asked for."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lhdmap.driving.model import DriveModel
from lhdmap.geometry import se2
from lhdmap.guidance.directive import HEADING
from lhdmap.loading.moment import Moment, Step, Target, pose_of
from lhdmap.loading.positioning_path import approach_path, is_free
from lhdmap.loading.seen_again import face_behind_m, moved
from lhdmap.loading.states import Event
from lhdmap.loading.task_settings import LoadingSettings
from lhdmap.messages import FloatArray
from lhdmap.pile.result import PileEstimate, Snapshot

_AGAIN_NS, _MOVED_M = 1_000_000_000, 3.0  # a face that has moved farther is another one
_FACING_RAD = math.radians(15.0)
_BEFORE_M, _BEHIND_M = 0.7, 3.0  # hits on a face lie behind its toe, by the scanner's height over its slope


class Identification:
    """Takes an estimate that is loadable and measured; refuses one that is not; asks where there is none 15 m before the pile."""

    def __init__(self, model: DriveModel, settings: LoadingSettings) -> None:
        self._model, self._settings = model, settings
        self.phase = "look"
        self._since_ns, self._near = 0, False
        self._facing_m = 0.0
        self._place: FloatArray | None = None

    def begin(self, moment: Moment) -> None:
        """Begin to look, from afar, or near the pile before another attempt."""
        self._since_ns = moment.now_ns
        self._near = self._distance_m(moment) < self._settings.identify_m and moment.target is not None
        self._facing_m, self._place = 0.0, None

    def step(self, moment: Moment) -> Step:
        """Return what navigation drives until the pile is known."""
        estimate, stamp_ns, why = self._estimate(moment)
        target = target_of(estimate, stamp_ns) if estimate is not None else None
        if target is not None and (why := self._gone(target, moment) or self._behind_walls(target, moment)) == "":
            return Step(self.phase, Event.PILE_FOUND, "loadable", moment.approach, target=target)
        again = self._again(moment)
        if again is not None:
            values = (
                (("shift_m", float(np.hypot(*(again.center_m - moment.target.center_m)))),) if moment.target else ()
            )
            return Step(self.phase, Event.PILE_FOUND, "the face seen again", target=again, values=values)
        far_m = self._distance_m(moment)
        self._count(moment)
        late = far_m < self._settings.identify_m and self._facing_m >= self._settings.facing_m
        if self._near:
            late = moment.now_ns - self._since_ns > round(self._settings.look_s * 1e9)
        if late:
            unfit = estimate is not None and estimate.status not in (None, "none", "loadable")
            event = Event.PILE_UNFIT if unfit else Event.PILE_UNKNOWN
            return Step(self.phase, event, why, values=(("distance_m", far_m),))
        return Step(self.phase, directive=None if self._near else moment.approach)

    def _behind_walls(self, target: Target, moment: Moment) -> str:
        """Return why a pile far ahead is not driven to yet; empty: it is. Seen from a bend the straight way leads through rock."""
        if self._near or self._distance_m(moment) < self._settings.identify_m or moment.approach is None:
            return ""
        before_m = self._settings.reach_m - self._model.front_m
        path = approach_path(moment.motion, target, before_m, self._settings.approach_kmh / 3.6)
        return "" if is_free(path, moment, target) else "the straight way to it leads through a wall"

    def _count(self, moment: Moment) -> None:
        """Count the way on which the machine has faced where it goes: round a bend there is nothing to be seen of a pile.

        A machine that has come to the end of its way, or has none, has seen what it can see after a while.
        """
        pose, way = pose_of(moment.motion), moment.approach
        before, self._place = self._place, pose[:2]
        standing = abs(moment.motion.speed_mps) < self._settings.standing_mps
        if standing and moment.now_ns - self._since_ns > round(self._settings.look_s * 1e9):
            self._facing_m = math.inf
        if before is None:
            return
        faces = way is None or abs(math.remainder(float(way.path[-1, HEADING]) - pose[2], math.tau)) < _FACING_RAD
        self._facing_m += float(np.hypot(*(self._place - before))) if faces else 0.0

    def _again(self, moment: Moment) -> Target | None:
        """Return the pile of the attempt before as it is seen now: the machine has looked at it from where it stands."""
        target = moment.target
        looked = moment.now_ns - self._since_ns >= _AGAIN_NS
        near = self._near or self._distance_m(moment) < self._settings.identify_m
        if not near or target is None or moment.marked is not None or not looked:
            return None
        limits = target.limits_in(moment.motion)
        shift = face_behind_m(moment.walls_m, limits) - moment.face_m
        hits = int(at_pile(moment.walls_m, limits, _BEHIND_M + _MOVED_M).sum())
        if not math.isfinite(shift) or abs(shift) > _MOVED_M or hits < self._settings.pile_hits:
            return None
        return moved(target, shift, moment.now_ns)

    def _estimate(self, moment: Moment) -> tuple[PileEstimate | None, int, str]:
        """Return the estimate that counts, its stamp, and what is to be said where it does not do."""
        if moment.marked is not None:
            return moment.marked, moment.now_ns, "the marked pile has no limits"
        if moment.pile is None:
            return None, 0, "no estimate of a pile"
        stamp_ns, _, estimate = moment.pile
        if stamp_ns < moment.touched_ns:
            return None, 0, "no estimate since the pile was dug"
        said = estimate.reason or f"status {estimate.status}"
        return estimate, stamp_ns, said if estimate.status != "loadable" else "the pile has no limits"

    def _distance_m(self, moment: Moment) -> float:
        """Return the way from the joint to the pile's centre, or to the draw point; infinite where neither is known."""
        place = joint_of(pose_of(moment.motion), self._model)
        if moment.pile is not None and moment.pile.estimate.status not in (None, "none") and _placed(moment.pile):
            return float(np.hypot(*(moment.pile.estimate.center_m[:2] - place)))
        if moment.draw_point_m is not None:
            return math.hypot(moment.draw_point_m[0] - place[0], moment.draw_point_m[1] - place[1])
        return math.inf if moment.target is None else float(np.hypot(*(moment.target.center_m - place)))

    def _gone(self, target: Target, moment: Moment) -> str:
        """Return why a pile that was known before does not count as still there; empty: it does."""
        if not self._near or self._settings.pile_hits == 0:
            return ""
        hits = int(at_pile(moment.walls_m, target.limits_in(moment.motion)).sum())
        return "" if hits >= self._settings.pile_hits else f"only {hits} scan points where the pile was"


def _placed(pile: Snapshot) -> bool:
    return bool(np.isfinite(pile.estimate.center_m[:2]).all())


def target_of(estimate: PileEstimate, stamp_ns: int) -> Target | None:
    """Return the pile to load; None where it is not loadable, or not measured."""
    limits = np.stack([estimate.right_limit_m[:2], estimate.left_limit_m[:2]])
    if estimate.status != "loadable" or not np.isfinite(limits).all():
        return None
    E = limits[1] - limits[0]
    if float(np.hypot(*E)) < 1e-3:
        return None
    center = estimate.center_m[:2] if np.isfinite(estimate.center_m[:2]).all() else limits.mean(axis=0)
    heading = math.atan2(-E[0], E[1])
    if estimate.attack is not None and math.isfinite(estimate.attack.heading_rad):
        heading = estimate.attack.heading_rad
    return Target(limits.copy(), center.copy(), heading, stamp_ns)


def joint_of(base: FloatArray, model: DriveModel) -> FloatArray:
    """Return the joint (2,) of a pose of `base_link` (3,): the paper's reference point."""
    return se2.compose(base, np.array([-model.front_m, 0.0, 0.0]))[:2]


def at_pile(points_m: FloatArray, limits_m: FloatArray, behind_m: float = _BEHIND_M) -> npt.NDArray[np.bool_]:
    """Return which points (N, 2) are on the pile between its limits (2, 2; E_R, E_L), bool (N,); one frame.

    `behind_m`: how far behind the toe they may be.
    """
    E = limits_m[1] - limits_m[0]
    d = points_m - limits_m[0]
    share = d @ E / float(E @ E)
    behind = d @ np.array([E[1], -E[0]]) / float(np.hypot(*E))
    found: npt.NDArray[np.bool_] = (share > 0.0) & (share < 1.0) & (behind > -_BEFORE_M) & (behind < behind_m)
    return found

"""The joint angle with which a charge lands on the pile and keeps off the walls: Eqs. (3) to (6) together."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lhdmap.driving.bodies import Bodies
from lhdmap.driving.model import DriveModel
from lhdmap.geometry import se2
from lhdmap.loading.drift_walls import WallLines, axis_rad, wall_lines, walls_beyond
from lhdmap.loading.identification import at_pile
from lhdmap.loading.positioning import Landing, curvature_pm, landing
from lhdmap.loading.positioning_boxes import Posture, charging, touches, turned, turning
from lhdmap.loading.task_settings import LoadingSettings
from lhdmap.messages import FloatArray

_STEP_RAD = math.radians(0.5)
_NEAR_M = 14.0
_WELL_OFF = 3.0  # times the least room beside the bodies
_HARDLY_M = 0.04  # off the middle: for less the joint is not turned
_INSIDE = 0.6  # share of the room beside the bucket that is kept on either side, where it can be


class Aim(NamedTuple):
    """A joint angle to charge with; None where there is none, and then whether the walls alone are what stands against it."""

    bend_rad: float | None
    walled: bool = False


class _Off(NamedTuple):
    """Wall points (N, 2) to keep off by a margin, until the lip is so deep behind the toe."""

    walls_m: FloatArray
    margin_m: float
    deep_m: float


class _Charge(NamedTuple):
    """How a charge lands, and how far off the middle of the pile the bucket is at its toe or where the dig ends."""

    landing: Landing
    off_middle_m: float


class Aligner:
    """Finds the joint angle whose charge stays nearest to the pile's middle, both sides inside its limits and off the walls."""

    def __init__(self, model: DriveModel, bodies: Bodies, settings: LoadingSettings) -> None:
        self._model, self._bodies, self._settings = model, bodies, settings
        (_, y0), (x1, y1) = bodies.front_box_m
        self.corners_m = np.array([[x1, y1], [x1, y0]])

    def lands(self, bend_rad: float, limits_m: FloatArray, *, margin_m: float = 0.0) -> Landing:
        """Return how a charge from now on lands, the joint held as it is; limits (2, 2) E_R, E_L in `base_link`."""
        return landing(curvature_pm(bend_rad, self._model), self.corners_m, shrunk(limits_m, margin_m))

    def free(self, bend_rad: float, limits_m: FloatArray, walls_m: FloatArray) -> bool:
        """Return whether a charge from now on keeps both boxes free of wall points until the lip is at the pile."""
        start = Posture(np.zeros(3), bend_rad)
        off = _Off(self._walls(limits_m, walls_m), self._settings.wall_m, 0.0)
        return self._sweeps_free(iter(()), start, self.lands(bend_rad, limits_m), off)

    def boxes_free(self, bend_rad: float, limits_m: FloatArray, walls_m: FloatArray) -> bool:
        """Return whether no wall point is inside a box now: Eq. (6)."""
        walls = self._walls(limits_m, walls_m)
        return not touches(Posture(np.zeros(3), bend_rad), walls, self._bodies, self._model, 0.0)

    def aim(self, bend_rad: float, limits_m: FloatArray, walls_m: FloatArray, into_rad: float | None = None) -> Aim:
        """Return the angle to turn the joint to; limits (2, 2) and wall points (N, 2) in `base_link`.

        `into_rad`: the way into the pile where its drift is not seen now; None: across its face.
        Of those that land well inside that which stays nearest to the middle, where there are none of those that land inside at
        all; among them those first that keep well off the walls, which are rough and not seen at each height, and go on beside
        the pile.
        """
        aim, lines = Aim(None), wall_lines(walls_m, limits_m)
        seen = axis_rad(lines)
        axis = into_rad if seen is None else seen
        for margin_m in self._margins_m(limits_m):
            for off in self._offs(limits_m, walls_m, lines):
                found = self._aim(bend_rad, limits_m, axis, margin_m, off)
                if found.bend_rad is not None:
                    return found
                aim = Aim(None, aim.walled or found.walled)
        return aim

    def _margins_m(self, limits_m: FloatArray) -> tuple[float, ...]:
        """Return how far inside both sides are to land, the most first: near a side the raised bucket is under a lower roof."""
        room_m = float(np.hypot(*(limits_m[1] - limits_m[0]))) - float(np.ptp(self.corners_m[:, 1]))
        least = self._settings.landing_m
        return tuple(
            dict.fromkeys((max(_INSIDE * 0.5 * room_m, least), max(0.5 * _INSIDE * 0.5 * room_m, least), least))
        )

    def _offs(self, limits_m: FloatArray, walls_m: FloatArray, lines: WallLines) -> Iterator[_Off]:
        """Yield what to keep off, the most first: at last the walls that are seen, up to the pile."""
        seen, settings = self._walls(limits_m, walls_m), self._settings
        beyond = walls_beyond(lines, limits_m, settings.dig_m)
        if len(beyond):
            both = np.concatenate([seen, beyond])
            yield _Off(both, _WELL_OFF * settings.wall_m, settings.dig_m)
            yield _Off(both, settings.wall_m, settings.dig_m)
        yield _Off(seen, _WELL_OFF * settings.wall_m, 0.0)
        yield _Off(seen, settings.wall_m, 0.0)

    def _aim(self, bend_rad: float, limits_m: FloatArray, axis: float | None, margin_m: float, off: _Off) -> Aim:
        """Return the angle whose charge stays nearest to the middle; that of now where it is hardly worse."""
        found = []
        for bend in self._candidates(bend_rad):
            turn = turned(bend_rad, bend, self._model)
            limits = se2.transform(se2.inverse(np.array([0.0, 0.0, turn])), limits_m)
            charge = self._charge(bend, limits, None if axis is None else axis - turn, margin_m)
            if charge is not None:
                worse_m = 0.0 if bend == bend_rad else _HARDLY_M
                found.append((charge.off_middle_m + worse_m, bend, turn, charge.landing))
        for _, bend, turn, landed in sorted(found, key=lambda one: one[0]):
            start = Posture(np.array([0.0, 0.0, turn]), bend)
            if self._sweeps_free(turning(bend_rad, bend, self._model), start, landed, off):
                return Aim(bend)
        return Aim(None, bool(found))

    def _charge(self, bend_rad: float, limits_m: FloatArray, axis: float | None, margin_m: float) -> _Charge | None:
        """Return a charge whose sides land so far inside, and are still between the limits when the bucket is as deep as it digs.

        The walls go on beside the pile: with the joint bent, or askew, the bucket runs into them while it digs. `axis` (rad):
        that of the drift; None: across the face.
        """
        E = limits_m[1] - limits_m[0]
        width_m = max(float(np.hypot(*E)), 1e-9)
        across = np.array([E[1], -E[0]]) / width_m
        into = across if axis is None else np.array([math.cos(axis), math.sin(axis)])
        deep_m = limits_m + self._settings.dig_m * into
        toe, deep = (self.lands(bend_rad, line_m, margin_m=margin_m) for line_m in (limits_m, deep_m))
        if not (toe.good and deep.good):
            return None
        width_m -= 2.0 * min(margin_m, width_m / 3.0)
        return _Charge(toe, width_m * max(abs(toe.middle - 0.5), abs(deep.middle - 0.5)))

    def _candidates(self, bend_rad: float) -> Iterator[float]:
        """Yield joint angles, the nearest to that of now first."""
        most, reach = self._model.max_articulation_rad, math.radians(self._settings.align_deg)
        for k in range(round(reach / _STEP_RAD) + 1):
            for bend in {bend_rad - k * _STEP_RAD: 0, bend_rad + k * _STEP_RAD: 0}:
                if abs(bend) <= most:
                    yield bend

    def _sweeps_free(self, turn: Iterator[Posture], start: Posture, landed: Landing, off: _Off) -> bool:
        """Return whether the boxes stay free while the joint turns, and then along the charge."""
        way_m = landed.way_m + off.deep_m if math.isfinite(landed.way_m) else 0.0
        curvature = curvature_pm(start.bend_rad, self._model)
        for postures in (turn, charging(start, curvature, way_m)):
            if any(touches(one, off.walls_m, self._bodies, self._model, off.margin_m) for one in postures):
                return False
        return True

    def _walls(self, limits_m: FloatArray, points_m: FloatArray) -> FloatArray:
        """Return the points that are wall: near, and not on the pile."""
        near = np.hypot(points_m[:, 0], points_m[:, 1]) < _NEAR_M
        return points_m[near & ~at_pile(points_m, limits_m)]


def shrunk(limits_m: FloatArray, margin_m: float) -> FloatArray:
    """Return limits (2, 2) drawn in by a margin at both ends, by a third of their width at most."""
    E = limits_m[1] - limits_m[0]
    width = float(np.hypot(*E))
    inward = E / width * min(margin_m, width / 3.0)
    return np.stack([limits_m[0] + inward, limits_m[1] - inward])

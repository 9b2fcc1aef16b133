"""The places of a plan as tubes: a stub beside its drift, or the drift made wider at a passing bay."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lhdmap.errors import ConfigError
from lhdmap.mine.centre_line import CentreLine
from lhdmap.mine.meetings import Meeting
from lhdmap.mine.plan import BLIND, LENGTH_M, PASSING_M, PlacePlan
from lhdmap.mine.polyline import rounded_line
from lhdmap.mine.tube import Tube, rows_of

_DRAW_POINT_DEG = 60.0


def with_place(tubes: list[Tube], found: list[Meeting], place: PlacePlan) -> tuple[list[Tube], list[Meeting]]:
    """Return tubes and meetings with those of a place."""
    index = next(k for k, tube in enumerate(tubes) if tube.name == place.drift)
    drift = tubes[index]
    at_m = place_at(place, drift)
    if place.side == "end":
        return tubes, found
    if place.kind == "passing_bay":
        return [*tubes[:index], _widened(drift, place, at_m), *tubes[index + 1 :]], found
    line = _stub(place, drift, at_m)
    width = place.width_m or 2.0 * drift.half_width_m(at_m)
    height = place.height_m or drift.height_m(at_m)
    tube = Tube(place.name, "place", line, rows_of(width), rows_of(height), drift.roughness_m, place)
    meeting = [] if place.kind in BLIND else [Meeting(index, at_m, len(tubes), 0.0)]
    return [*tubes, tube], [*found, *meeting]


def place_at(place: PlacePlan, drift: Tube) -> float:
    """Return where a place is on its drift's centre line, metres.

    Raises:
        ConfigError: it lies beyond the drift's end, or the plan does not say where.
    """
    length = drift.length_m
    if place.side == "end":
        return 0.0 if place.at_m is not None and place.at_m < 0.5 * length else length
    if place.at_m is None:
        raise ConfigError(f"[[place]] '{place.name}': at_m is missing (where it is on drift '{drift.name}')")
    if not 0.0 <= place.at_m <= length:
        raise ConfigError(
            f"[[place]] '{place.name}': at_m = {place.at_m:g} is not on drift '{drift.name}', which is {length:.1f} m long"
        )
    return place.at_m


def _stub(place: PlacePlan, drift: Tube, at_m: float) -> CentreLine:
    """Return the centre line of a place beside a drift: straight and level."""
    angle = place.angle_deg or (_DRAW_POINT_DEG if place.kind == "draw_point" else 90.0)
    turn = math.radians(angle) * (1.0 if place.side == "left" else -1.0)
    x, y, z, heading = drift.pose(at_m)
    length = drift.half_width_m(at_m) / math.sin(math.radians(angle)) + (place.length_m or LENGTH_M[place.kind])
    end = (x + length * math.cos(heading + turn), y + length * math.sin(heading + turn), z)
    return rounded_line(np.array([[x, y, z], end]), 1.0, place.name)


def _widened(drift: Tube, place: PlacePlan, at_m: float) -> Tube:
    """Return a drift that is wider at a passing bay, over its length and a taper of a third of it at both sides."""
    half, more = 0.5 * (place.length_m or LENGTH_M[place.kind]), place.width_m or PASSING_M
    knots = np.clip(at_m + half * np.array([-1.0, -0.6, 0.6, 1.0]), 0.0, drift.length_m)
    at = np.unique(np.concatenate([drift.widths_m[:, 0], knots]))
    widths = np.interp(at, *drift.widths_m.T) + np.interp(at, knots, [0.0, more, more, 0.0], left=0.0, right=0.0)
    return replace(drift, widths_m=np.stack([at, widths], axis=1))

"""Which bends can be driven: the rule, the map's check, and a search by brute force: `python -m tools.evaluate.bends --bends 200`.

Bends of constant width W and centre-line radius R between straights are drawn from a seed. The rule: W >= swept(R) + 0.35 m and
R not less than the machine's. The search: the best of all lines of a straight, a clothoid, an arc, a clothoid and a straight
(radius, length of the clothoid, lateral offset before and after) that the joint can follow at a crawl; drivable where it leaves
0.10 m on both sides.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import cast

import numba as nb
import numpy as np
from lhdmap.messages import FloatArray
from lhdmap.topology.connections import Walls, connection, drivable
from scipy.optimize import minimize
from tests.guidance.tunnels import BODIES, MACHINE, MODEL

ROOM_M, RULE_M = 0.10, 0.35
_STEP_M, _ENDS_M, _STARTS = 0.1, 16.0, 4
_TOO_WIDE_M = 20.0
_MOST_RAD = math.radians(38.0)  # of the joint, as in the findings


@dataclass(frozen=True)
class Bend:
    """A bend: radius of the centre line, turn, width; width that the rule and the search want; what the map's check says."""

    radius_m: float
    turn_deg: float
    width_m: float
    rule_m: float
    search_m: float
    map_says: bool

    @property
    def by_rule(self) -> bool:
        """Whether the rule lets the machine through."""
        return self.width_m >= self.rule_m

    @property
    def by_search(self) -> bool:
        """Whether the search found a line."""
        return self.width_m >= self.search_m


def swept_m(radius_m: float) -> float:
    """Return the width that the bodies sweep in a steady bend whose middle has this radius; infinite where it is too tight."""

    def band(axle_m: float) -> tuple[float, float]:
        centre = np.array([0.0, axle_m])
        bend = _steady_rad(axle_m)
        front = np.vstack([_box(BODIES.front_box_m), _box(BODIES.rear_box_m) @ _turn(-bend).T + _rear(bend)])
        away = np.linalg.norm(front - centre, axis=1)
        inner = abs(axle_m) - max(BODIES.front_box_m[1, 1], 0.0)
        return min(float(away.min()), inner), float(away.max())

    least = drivable(MACHINE).least_radius_m
    axles = np.linspace(least, radius_m + 2.0, 400)
    bands = np.array([band(float(one)) for one in axles])
    middles = bands.mean(axis=1)
    if radius_m < middles.min():
        return math.inf
    return float(np.interp(radius_m, middles, bands[:, 1] - bands[:, 0]))


def _steady_rad(axle_m: float) -> float:
    """Return the joint's angle where the front axle drives a circle: sin γ = (L_f cos γ + L_r) / R."""
    bend = 0.0
    for _ in range(60):
        bend = math.asin(min((MODEL.front_m * math.cos(bend) + MODEL.rear_m) / axle_m, 1.0))
    return bend


def _turn(angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def _rear(bend: float) -> FloatArray:
    c, s = math.cos(bend), math.sin(bend)
    return np.array([-MODEL.front_m - MODEL.rear_m * c, MODEL.rear_m * s])


def _box(box: FloatArray, step_m: float = 0.1) -> FloatArray:
    (x0, y0), (x1, y1) = box
    x, y = np.linspace(x0, x1, round((x1 - x0) / step_m)), np.linspace(y0, y1, 13)
    sides = [np.column_stack([x, np.full(len(x), one)]) for one in (y0, y1)]
    ends = [np.column_stack([np.full(len(y), one), y]) for one in (x0, x1)]
    return np.concatenate([*sides, *ends])


@nb.njit(cache=True)
def _needed(
    line: FloatArray,
    heading: FloatArray,
    lengths: tuple[float, float, float],
    boxes: tuple[FloatArray, FloatArray],
    radius: float,
    turn: float,
) -> float:
    """Return the width of the corridor that a drive of the front axle along a line needs; infinite where the joint cannot."""
    front_m, rear_m, most = lengths
    bend, worst = 0.0, 0.0
    for k in range(len(line) - 1):
        c, s = math.cos(heading[k]), math.sin(heading[k])
        cr, sr = math.cos(heading[k] - bend), math.sin(heading[k] - bend)
        rx, ry = line[k, 0] - front_m * c - rear_m * cr, line[k, 1] - front_m * s - rear_m * sr
        if k % 2 == 0:
            for p in boxes[0]:
                worst = max(
                    worst, _off(line[k, 0] + c * p[0] - s * p[1], line[k, 1] + s * p[0] + c * p[1], radius, turn)
                )
            for p in boxes[1]:
                worst = max(worst, _off(rx + cr * p[0] - sr * p[1], ry + sr * p[0] + cr * p[1], radius, turn))
        way = math.hypot(line[k + 1, 0] - line[k, 0], line[k + 1, 1] - line[k, 1])
        curvature = (heading[k + 1] - heading[k]) / way
        bend += way * (curvature * (front_m * math.cos(bend) + rear_m) - math.sin(bend)) / rear_m
        if abs(bend) > most:
            return 1e3 * abs(bend)
    return 2.0 * worst


@nb.njit(cache=True)
def _off(x: float, y: float, radius: float, turn: float) -> float:
    """Return how far a point is from the centre line: along x to the origin, an arc to the left, straight on."""
    if x <= 0.0 and y < radius:  # beyond is the second straight, where the bend turns by more than 90 degrees
        return abs(y)
    angle = math.atan2(x, radius - y) % (2.0 * math.pi)
    if angle <= turn:
        return abs(math.hypot(x, y - radius) - radius)
    ex, ey = radius * math.sin(turn), radius * (1.0 - math.cos(turn))
    c, s = math.cos(turn), math.sin(turn)
    return abs(-s * (x - ex) + c * (y - ey))


def line_of(radius_m: float, turn: float, shape: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Return points (N, 2) and headings (N,) of a drive: `shape`: radius, clothoid, offsets before and after (m, left)."""
    arc_m, ramp_m, before_m, after_m = (float(one) for one in shape)
    flat_m = turn * arc_m - ramp_m  # the clothoids turn as much as an arc of one of them
    if flat_m < 0.0 or ramp_m < 0.3 or arc_m < 1.0:
        return None
    s = np.arange(-2.0 * _ENDS_M, 2.0 * ramp_m + flat_m + 2.0 * _ENDS_M, _STEP_M)
    curvature = np.interp(s, [0.0, ramp_m, ramp_m + flat_m, 2.0 * ramp_m + flat_m], [0.0, 1.0, 1.0, 0.0]) / arc_m
    heading = np.cumsum(curvature) * _STEP_M
    heading *= turn / heading[-1]
    points = np.column_stack([np.cumsum(np.cos(heading)), np.cumsum(np.sin(heading))]) * _STEP_M
    points -= points[0]
    c, sn = math.cos(turn), math.sin(turn)
    ex, ey = radius_m * sn, radius_m * (1.0 - c)
    # along x so that the end has its offset from the second straight, along y so that the begin has its own
    x, y = points[-1, 0], points[-1, 1] + before_m
    shift = (-sn * (x - ex) + c * (y - ey) - after_m) / sn
    points += [shift, before_m]
    near = (points[:, 0] > -_ENDS_M) & (c * (points[:, 0] - ex) + sn * (points[:, 1] - ey) < _ENDS_M)
    return points[near], heading[near]


def searched_m(radius_m: float, turn: float, rng: np.random.Generator) -> float:
    """Return the least width, 0.10 m free on both sides, in which a line was found."""
    boxes, lengths = (_box(BODIES.front_box_m), _box(BODIES.rear_box_m)), (MODEL.front_m, MODEL.rear_m, _MOST_RAD)

    def cost(shape: FloatArray) -> float:
        made = line_of(radius_m, turn, shape)
        return 1e4 if made is None else float(_needed(made[0], made[1], lengths, boxes, radius_m, turn))

    best = math.inf
    for k in range(2 * _STARTS):
        if k >= _STARTS and best < _TOO_WIDE_M:
            break
        wider = 0.5 * k if k < _STARTS else 1.5 * (k - _STARTS + 1)  # the joint cannot: wider ones
        begin = np.array(
            [max(radius_m, 5.5) + wider, 3.0 + k % _STARTS, -0.2 * k, -0.2 * k]
        ) + 0.1 * rng.standard_normal(4)
        steps = {"maxfev": 250, "xatol": 0.01, "fatol": 0.002}
        best = min(best, float(minimize(cost, begin, method="Nelder-Mead", options=steps).fun))
    return best + 2.0 * ROOM_M


class Corridor:
    """The walls of a bend, exactly."""

    def __init__(self, radius_m: float, turn: float, width_m: float) -> None:
        self._bend, self._width_m = (radius_m, turn), width_m

    def clearance_m(self, points_m: FloatArray) -> float:
        """Return the least room of points (N, 2)."""
        return 0.5 * self._width_m - max(_off(x, y, *self._bend) for x, y in points_m.tolist())


def on_the_map(radius_m: float, turn: float, width_m: float) -> bool:
    """Return what the map says of the bend's centre line."""
    s = np.arange(-_ENDS_M, radius_m * turn + _ENDS_M, 0.25)
    angle = np.clip(s / radius_m, 0.0, turn)
    over = np.maximum(s - radius_m * turn, 0.0)
    x = np.minimum(s, 0.0) + radius_m * np.sin(angle) + over * np.cos(turn)
    y = radius_m * (1.0 - np.cos(angle)) + over * np.sin(turn)
    way = np.column_stack([x, y, np.zeros(len(s))])
    walls = cast("Walls", Corridor(radius_m, turn, width_m))
    return connection(("a", "b", "front_back"), way, way[[0, -1]], walls, drivable(MACHINE), 10.0).feasible


def bend_of(seed: int) -> Bend:
    """Draw a bend and judge it."""
    rng = np.random.default_rng([seed, 200])
    radius, turn = float(np.exp(rng.uniform(np.log(4.0), np.log(20.0)))), float(np.radians(rng.uniform(45.0, 110.0)))
    rule = swept_m(radius) + RULE_M if radius >= drivable(MACHINE).least_radius_m else math.inf
    search = searched_m(radius, turn, rng)
    width = float(np.clip(search, 2.8, 5.0) + rng.uniform(-0.8, 0.8))
    return Bend(radius, math.degrees(turn), width, rule, search, on_the_map(radius, turn, width))


def told(bends: list[Bend]) -> str:
    """Return how often they agree."""
    apart = np.array([one.rule_m - one.search_m for one in bends if math.isfinite(one.rule_m)])
    wrong = [one for one in bends if one.by_rule != one.by_search]
    tight = sum(math.isinf(one.rule_m) for one in wrong)
    off = [abs(one.width_m - one.search_m) for one in wrong if math.isfinite(one.rule_m)]
    bold = sum(one.by_rule and not one.by_search for one in bends)
    mapped = sum(one.map_says == one.by_search for one in bends)
    open_m = sum(one.map_says and not one.by_search for one in bends)
    return (
        f"{len(bends)} bends: rule and search agree in {len(bends) - len(wrong)}; the rule lets through {bold} that the search "
        f"does not; widths of the rule less those of the search {np.median(apart):+.2f} m (median; {apart.min():+.2f} to "
        f"{apart.max():+.2f}); of those in which they disagree {tight} are tighter than the machine, but "
        f"so wide that a wider line leads through, the others within {max(off, default=0.0):.2f} m of what is needed. "
        f"The map's check, whose front axle keeps to the centre line, agrees with the search in {mapped} and lets through "
        f"{open_m} that the search does not: it refuses what has room beside the machine on the outside alone."
    )


def main() -> int:
    """Draw, judge, tell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bends", type=int, default=200)
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    bends = [bend_of(seed) for seed in range(asked.bends)]
    if asked.json:
        asked.json.write_text(json.dumps([asdict(one) for one in bends]))
    print(told(bends))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

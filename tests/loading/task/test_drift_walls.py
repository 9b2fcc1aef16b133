"""The walls beside the way into a pile: found as lines, gone on behind the toe, and kept off while it digs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lhdmap.driving.motion import Motion
from lhdmap.geometry import se2
from lhdmap.loading.drift_walls import axis_rad, from_wall_to_wall, wall_lines, walls_beyond
from lhdmap.loading.moment import Moment, Target
from lhdmap.loading.positioning import curvature_pm
from lhdmap.loading.positioning_align import Aligner
from lhdmap.loading.positioning_boxes import Posture, charging, touches, turned
from lhdmap.loading.positioning_path import approach_path, is_free
from lhdmap.loading.positioning_steps import APPROACH, Positioning
from lhdmap.loading.signals import Signals
from lhdmap.loading.task_settings import LoadingSettings
from lhdmap.messages import FloatArray

from tests.guidance.tunnels import BODIES, MODEL

HALF_M, TOE_M = 2.3, 7.0


def drift(heading_rad: float, *, rough_m: float = 0.0, aside_m: float = 0.0) -> FloatArray:
    """Return hits on both walls up to the toe, in `base_link` of a machine that is turned and aside of the middle."""
    rng = np.random.default_rng(4)
    x = np.arange(-8.0, TOE_M, 0.1)
    sides = [np.column_stack([x, side * HALF_M + rng.normal(0.0, rough_m, len(x))]) for side in (-1.0, 1.0)]
    return se2.transform(se2.inverse(np.array([0.0, aside_m, heading_rad])), np.concatenate(sides))


def limits(heading_rad: float, skew_rad: float = 0.0, *, aside_m: float = 0.0) -> FloatArray:
    """Return E_R, E_L of a pile over the width of the drift, its toe askew by an angle, in `base_link` of that machine."""
    ends = np.array([[TOE_M + side * HALF_M * math.tan(skew_rad), side * HALF_M] for side in (-1.0, 1.0)])
    return se2.transform(se2.inverse(np.array([0.0, aside_m, heading_rad])), ends)


@pytest.mark.parametrize("heading_deg", [-8.0, 0.0, 5.0])
@pytest.mark.parametrize("skew_deg", [-15.0, 0.0, 15.0])
def test_the_way_in_is_along_the_walls_however_the_pile_lies(heading_deg: float, skew_deg: float) -> None:
    heading = math.radians(heading_deg)
    lines = wall_lines(drift(heading, rough_m=0.08), limits(heading, math.radians(skew_deg)))
    axis = axis_rad(lines)
    assert axis is not None
    assert axis == pytest.approx(-heading, abs=math.radians(1.0))
    right, left = lines
    assert right is not None
    assert left is not None
    assert (right.at_m, left.at_m) == pytest.approx((-HALF_M / math.cos(heading), HALF_M / math.cos(heading)), abs=0.1)


def test_a_hall_or_one_wall_has_no_direction() -> None:
    hits, at = drift(0.0), limits(0.0)
    assert axis_rad(wall_lines(hits[hits[:, 1] > 0.0], at)) is None
    assert axis_rad(wall_lines(np.zeros((0, 2)), at)) is None
    apart = hits * np.array([1.0, 1.0]) + np.where(hits[:, 1:] > 0.0, hits[:, :1] * [0.0, 0.3], 0.0)  # a funnel
    assert axis_rad(wall_lines(apart, at)) is None


@pytest.mark.parametrize("heading_deg", [-6.0, 0.0, 4.0])
@pytest.mark.parametrize(
    ("right_m", "left_m", "slope"), [(-0.6, 2.3, 0.0), (-2.9, 1.0, 0.2), (0.4, 2.8, -0.3), (-1.0, 1.2, 1.5)]
)
def test_a_bank_that_is_seen_alone_is_drawn_to_both_walls(
    heading_deg: float, right_m: float, left_m: float, slope: float
) -> None:
    """What was: of a pile dug deep on the right its left bank was taken for all of it, and the bucket met the left wall."""
    heading = math.radians(heading_deg)
    seen = np.array([[TOE_M + slope * right_m, right_m], [TOE_M + slope * left_m, left_m]])
    in_base = se2.transform(se2.inverse(np.array([0.0, 0.0, heading])), seen)
    drawn = from_wall_to_wall(in_base, wall_lines(drift(heading, rough_m=0.05), in_base))
    ends = se2.transform(np.array([0.0, 0.0, heading]), drawn)
    assert ends[:, 1] == pytest.approx([-HALF_M, HALF_M], abs=0.2)
    assert ends[:, 1].mean() == pytest.approx(0.0, abs=0.08)
    assert abs(ends[1, 0] - ends[0, 0]) < 2.0 * HALF_M * math.tan(math.radians(21.0))
    middle = seen.mean(axis=0)
    share = (middle[1] - ends[0, 1]) / (ends[1, 1] - ends[0, 1])
    assert ends[0, 0] + share * (ends[1, 0] - ends[0, 0]) == pytest.approx(
        middle[0], abs=0.1
    )  # it lies on the new line


def test_without_both_walls_limits_stay_what_they_are() -> None:
    at = limits(0.0)
    hits = drift(0.0)
    assert from_wall_to_wall(at, wall_lines(hits[hits[:, 1] > 0.0], at)) is at


def test_walls_go_on_behind_the_toe() -> None:
    heading = 0.1
    beyond = walls_beyond(wall_lines(drift(heading), limits(heading)), limits(heading), 2.0)
    in_drift = se2.transform(np.array([0.0, 0.0, heading]), beyond)
    assert np.abs(np.abs(in_drift[:, 1]) - HALF_M).max() < 0.05
    assert in_drift[:, 0].max() > TOE_M + 1.8


@pytest.mark.parametrize("skew_deg", [-15.0, 15.0])
@pytest.mark.parametrize("aside_m", [-0.3, 0.3])
def test_a_charge_at_an_askew_pile_keeps_off_the_walls_while_it_digs(skew_deg: float, aside_m: float) -> None:
    """What was: aimed across the face, the bucket met the wall 2 m behind the toe, which no scan had seen."""
    settings = LoadingSettings()
    at, hits = limits(0.05, math.radians(skew_deg), aside_m=aside_m), drift(0.05, aside_m=aside_m)
    aligner = Aligner(MODEL, BODIES, settings)
    aim = aligner.aim(0.0, at, hits)
    assert aim.bend_rad is not None
    x = np.arange(-8.0, TOE_M + 6.0, 0.1)
    whole = [np.column_stack([x, np.full(len(x), side * HALF_M)]) for side in (-1.0, 1.0)]
    rock = se2.transform(se2.inverse(np.array([0.0, aside_m, 0.05])), np.concatenate(whole))
    way = aligner.lands(aim.bend_rad, at).way_m + settings.dig_m
    start = Posture(np.zeros(3), aim.bend_rad)
    digs = charging(start, curvature_pm(aim.bend_rad, MODEL), way)
    assert not any(touches(one, rock, BODIES, MODEL, settings.wall_m) for one in digs)


@pytest.mark.parametrize("heading_deg", [-1.6, 2.5])
@pytest.mark.parametrize("bend_deg", [-0.9, 0.9])
def test_a_charge_that_would_land_askew_is_put_in_the_middle(heading_deg: float, bend_deg: float) -> None:
    """What was: any angle that landed was held; 7 m on the bucket was 0.6 m aside and 3.6 degrees askew, raised under the arch."""
    heading, bend = math.radians(heading_deg), math.radians(bend_deg)
    at, hits, aligner = limits(heading), drift(heading), Aligner(MODEL, BODIES, LoadingSettings())
    assert aligner.lands(bend, at, margin_m=0.15).good
    aim = aligner.aim(bend, at, hits)
    assert aim.bend_rad is not None
    start = Posture(np.array([0.0, 0.0, turned(bend, aim.bend_rad, MODEL)]), aim.bend_rad)
    way_m = aligner.lands(bend, at).way_m
    lip = np.array([[float(BODIES.front_box_m[1, 0]), 0.0]])
    for m in (way_m, way_m + LoadingSettings().dig_m):
        *_, last = charging(start, curvature_pm(aim.bend_rad, MODEL), m)
        middle = se2.transform(np.array([0.0, 0.0, heading]), se2.transform(last.base, lip))[0]
        assert abs(middle[1]) < 0.12
        assert abs(last.base[2] + heading) < math.radians(2.5)


def moment(pose: FloatArray, walls: FloatArray) -> Moment:
    """Return what is known of a machine at a pose that sees walls (N, 2), in its frame."""
    signals = Signals(0, 0.0, 0.0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Moment(
        0,
        signals,
        Motion(0, float(pose[0]), float(pose[1]), float(pose[2]), 0.0, 0.0, 0.0),
        walls,
        None,
        None,
        None,
        None,
        0,
    )


@pytest.mark.parametrize(("far_m", "speed_mps", "aims"), [(12.5, 0.1, True), (12.5, 1.0, False), (16.0, 0.1, False)])
def test_where_guidance_only_crawls_before_the_pile_it_is_aimed_from_there(
    far_m: float, speed_mps: float, aims: bool
) -> None:
    """What was: between the banks of its pile a machine crept until the time limit, 0.3 m before it would have been aimed."""
    positioning = Positioning(MODEL, BODIES, LoadingSettings())
    x = TOE_M - far_m + MODEL.front_m  # of base_link, whose joint is so far before the pile
    ends = limits(0.0)
    first = moment(np.array([x, 0.0, 0.0]), drift(0.0) - [x, 0.0])
    now = first._replace(
        target=Target(ends, ends.mean(axis=0), 0.0, 0), motion=first.motion._replace(speed_mps=speed_mps)
    )
    positioning.begin(now)
    phases = [positioning.step(now._replace(now_ns=k * 100_000_000)).phase for k in range(60)]
    assert phases[30] == APPROACH
    assert (phases[-1] != APPROACH) == aims


def test_a_pile_seen_from_a_bend_is_not_driven_to_through_the_rock() -> None:
    """A draw point to the right, seen past the corner: the straight way to a pile told 3 m off leads through its wall."""
    parts = ((-1.0, np.arange(6.0, 30.0, 0.1)), (1.0, np.arange(12.0, 30.0, 0.1)))
    walls = np.concatenate([np.column_stack([x, np.full(len(x), side * HALF_M)]) for side, x in parts])
    pose = np.array([0.0, 4.0, -0.6])
    seen = se2.transform(se2.inverse(pose), walls)
    for middle_m, free in ((0.0, True), (-3.0, False)):
        ends = np.array([[30.0, middle_m - HALF_M], [30.0, middle_m + HALF_M]])
        target = Target(ends, ends.mean(axis=0), 0.0, 0)
        now = moment(pose, seen[seen[:, 0] > 3.0])
        assert is_free(approach_path(now.motion, target, 4.0, 1.0), now, target) == free

"""Eqs. (3) to (6) against constructions whose answer is known: drawn circles, points drawn in boxes, drives of the kinematics."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from lhdmap.driving.kernel import stepped, trailing
from lhdmap.loading.positioning import Lands, crossing, curvature_pm, landing, lands, shares, side_of
from lhdmap.loading.positioning_align import shrunk
from lhdmap.loading.positioning_boxes import (
    Posture,
    box_at,
    charging,
    inside,
    rear_of,
    touches,
    turned,
    turning,
)
from lhdmap.messages import FloatArray

from tests.guidance.tunnels import BODIES, MODEL, room

coordinate = st.floats(-30.0, 30.0)
angle = st.floats(-math.pi, math.pi)


def point(x: float, y: float) -> FloatArray:
    return np.array([x, y])


@given(coordinate, coordinate, st.floats(1.0, 40.0), angle, angle)
def test_shares_are_points_of_the_circle(cx: float, cy: float, radius: float, a: float, b: float) -> None:
    """Both limits are drawn on the circle itself: S is 0 and 1."""
    assume(abs(math.sin(0.5 * (a - b))) > 0.05)
    right = point(cx + radius * math.cos(a), cy + radius * math.sin(a))
    left = point(cx + radius * math.cos(b), cy + radius * math.sin(b))
    found = shares(right, left, point(cx, cy), radius)
    assert found is not None
    np.testing.assert_allclose(sorted(found), [0.0, 1.0], atol=1e-7)


@given(coordinate, coordinate, coordinate, coordinate, coordinate, coordinate, st.floats(0.5, 60.0))
def test_corrected_eq_5_solves_the_intersection(
    rx: float, ry: float, lx: float, ly: float, cx: float, cy: float, radius: float
) -> None:
    right, left, center = point(rx, ry), point(lx, ly), point(cx, cy)
    E = left - right
    length = float(np.hypot(*E))
    assume(length > 0.5)
    away = abs(float(E[0] * (center - right)[1] - E[1] * (center - right)[0])) / length
    assume(abs(away - radius) > 1e-3)
    found = shares(right, left, center, radius)
    assert (found is None) == (away > radius)
    for share in found or ():
        assert math.isclose(float(np.hypot(*(right + share * E - center))), radius, rel_tol=1e-6, abs_tol=1e-6)


def test_eq_5_as_printed_is_wrong_on_random_pairs_and_the_corrected_one_right_on_all() -> None:
    rng, wrong = np.random.default_rng(885), 0
    for _ in range(885):
        right, left, center = rng.uniform(-20.0, 20.0, (3, 2))
        E, EC = left - right, center - right
        radius = abs(E[0] * EC[1] - E[1] * EC[0]) / float(np.hypot(*E)) * rng.uniform(1.05, 3.0) + 0.1
        found = shares(right, left, center, radius)
        assert found is not None
        off = [abs(float(np.hypot(*(right + share * E - center))) - radius) for share in found]
        assert max(off) < 1e-9 * (1.0 + radius) * 1e3
        along, square = float(E @ EC), float(E @ E)
        root = math.sqrt((2.0 * along) ** 2 - 4.0 * square * (float(EC @ EC) - radius**2))
        printed = [(-2.0 * along + sign * root) / (2.0 * math.sqrt(square)) for sign in (-1.0, 1.0)]
        wrong += max(abs(float(np.hypot(*(right + share * E - center))) - radius) for share in printed) > 1e-3
    assert wrong == 885


@settings(deadline=None)  # compiles at the first example
@given(st.floats(-0.6, 0.6), st.floats(4.0, 20.0), st.floats(-0.5, 0.5), st.floats(-3.0, 3.0), st.floats(1.0, 3.0))
def test_the_crossing_is_where_a_drive_with_held_joint_meets_the_line(
    bend: float, ahead: float, skew: float, aside: float, half: float
) -> None:
    """Eq. (3) rolled out in small steps by the kernel of guidance, which shares no code with it."""
    curvature = curvature_pm(bend, MODEL)
    across = np.array([math.sin(skew), math.cos(skew)])
    middle = np.array([ahead, aside])
    limits = np.stack([middle - half * across, middle + half * across])
    corner = np.array([3.2, 1.225])
    got = crossing(corner, curvature, limits)
    state, before, share = (0.0, 0.0, 0.0, bend, 0.0), 0.0, math.nan
    normal = np.array([across[1], -across[0]])
    for step in range(4000):
        x, y, heading, *_ = state
        place = np.array(
            [
                x + 3.2 * math.cos(heading) - 1.225 * math.sin(heading),
                y + 3.2 * math.sin(heading) + 1.225 * math.cos(heading),
            ]
        )
        off = float((place - middle) @ normal)
        if step and before < 0.0 <= off:
            share = float((place - limits[0]) @ across) / (2.0 * half)
            break
        if abs(heading) > 0.9 * math.pi or off > 0.0:
            break
        before = off
        state = stepped(state, 1.0, 0.0, 0.01, MODEL.front_m, MODEL.rear_m, 0.2)
    assume(math.isfinite(share))
    assert math.isclose(got.share, share, abs_tol=0.02 * max(1.0, abs(share)))


@given(st.floats(-0.3, 0.3), st.floats(5.0, 15.0), st.floats(-3.0, 3.0), st.floats(1.5, 3.0))
def test_sides_are_left_and_right_of_the_limits(bend: float, ahead: float, aside: float, half: float) -> None:
    curvature = curvature_pm(bend, MODEL)
    limits = np.array([[ahead, aside - half], [ahead, aside + half]])
    got = crossing(np.array([3.2, 0.0]), curvature, limits)
    assume(math.isfinite(got.share))
    y = aside - half + got.share * 2.0 * half
    side = lands(got, curvature)
    assert side == (Lands.INSIDE if abs(y - aside) < half else Lands.LEFT if y > aside else Lands.RIGHT)


def test_the_papers_rule_of_both_shares() -> None:
    assert side_of((0.4, 7.0), 0.1) == Lands.INSIDE
    assert side_of((-0.2, -3.0), 0.1) == Lands.RIGHT
    assert side_of((1.2, 5.0), 0.1) == Lands.LEFT
    assert side_of(None, 0.1) == Lands.LEFT
    assert side_of(None, -0.1) == Lands.RIGHT


def test_a_circle_that_meets_the_line_behind_the_machine_alone_lands_nowhere() -> None:
    """The printed rule, which does not ask where, takes the crossing behind for a hit."""
    curvature, limits = 1.0 / 4.0, np.array([[-2.0, -2.0], [-2.0, 9.0]])
    found = shares(limits[0], limits[1], np.array([0.0, 4.0]), 4.0)
    assert side_of(found, curvature) == Lands.INSIDE
    ahead = crossing(np.zeros(2), curvature, limits)
    assert math.isnan(ahead.share)  # more than half a turn away
    assert lands(ahead, curvature) == Lands.LEFT


def test_straight_on_both_corners_land_where_they_point() -> None:
    limits = np.array([[10.0, -2.0], [10.0, 2.0]])
    got = landing(0.0, np.array([[3.2, 1.2], [3.2, -1.2]]), limits)
    assert got.good
    assert math.isclose(got.way_m, 6.8)
    assert math.isclose(got.middle, 0.5)
    assert landing(0.0, np.array([[3.2, 2.2], [3.2, -0.2]]), limits).left == Lands.LEFT


def test_limits_are_drawn_in_on_both_sides() -> None:
    limits = np.array([[10.0, -2.0], [10.0, 2.0]])
    np.testing.assert_allclose(shrunk(limits, 0.5), [[10.0, -1.5], [10.0, 1.5]])
    assert np.ptp(shrunk(limits, 5.0)[:, 1]) > 1.0


@given(coordinate, coordinate, angle, st.floats(0.01, 0.99), st.floats(0.01, 0.99), st.floats(0.0, 0.3))
def test_points_drawn_in_a_box_are_inside_and_those_beside_it_are_not(
    x: float, y: float, heading: float, u: float, v: float, margin: float
) -> None:
    low_high = BODIES.front_box_m
    box = box_at(low_high, np.array([x, y, heading]), margin)
    c, s = math.cos(heading), math.sin(heading)
    low, high = low_high[0] - margin, low_high[1] + margin

    def placed(share: tuple[float, float]) -> FloatArray:
        local = low + np.array(share) * (high - low)
        return np.array([[x + c * local[0] - s * local[1], y + s * local[0] + c * local[1]]])

    assert inside(box, placed((u, v)))[0]
    for outside in ((u, 1.0 + v), (u, -v), (1.0 + u, v), (-u, v)):
        assert not inside(box, placed(outside))[0]


@given(st.floats(-0.6, 0.6), st.floats(-5.0, 5.0), st.floats(-4.0, 4.0))
def test_both_boxes_say_what_the_rectangles_distance_says(bend: float, px: float, py: float) -> None:
    wall = np.array([[px, py]])
    apart = room(np.array([0.0, 0.0, 0.0, bend]), wall)
    assume(abs(apart) > 1e-6)
    assert touches(Posture(np.zeros(3), bend), wall, BODIES, MODEL, 0.0) == (apart < 0.0)


@settings(deadline=None)  # compiles at the first example
@given(st.floats(-0.6, 0.6), st.floats(0.5, 12.0))
def test_a_charge_runs_along_the_circle_of_the_kinematics(bend: float, way: float) -> None:
    state = (0.0, 0.0, 0.0, bend, 0.0)
    steps = 200
    for _ in range(steps):
        state = stepped(state, 1.0, 0.0, way / steps, MODEL.front_m, MODEL.rear_m, 0.2)
    last = list(charging(Posture(np.zeros(3), bend), curvature_pm(bend, MODEL), way))[-1]
    np.testing.assert_allclose(last.base, state[:3], atol=2e-3)
    np.testing.assert_allclose(rear_of(last, MODEL), trailing(state, MODEL.front_m, MODEL.rear_m), atol=4e-3)


@settings(deadline=None)  # compiles at the first example
@given(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6))
def test_turning_the_joint_alone_turns_the_front_body_as_eq_1_says(bend: float, to: float) -> None:
    state, steps = (0.0, 0.0, 0.0, bend, (to - bend) / 5.0), 500
    for _ in range(steps):
        state = stepped(state, 0.0, (to - bend) / 5.0, 5.0 / steps, MODEL.front_m, MODEL.rear_m, 0.2)
    assert math.isclose(turned(bend, to, MODEL), state[2], abs_tol=1e-4)
    last = list(turning(bend, to, MODEL))[-1]
    assert math.isclose(last.bend_rad, to, abs_tol=1e-12)
    np.testing.assert_allclose(last.base, [0.0, 0.0, state[2]], atol=1e-4)

"""A pile in another frame: only places move."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lhdmap.pile.moved import moved_report
from lhdmap.pile.result import AttackPoint, Boulder, PileApproach, PileEstimate, PileReport, Snapshot

T = np.array([1.0, 2.0, math.pi / 2])  # a quarter turn to the left, then the shift
PLACE, MOVED = np.array([3.0, 1.0, 0.5]), np.array([0.0, 5.0, 0.5])


def report() -> PileReport:
    pile = PileEstimate(
        status="loadable",
        center_m=PLACE,
        left_limit_m=PLACE,
        right_limit_m=PLACE,
        width_m=4.0,
        inclination_deg=-40.0,
        boulders=(Boulder(PLACE, 1.2),),
        attack=AttackPoint(PLACE, 0.1),
        toe_m=np.stack([PLACE, PLACE]),
        face_m=np.stack([PLACE, PLACE]),
    )
    last = Snapshot(7, 9.0, pile)
    return PileReport(last, last, (last,), around_m=PLACE[None], piles=(PileApproach(last, last),))


def test_all_places_move_and_nothing_else() -> None:
    moved = moved_report(report(), lambda _: T)
    assert moved.last is not None
    pile = moved.last.estimate
    for place in (
        pile.center_m,
        pile.left_limit_m,
        pile.right_limit_m,
        pile.boulders[0].center_m,
        *pile.toe_m,
        *pile.face_m,
    ):
        assert place == pytest.approx(MOVED)
    assert pile.attack is not None
    assert pile.attack.point_m == pytest.approx(MOVED)
    assert pile.attack.heading_rad == pytest.approx(0.1 + math.pi / 2)
    assert moved.around_m[0] == pytest.approx(MOVED)
    assert (pile.width_m, pile.inclination_deg, pile.boulders[0].size_m, moved.last.distance_m) == (
        4.0,
        -40.0,
        1.2,
        9.0,
    )


def test_each_pile_moves_by_its_own_motion() -> None:
    """A loop that was closed later moves what was seen before it more than what was seen after it."""
    one = report().piles[0]
    later = PileApproach(one.decision, one.last._replace(stamp_ns=8))
    both = replace(report(), piles=(one, later))
    moved = moved_report(both, lambda stamp_ns: T if stamp_ns == 7 else np.zeros(3))
    assert moved.piles[0].last.estimate.center_m == pytest.approx(MOVED)
    assert moved.piles[0].decision.estimate.toe_m[0] == pytest.approx(MOVED)
    assert moved.piles[1].last.estimate.center_m == pytest.approx(PLACE)


def test_a_report_of_nothing_stays_one() -> None:
    moved = moved_report(PileReport(None, None), lambda _: T)
    assert moved.last is None
    assert moved.decision is None

"""A pile in another frame: what was measured while driving, moved with the path when that becomes another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from lhdmap.geometry import se2
from lhdmap.messages import FloatArray
from lhdmap.pile.result import AttackPoint, PileApproach, PileEstimate, PileReport, Snapshot


def moved_report(report: PileReport, motion_at: Callable[[int], FloatArray]) -> PileReport:
    """Return the report with all that lies in space moved; heights stay.

    `motion_at`: planar motion (3,) of what was measured at a time (ns). A pile is moved as a whole, as its last estimate is.
    """
    if report.last is None:
        return report
    T_to_from = motion_at(report.last.stamp_ns)
    history = tuple(_moved_snapshot(one, T_to_from) for one in report.history)
    decision, last = (one and _moved_snapshot(one, T_to_from) for one in (report.decision, report.last))
    around = se2.transform(T_to_from, report.around_m)
    piles = tuple(_moved_approach(one, motion_at(one.last.stamp_ns)) for one in report.piles)
    return replace(report, history=history, decision=decision, last=last, around_m=around, piles=piles)


def _moved_approach(pile: PileApproach, T_to_from: FloatArray) -> PileApproach:
    return PileApproach(_moved_snapshot(pile.decision, T_to_from), _moved_snapshot(pile.last, T_to_from))


def _moved_snapshot(snapshot: Snapshot, T_to_from: FloatArray) -> Snapshot:
    return snapshot._replace(estimate=_moved_estimate(snapshot.estimate, T_to_from))


def _moved_estimate(estimate: PileEstimate, T_to_from: FloatArray) -> PileEstimate:
    def point(place: FloatArray) -> FloatArray:
        return se2.transform(T_to_from, place[None])[0]

    attack = estimate.attack
    if attack is not None:
        attack = AttackPoint(point(attack.point_m), attack.heading_rad + float(T_to_from[2]))
    return replace(
        estimate,
        center_m=point(estimate.center_m),
        left_limit_m=point(estimate.left_limit_m),
        right_limit_m=point(estimate.right_limit_m),
        boulders=tuple(one._replace(center_m=point(one.center_m)) for one in estimate.boulders),
        attack=attack,
        toe_m=se2.transform(T_to_from, estimate.toe_m),
        face_m=se2.transform(T_to_from, estimate.face_m),
    )
